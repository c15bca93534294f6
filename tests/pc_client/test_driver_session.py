"""Opening a session, the programs and questions around it: a robot in memory."""

from __future__ import annotations

import re

import pytest
from fake_robot import LAYOUT, FakeRobot, Pipe

from pc_client.driver.primary import PackageStream
from pc_client.driver.questions import ask_dashboard
from pc_client.driver.receiver import REVERSE_PORT, ReverseServer, fill_template, receiver_script
from pc_client.driver.session import UrDriver, stop_script
from pc_client.errors import DriverError, RobotStoppedError
from pc_client.recording.provenance import origin_of
from protocol.primary.layout import CartesianInfo, ConfigurationData, KinematicsInfo, RobotModeData
from protocol.primary.messages import KeyMessage, TextMessage
from protocol.primary.packages import encode_message_package, encode_state
from protocol.primary.values import (
    GlobalVariablesSetup,
    GlobalVariablesUpdate,
    TypedValue,
    ValueType,
    encode_program_state,
)
from protocol.ur_types import SIMULATED_MASTERBOARD, RobotType, SoftwareVersion


def stream_nothing(robot):
    with UrDriver("robot", network=robot) as driver:
        driver.stream(None, None, acceleration=1.0)


def test_session_says_who_answered():
    robot = FakeRobot()
    with UrDriver("robot", network=robot) as driver:
        assert driver.info.version == SoftwareVersion(3, 15, 8)
        assert driver.info.model == "UR3"
        assert (driver.info.serial, driver.info.simulated, driver.info.seed) == ("20993000007", True, 7)
        assert driver.info.period == 0.008
        assert driver.layout is LAYOUT
        assert driver.actual_q().tolist() == [0.0] * 6
    assert robot.programs == []
    assert set(robot.closed) == {"dashboard", "primary", "secondary", "realtime"}


def test_session_without_dashboard_server():
    with UrDriver("robot", network=FakeRobot(has_dashboard=False)) as driver:
        assert (driver.info.model, driver.info.serial) == ("UR3", "unknown")
        assert driver.info.simulated is None
        assert "NOT KNOWN whether real or simulated" in str(driver.info)


def test_configuration_data_report_the_arm_when_the_dashboard_does_not():
    robot = FakeRobot(has_dashboard=False)
    robot.state = encode_state([ConfigurationData(robot_type=RobotType.UR10)], SoftwareVersion(3, 4))
    with UrDriver("robot", network=robot) as driver:
        assert driver.info.model == "UR10"


V3_11 = SoftwareVersion(3, 11)
OURS = ConfigurationData(masterboard_version=SIMULATED_MASTERBOARD)
URSIM = KinematicsInfo()
CALIBRATED = KinematicsInfo(checksum=(0x1234ABCD,) * 6)


@pytest.mark.parametrize(
    ("serial", "setup", "simulated"),
    [
        ("20993000007", [ConfigurationData(), CALIBRATED], True),
        ("2017355123", [ConfigurationData(), CALIBRATED], False),
        ("2017355123", [ConfigurationData(), URSIM], None),
        ("2017355123", [OURS, CALIBRATED], True),
        ("2017355123", [], None),
        (None, [OURS, CALIBRATED], True),
        ("20993000007", [ConfigurationData(), URSIM], True),
        (None, [ConfigurationData(), URSIM], None),
        (None, [ConfigurationData(), CALIBRATED], None),
        (None, [], None),
    ],
)
def test_an_arm_is_real_only_if_that_is_known(serial, setup, simulated):
    robot = FakeRobot()
    robot.serial = serial
    robot.state = encode_state(setup, V3_11)
    with UrDriver("robot", network=robot) as driver:
        assert driver.info.simulated is simulated
        assert origin_of(simulated).name in str(driver.info)


def test_an_arm_that_was_built_later_is_unknown():
    robot = FakeRobot(has_dashboard=False)
    robot.state = encode_state([ConfigurationData(robot_type=99)], V3_11)
    with UrDriver("robot", network=robot) as driver:
        assert driver.info.model == "unknown"


def test_software_that_does_not_report_whether_a_program_runs_is_refused():
    robot = FakeRobot()
    robot.version = SoftwareVersion(3, 1)
    with pytest.raises(DriverError, match=r"3\.1\.0, CB3, must be 3\.2 or later, CB3 or e-Series"):
        UrDriver("robot", network=robot)
    assert set(robot.closed) == {"dashboard", "primary"}


@pytest.mark.parametrize(
    ("spoil", "error", "words"),
    [
        ({"safety_mode": 3}, RobotStoppedError, "unlock the protective stop"),
        ({"safety_mode": 5}, RobotStoppedError, "SAFEGUARD_STOP"),
        ({"safety_mode": 99}, RobotStoppedError, "99"),
        ({"robot_mode": 5}, RobotStoppedError, "IDLE, must be RUNNING"),
        ({"robot_mode": 3}, RobotStoppedError, "POWER_OFF"),
        ({"program": "other"}, DriverError, "program is PLAYING"),
    ],
)
def test_nothing_is_sent_to_a_robot_that_is_not_ready(spoil, error, words):
    robot = FakeRobot()
    for name, value in spoil.items():
        setattr(robot, name, value)
    with pytest.raises(error, match=words):
        stream_nothing(robot)
    assert robot.programs == []


