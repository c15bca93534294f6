"""A driver built on the maker's client library starts on a box as on a real arm: dashboard, RTDE, primary port.

Then what its primary client wants of the box. It refuses what the library refuses when it is built for its own tests: sub-packages that are shorter or longer
than the software announces, another arm than the one it was started for, recipes with unknown names.
"""

import re
import struct
from itertools import pairwise
from pathlib import Path

import pytest
from clients_support import TIMEOUT, connect, served_box, submit, wait_until
from strict_clients import (
    CONFIGURATION,
    ERROR,
    EXCEPTION,
    KINEMATICS,
    MASTERBOARD,
    MODE,
    SAFETY_MODE,
    TEXT_MESSAGE,
    VERSION_MESSAGE,
    PrimaryWire,
    StrictRtde,
)

from protocol.primary.layout import ConfigurationData
from protocol.rtde.fields import OUTPUTS
from protocol.ur_types import SoftwareVersion
from ur_emulator.host.ports.primary.robot_state import setup_records
from ur_emulator.machine.controller.safety.safety_state import limits_of
from ur_emulator.machine.models.generations import E_SERIES
from ur_emulator.machine.models.robots import ROBOTS

# What a driver is started for: type code and series of the arm.
UR_TYPES = {
    "ur3e": (3, "E"), "ur5e": (1, "E"), "ur7e": (1, "E"), "ur10e": (2, "E"), "ur12e": (2, "E"), "ur16e": (4, "E"),
    "ur8long": (6, "UR"), "ur15": (9, "UR"), "ur18": (5, "UR"), "ur20": (7, "UR"), "ur30": (8, "UR"),
}  # fmt: skip
# The recipes of the ROS 2 driver, in files of names as it has them.
DRIVER_OUTPUTS, DRIVER_INPUTS = (
    (Path(__file__).parent / f"driver_{way}.txt").read_text().split() for way in ("outputs", "inputs")
)
# First software of outputs that the driver leaves out where the robot does not have them.
SINCE = {"payload_inertia": (5, 11)}
# What the reader holds at most of a package.
READER_SIZE = 4096
# The oldest software that the library takes, and a new one.
FOR_DRIVERS = pytest.mark.parametrize(
    "box", [pytest.param("5.9.4", marks=pytest.mark.nightly), "5.25.1"], indirect=True
)


@pytest.fixture(scope="module", params=["5.25.1"])
def box(tmp_path_factory, request):
    """In lockstep: nothing here needs a client that is in time."""
    options = ("--pace", "lockstep", "--robot", "ur5e", "--software", request.param)
    with served_box(tmp_path_factory.mktemp("e_series"), *options) as served:
        served.software = request.param
        yield served


def ask_version(box):
    """Read the greeting of the dashboard, and ask it for the software: the four numbers before the bracket."""
    with connect(box, "dashboard") as sock, sock.makefile("rb") as lines:
        assert lines.readline() == b"Connected: Universal Robots Dashboard Server\n"
        sock.sendall(b"PolyscopeVersion\n")
        reply = lines.readline().decode()
    numbers = re.fullmatch(r"URSoftware (\d+\.\d+\.\d+\.\d+) \(\w{3} \d{2} \d{4}\)\n", reply)
    assert numbers, reply
    return tuple(map(int, numbers[1].split(".")))


def start_rtde(box, version, rate):
    """Set up outputs, read data, set up inputs; return the time between two packages at the full rate [s]."""
    submit(box, "def busy():\n  sleep(1000)\nend\n")  # so that time passes
    with StrictRtde(box) as client:
        assert client.controller() == version
        client.want(*(name for name in DRIVER_OUTPUTS if version >= SINCE.get(name, (0,))), frequency=rate)
        client.start()
        client.until(lambda values: values["runtime_state"] == 2)
        stamps = [client.data()["timestamp"] for _ in range(20)]
        client.pause()
        submit(box, "stop program\n")
        assert client.inputs(*DRIVER_INPUTS) == 1
        client.start()
        assert client.until(lambda values: values["runtime_state"] == 1)["robot_mode"] == 7
    return round(min(after - before for before, after in pairwise(stamps)), 6)


