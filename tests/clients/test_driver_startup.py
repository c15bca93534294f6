"""A driver built on the maker's client library starts on a box as on a real arm: dashboard, RTDE, primary port.

It refuses what the library refuses when it is built for its own tests: sub-packages that are shorter or longer
than the software announces, another arm than the one it was started for, recipes with unknown names.
"""

import re
import struct
from itertools import pairwise

import pytest
from clients_support import connect, served_box, wait_until
from strict_clients import (
    CONFIGURATION,
    KINEMATICS,
    MASTERBOARD,
    MODE,
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
# The recipes of the ROS 2 driver.
DRIVER_OUTPUTS = (
    "timestamp", "actual_q", "actual_qd", "speed_scaling", "target_speed_fraction", "runtime_state",
    "actual_TCP_force", "actual_TCP_pose", "target_TCP_pose", "actual_digital_input_bits",
    "actual_digital_output_bits", "standard_analog_input0", "standard_analog_input1",
    "standard_analog_output0", "standard_analog_output1", "analog_io_types", "tool_mode",
    "tool_analog_input_types", "tool_analog_input0", "tool_analog_input1", "tool_output_voltage",
    "tool_output_current", "tool_temperature", "robot_mode", "safety_mode", "robot_status_bits",
    "safety_status_bits", "actual_current", "tcp_offset", "payload", "payload_cog", "payload_inertia",
)  # fmt: skip
DRIVER_INPUTS = (
    "speed_slider_mask", "speed_slider_fraction", "standard_digital_output_mask", "standard_digital_output",
    "configurable_digital_output_mask", "configurable_digital_output", "tool_digital_output_mask",
    "tool_digital_output", "standard_analog_output_mask", "standard_analog_output_type",
    "standard_analog_output_0", "standard_analog_output_1",
)  # fmt: skip
# First software of outputs that the driver leaves out where the robot does not have them.
SINCE = {"payload_inertia": (5, 11)}
# What the reader holds at most of a package.
READER_SIZE = 4096
# The oldest software that the library takes, and a new one.
FOR_DRIVERS = pytest.mark.parametrize(
    "box", [pytest.param("5.9.4", marks=pytest.mark.nightly), "5.25.1"], indirect=True
)


@pytest.fixture(scope="module")
def box(tmp_path_factory, request):
    folder = tmp_path_factory.mktemp("e_series")
    with served_box(folder, "--robot", "ur5e", "--software", request.param) as served:
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
    with StrictRtde(box) as client:
        assert client.controller() == version
        client.want(*(name for name in DRIVER_OUTPUTS if version >= SINCE.get(name, (0,))), frequency=rate)
        client.start()
        stamps = [client.data()["timestamp"] for _ in range(20)]
        client.pause()
        assert client.inputs(*DRIVER_INPUTS) == 1
        client.start()
        assert client.data()["robot_mode"] == 7
    return round(min(after - before for before, after in pairwise(stamps)), 6)


def read_setup(box, version):
    """Read the primary port until the configuration data; return the robot type."""
    with PrimaryWire(box) as wire:
        check_version(wire.message(VERSION_MESSAGE)[1], version)
        parts = wire.state()
    configuration = 444 if version >= (5, 25, 1) else 440
    sizes = {MODE: 42, MASTERBOARD: 70, KINEMATICS: 220, CONFIGURATION: configuration}
    assert {part: len(parts[part]) for part in sizes} == sizes
    assert 5 + sum(5 + len(body) for body in parts.values()) < READER_SIZE
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
        said = wire.titles_and_texts(3)
    assert said == [
        ("PROGRAM_XXX_STARTED", "externalControl"),
        "0.002",
        ("PROGRAM_XXX_STOPPED", "externalControl"),
    ]


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