def test_a_reduced_robot_may_move():
    robot = FakeRobot(lockstep=False)
    with UrDriver("robot", network=robot) as driver:
        robot.safety_mode = 2
        driver.check_ready()


def test_a_robot_whose_ports_name_two_arms_is_refused_before_a_program_is_sent():
    robot = FakeRobot(lockstep=False)
    robot.state = encode_state([ConfigurationData(robot_type=RobotType.UR5)], robot.version)
    with pytest.raises(DriverError, match=r"the robot's arm is UR3 \(dashboard\), UR5 \(port 30001\)"):
        stream_nothing(robot)
    assert robot.programs == []


def test_program_that_does_not_start_is_reported_and_replaced():
    robot = FakeRobot()
    robot.refuses = True
    with pytest.raises(DriverError, match="the robot did not start the program in time: see its log"):
        stream_nothing(robot)
    assert "stopj" in robot.programs[-1]


def test_a_program_that_came_in_local_control_is_reported_at_once():
    robot = FakeRobot()
    robot.refuses, robot.remote = True, "false"
    with pytest.raises(RobotStoppedError, match="the robot's control is local, must be remote; in local"):
        stream_nothing(robot)


def test_script_error_is_reported_with_its_line():
    robot = FakeRobot()
    robot.error_in = "velocity_receiver"
    with pytest.raises(
        RobotStoppedError, match=r"line 2, column 3: compile_error_name_not_found:foo: \(# Follows joint"
    ):
        stream_nothing(robot)


def test_program_that_cannot_dial_back():
    robot = FakeRobot(dials=False)
    with UrDriver("robot", network=robot) as driver, pytest.raises(DriverError, match="firewall"):
        driver.stream(None, None, acceleration=1.0)
    assert robot.programs[-1] == stop_script()
    assert robot.listener.closed


@pytest.mark.parametrize("hello", [b"GET ", b"\0\0\0\2", b"\0\0\0\1\0\0\0\1"])
def test_only_our_program_may_dial_back(hello):
    robot = FakeRobot(hello=hello)
    with (
        UrDriver("robot", network=robot) as driver,
        pytest.raises(DriverError, match="not our velocity receiver"),
    ):
        driver.stream(None, None, acceleration=1.0)
    assert robot.received[-1:] == [] or not any(robot.received[-1].qd)


def test_callers_from_elsewhere_are_turned_away():
    robot = FakeRobot()
    server = ReverseServer(robot, "10.0.0.1", "10.0.0.2", None)
    stranger = Pipe(robot, "stranger", peer="10.0.0.66")
    program = Pipe(robot, "reverse")
    program.incoming.append(robot.hello[:1])
    program.incoming.append(robot.hello[1:])
    robot.listener.callers.extend([stranger, program])
    assert server.accept_program(lambda: None) is program
    assert stranger.closed


def test_the_default_reverse_port_is_always_the_same():
    robot = FakeRobot()
    for given, expected in ((None, REVERSE_PORT), (4321, 4321), (0, 50123)):
        with UrDriver("robot", reverse_port=given, network=robot):
            assert robot.listener.port == expected
        assert robot.listener.closed
    # No port of a box, and none that Linux, Windows or macOS give to clients.
    assert REVERSE_PORT not in range(29999, 30021)
    assert 1024 <= REVERSE_PORT < 32768


@pytest.mark.parametrize("given", [None, 4321])
def test_a_taken_reverse_port_is_an_error_before_anything_moves(given):
    robot = FakeRobot()
    robot.taken_ports = (REVERSE_PORT, 4321)
    with pytest.raises(DriverError, match=f"cannot listen on 10.0.0.1:{given or REVERSE_PORT}"):
        UrDriver("robot", reverse_port=given, network=robot)
    assert not robot.programs
    assert all(pipe.closed for pipe in robot.pipes.values())


def test_on_this_machine_a_taken_default_port_gives_way_to_a_free_one_and_a_given_one_does_not():
    robot = FakeRobot()
    robot.taken_ports = (REVERSE_PORT, 4321)
    assert ReverseServer(robot, "127.0.0.1", "127.0.0.1", None).port == 50123
    with pytest.raises(DriverError, match="cannot listen"):
        ReverseServer(robot, "127.0.0.1", "127.0.0.1", 4321)


def test_a_call_of_an_earlier_program_is_not_taken_for_the_next():
    robot = FakeRobot()
    server = ReverseServer(robot, "10.0.0.1", "10.0.0.2", None)
    earlier, program = Pipe(robot, "reverse"), Pipe(robot, "reverse")
    robot.listener.callers.append(earlier)
    server.forget_callers()
    assert earlier.closed
    program.incoming.append(robot.hello)
    robot.listener.callers.append(program)
    assert server.accept_program(lambda: None) is program