def read_setup(box, version):
    """Read the primary port until the configuration data; return the robot type."""
    with PrimaryWire(box) as wire:
        kind, body = wire.package()
        assert (kind, body[9]) == (20, VERSION_MESSAGE), "the version comes first"
        check_version(body[10:], version)
        parts = wire.state()
    configuration = 444 if version >= (5, 25, 1) else 440
    sizes = {MODE: 42, MASTERBOARD: 70, KINEMATICS: 220, CONFIGURATION: configuration}
    assert {part: len(parts[part]) for part in sizes} == sizes
    assert 5 + sum(5 + len(body) for body in parts.values()) < READER_SIZE
    assert robot_mode(parts) == RUNNING
    assert parts[MASTERBOARD][62] == 0  # no Euromap67 board, so its fields are absent
    *_, robot_type, sub_type = struct.unpack_from(">4i", parts[CONFIGURATION], 424)
    assert sub_type == 3
    return robot_type


def check_version(body, version):
    """Check the version message: the project's name, the three numbers, build 0 and a date of 20 characters."""
    name = body[1 : 1 + body[0]].decode()
    major, minor, bugfix, build = struct.unpack_from(">BBii", body, 1 + body[0])
    assert (name, major, minor, bugfix, build) == ("URControl", *version[:3], 0)
    assert re.fullmatch(r"\d\d-\d\d-\d{4}, \d\d:\d\d:\d\d", body[1 + body[0] + 10 :].decode())


def series(robot_type):
    """Return the series of an arm of 5.x by its type: those from 5 on came after the e-Series."""
    return "UR" if robot_type >= 5 else "E"


@FOR_DRIVERS
def test_a_driver_for_this_arm_and_for_no_other_starts(box):
    version = ask_version(box)
    assert ".".join(map(str, version[:3])) == box.software
    assert start_rtde(box, version, 500.0) == 0.002
    robot_type = read_setup(box, version)
    assert (robot_type, series(robot_type)) == UR_TYPES["ur5e"]


@FOR_DRIVERS
def test_all_outputs_can_be_asked_for_at_once(box):
    """The library's list of all names, then the same without those that this software does not have."""
    software = SoftwareVersion.parse(box.software)
    absent = {field.name for field in OUTPUTS if not field.since.covers(software)}
    names = [field.name for field in OUTPUTS]
    with StrictRtde(box) as client:
        number, types = client.types_of_outputs(names, 500.0)
        assert {name for name, kind in zip(names, types, strict=True) if kind == "NOT_FOUND"} == absent
        assert number == (0 if absent else 1)
        client.want(*(name for name in names if name not in absent), frequency=500.0)
        client.start()
        assert client.data()["timestamp"] > 0.0


@FOR_DRIVERS
def test_a_program_sent_at_once_runs_at_500_hz(box):
    with PrimaryWire(box) as wire:
        wire.write("stop program\ndef externalControl():\n\ttextmsg(get_steptime())\nend\n")
        started, said, stopped = wire.titles_and_texts(3)
        assert (started, stopped) == tuple(
            (f"PROGRAM_XXX_{what}", "externalControl") for what in ("STARTED", "STOPPED")
        )
        assert said == "0.002"
        wire.write("halt\n")  # a program by itself
        titles = [title for title, _ in wire.titles_and_texts(2)]
        assert titles == ["PROGRAM_XXX_STARTED", "PROGRAM_XXX_STOPPED"]


@pytest.mark.nightly
def test_a_driver_for_a_cb3_sets_up_rtde_and_writes_into_the_log(tmp_path):
    text, source = b"written by a client", b"driver"
    with served_box(tmp_path) as box:
        assert start_rtde(box, ask_version(box), 125.0) == 0.008
        with StrictRtde(box) as client:
            client.send(TEXT_MESSAGE, bytes([len(text)]) + text + bytes([len(source)]) + source + b"\3")
            wait_until(lambda: "INFO driver: written by a client" in box.log.read_text(), "the text")


@pytest.mark.parametrize("name", [name for name, robot in ROBOTS.items() if robot.generation is E_SERIES])
def test_every_arm_is_the_type_that_its_driver_expects(name):
    robot = ROBOTS[name]
    setup = setup_records(robot, robot.dh, limits_of(robot))
    (told,) = (record for record in setup if isinstance(record, ConfigurationData))
    assert (told.robot_type, series(told.robot_type)) == UR_TYPES[name]


# --- the acceptance list of Universal_Robots_Client_Library, row by row


POWER_OFF, IDLE, RUNNING = 3, 5, 7
PROTECTIVE_STOP_CODE = 209
WARNING = 2


