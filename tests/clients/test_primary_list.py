"""What a primary client wants of the box: the acceptance list of Universal_Robots_Client_Library, row by row."""

import struct

import pytest
from clients_support import TIMEOUT, served_box
from strict_clients import (
    CONFIGURATION,
    ERROR,
    EXCEPTION,
    KINEMATICS,
    MASTERBOARD,
    MODE,
    SAFETY_MODE,
    PrimaryWire,
    StrictRtde,
)

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


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    """In lockstep: nothing here needs a client that is in time."""
    options = ("--pace", "lockstep", "--robot", "ur5e", "--software", "5.25.1")
    with served_box(tmp_path_factory.mktemp("box"), *options) as served:
        yield served


@pytest.fixture
def primary(box):
    with PrimaryWire(box) as wire:
        yield wire


def test_soon_after_connecting(box):
    """Version first; configuration and kinematics with the first states."""
    with PrimaryWire(box) as wire:
        kind, _ = wire.package()
        assert kind == 20
        seen = {}
        for _ in range(3):
            seen |= wire.state()
    assert {MODE, MASTERBOARD, KINEMATICS, CONFIGURATION} <= seen.keys()
    assert len(seen[KINEMATICS]) == 6 * 4 + 24 * 8 + 4
    assert robot_mode(seen) == RUNNING


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


def test_started_text_stopped(primary):
    primary.write('def talk():\n\ttextmsg("hello from a program")\nend\n')
    assert primary.titles_and_texts(3) == [
        ("PROGRAM_XXX_STARTED", "talk"),
        "hello from a program",
        ("PROGRAM_XXX_STOPPED", "talk"),
    ]


def exception(primary):
    """Return line, column and text of the next runtime exception."""
    _, body = primary.message(EXCEPTION)
    return *struct.unpack_from(">ii", body), body[8:].decode()


def test_an_unknown_function_is_named_with_its_place(primary):
    primary.write("def bad():\n  nothing_like_it()\nend\n")
    assert exception(primary) == (2, 3, "compile_error_name_not_found:nothing_like_it:")


def test_an_unreachable_joint_move_is_an_exception(primary):
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


def test_halt_alone_is_a_program(primary):
    primary.write("halt\n")
    titles = [title for title, _ in primary.titles_and_texts(2)]
    assert titles == ["PROGRAM_XXX_STARTED", "PROGRAM_XXX_STOPPED"]


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