def test_a_port_that_is_no_control_box():
    robot = FakeRobot()
    pipe = Pipe(robot, "primary")
    with pytest.raises(DriverError, match="is this a control box"):
        PackageStream(pipe, robot, "primary").wait_for_version()
    pipe.incoming.append(b"SSH-2.0-OpenSSH_9.2\r\n")
    with pytest.raises(DriverError, match="does not speak its protocol"):
        PackageStream(pipe, robot, "primary").wait_for_version()


def test_of_the_states_the_newest_sub_package_of_each_type_is_kept():
    robot = FakeRobot()
    pipe = Pipe(robot, "primary")
    stream = PackageStream(pipe, robot, "primary")
    version = SoftwareVersion(3, 15, 8)
    for records in ([RobotModeData(), ConfigurationData()], [RobotModeData(target_speed_fraction=0.5)]):
        pipe.incoming.append(encode_state(records, version))
    stream.poll()
    assert stream.newest(RobotModeData).target_speed_fraction == 0.5
    assert stream.newest(ConfigurationData) == ConfigurationData()
    assert stream.newest(CartesianInfo) is None
    pipe.incoming.append(b"\0\0\0\x0b\x10\0\0\0\x06\x04\0")
    stream.poll()
    with pytest.raises(DriverError, match="does not speak its protocol"):
        stream.newest(CartesianInfo)


def test_variables_are_those_of_the_program_that_runs():
    robot = FakeRobot()
    pipe = Pipe(robot, "primary")
    stream = PackageStream(pipe, robot, "primary")
    version = SoftwareVersion(3, 3)  # what is not told yet

    def tell(*packages):
        pipe.incoming.extend(packages)
        stream.poll()
        return {name: str(value) for name, value in stream.variables.items()}

    def names(start, *texts):
        return encode_program_state(GlobalVariablesSetup(start_index=start, names=texts), version)

    def values(start, *numbers):
        typed = tuple(TypedValue(ValueType.INT, number) for number in numbers)
        return encode_program_state(GlobalVariablesUpdate(start_index=start, values=typed), version)

    assert tell(names(0, "a", "b"), names(2, "c"), values(0, 1, 2)) == {"a": "1", "b": "2"}
    assert tell(values(1, 5, 6, 7)) == {"a": "1", "b": "5", "c": "6"}
    assert tell(b"\0\0\0\x06\x19\0", values(2, 8)) == {"a": "1", "b": "5", "c": "8"}  # one that nobody reads
    assert tell(names(0, "d"), names(2, "f"), values(0, 9, 10, 11)) == {"d": "9", "f": "11"}
    assert tell(names(999, "y", "z"), values(999, 1, 2), names(3, 5000 * "g")) == {
        "d": "9",
        "f": "11",
        "y": "1",
    }
    without_any = KeyMessage(title=KeyMessage.STARTED, text="p")
    assert tell(encode_message_package(without_any, version)) == {}


def test_messages_before_the_question_for_the_version_are_kept():
    robot = FakeRobot()
    with UrDriver("robot", network=robot) as driver:
        robot.report(TextMessage(text="hello"))
        messages = driver._robot.primary.poll()
    assert [m.text for m in messages if isinstance(m, TextMessage)] == ["hello"]


def test_dashboard_answers_only_what_it_knows():
    robot = FakeRobot()
    answers = ask_dashboard(robot, "robot", 29999, ("get robot model", "make coffee", "get serial number"))
    assert answers == {"get robot model": "UR3"}
    assert robot.closed == ["dashboard"]


def test_receiver_program_is_filled_in():
    text = receiver_script("192.168.0.5", 50123, acceleration=40.0, period=0.008)
    assert re.search(r'^  pc_address = "192.168.0.5"\s+# <- client$', text, re.MULTILINE)
    assert re.search(r"^  pc_port = 50123\s+# <- client$", text, re.MULTILINE)
    assert re.search(r"^  acceleration = 40.0\s+# <- client$", text, re.MULTILINE)
    assert re.search(r"^  missed_allowed = 2\s+# <- client$", text, re.MULTILINE)
    assert text.startswith("def velocity_receiver():\n")
    assert text.endswith("\nend\n")


def test_the_robot_is_as_patient_with_us_on_an_e_series():
    text = receiver_script("192.168.0.5", 50123, acceleration=40.0, period=0.002)
    assert re.search(r"^  missed_allowed = 8\s+# <- client$", text, re.MULTILINE)


def test_no_program_text_gets_in_through_the_address():
    with pytest.raises(DriverError, match="no address"):
        receiver_script('1.2.3.4"\n  powerdown()\n', 1, acceleration=1.0, period=0.008)


def test_template_and_client_must_fit():
    template = "def f():\n  a = 1  # <- client\n  b = 2\nend\n"
    assert fill_template(template, {"a": 1.5}) == "def f():\n  a = 1.5  # <- client\n  b = 2\nend\n"
    for values in ({}, {"a": 1, "b": 2}, {"b": 2}):
        with pytest.raises(DriverError, match="different versions"):
            fill_template(template, values)