def robot_mode(state):
    """Return the robot mode of a state: after the time, seven flags."""
    return state[MODE][15]


def is_protective_stopped(state):
    return bool(state[MODE][12])


def until(primary, condition):
    for _ in range(int(TIMEOUT * 10)):
        if condition(state := primary.state()):
            return state
    raise AssertionError("what was waited for did not come")


@pytest.fixture
def primary(box):
    with PrimaryWire(box) as wire:
        yield wire


def test_power_words(primary):
    primary.write("power on\n")
    assert robot_mode(until(primary, lambda s: robot_mode(s) == RUNNING)) == RUNNING, "a running arm stays so"
    primary.write("power off\n")
    until(primary, lambda s: robot_mode(s) == POWER_OFF)
    primary.write("def now():\n\ttextmsg(1)\nend\n")
    primary.write("power on\n")
    until(primary, lambda s: robot_mode(s) == IDLE)
    primary.write("set robotmode run\n")
    until(primary, lambda s: robot_mode(s) == RUNNING)
    primary.write("power off\n")
    until(primary, lambda s: robot_mode(s) == POWER_OFF)
    primary.write("set robotmode run\n")
    until(primary, lambda s: robot_mode(s) == RUNNING)


def test_stop_program_may_be_said_again_and_again(primary):
    primary.write("stop program\nstop program\n")
    primary.write("def loop():\n\twhile True:\n\t\tsync()\n\tend\nend\n")
    until(primary, lambda s: s[MODE][13] == 1)
    primary.write("stop program\n")
    until(primary, lambda s: s[MODE][13] == 0)
    primary.write("stop program\n")
    assert robot_mode(primary.state()) == RUNNING


def exception(primary):
    """Return line, column and text of the next runtime exception."""
    _, body = primary.message(EXCEPTION)
    return *struct.unpack_from(">ii", body), body[8:].decode()


def test_an_unknown_function_and_an_unreachable_joint_move_are_exceptions(primary):
    primary.write("def bad():\n  nothing_like_it()\nend\n")
    assert exception(primary) == (2, 3, "compile_error_name_not_found:nothing_like_it:")
    primary.write("def far():\n\tmovej(p[10, 0, 0, 0, 0, 0])\nend\n")
    line, _, text = exception(primary)
    assert line == 2
    assert text
    assert not is_protective_stopped(primary.state())


def error_codes(primary):
    """Return code, argument and level of the errors until the safety mode message."""
    while True:
        kind, body = primary.message(ERROR, SAFETY_MODE)
        if kind == SAFETY_MODE:
            return
        yield struct.unpack_from(">iii", body)


def unlock(primary):
    """Unlock as a primary client does, which need not wait for the five seconds of the dashboard."""
    until(primary, is_protective_stopped)
    primary.write("set unlock protective stop\n")
    until(primary, lambda s: not is_protective_stopped(s))
    primary.write("stop program\n")


def test_an_unreachable_linear_move_is_a_protective_stop(primary):
    primary.write("def far():\n\tmovel(p[10, 0, 0, 0, 0, 0])\nend\n")
    codes = list(error_codes(primary))
    assert codes
    assert all(level >= WARNING for _, _, level in codes)
    unlock(primary)


def test_a_secondary_protective_stop_is_one_error_code(primary):
    primary.write("sec stop():\n\tprotective_stop()\nend\n")
    codes = [(code, argument) for code, argument, _ in error_codes(primary)]
    assert codes == [(PROTECTIVE_STOP_CODE, 0)]
    unlock(primary)


def test_a_tool_that_is_set_is_the_tool(box, primary):
    tool = (0.01, -0.02, 0.12, 0.3, -0.2, 0.1)
    with StrictRtde(box) as rtde:
        rtde.want("timestamp", "tcp_offset", "payload")
        rtde.start()
        primary.write(f"sec setup():\n\tset_tcp(p{list(tool)})\nend\n")
        assert rtde.until(lambda v: any(v["tcp_offset"]))["tcp_offset"] == tool
        primary.write("sec setup():\n\tset_payload(0.5, [0, 0, 0.05])\nend\n")
        rtde.until(lambda v: v["payload"] == 0.5)
        primary.write("sec setup():\n\tset_tcp(p[0,0,0,0,0,0])\nend\nsec setup():\n\tset_payload(0)\nend\n")
        rtde.until(lambda v: not any(v["tcp_offset"]) and v["payload"] == 0.0)
