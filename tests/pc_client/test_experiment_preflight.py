"""The robot against the model before anything moves: each condition, reported and not reported, and what the commands say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fake_robot import FakeRobot, package
from hypothesis import given
from hypothesis import strategies as st

from pc_client.driver.questions import RtdeAnswer, ask_rtde
from pc_client.driver.report import read_report
from pc_client.driver.session import UrDriver
from pc_client.driver.watchdog import conditions_text, refusal, require
from pc_client.errors import DriverError
from pc_client.experiment.preflight import model_of, preflight
from pc_client.kinematics.model import robot_model
from protocol.primary.layout import ConfigurationData, KinematicsInfo
from protocol.primary.messages import encode_message, version_message
from protocol.primary.packages import encode_state
from protocol.ur_types import Ports, RobotType, SoftwareVersion
from ur_hil.cell import NO_CELL

POSTURE = [0.4, -1.77, -2.1, -0.1, 1.3, 1.86]
UR3 = robot_model("ur3")


def robot(*, model="UR3", **spoilt):
    fake = FakeRobot(model=model)
    fake.q = list(POSTURE)
    for name, value in spoilt.items():
        assert hasattr(fake, name)
        setattr(fake, name, value)
    return fake


def report(fake):
    return read_report(fake, "robot", Ports.standard())


def failing(fake, model=UR3):
    return [c.name for c in preflight(report(fake), model) if c.holds is False]


def test_a_robot_as_it_must_be_passes_every_condition():
    conditions = preflight(report(robot()), UR3)
    assert len(conditions) == 13
    assert all(condition.holds for condition in conditions)
    assert refusal(conditions) == ""
    require(conditions)


def test_a_session_reports_what_a_fresh_connection_does():
    fake = robot(payload=0.02, slider=0.5)
    with UrDriver("robot", network=fake) as driver:
        said = driver.report()
    fresh = report(fake)
    assert said.frame.values.tolist() == fresh.frame.values.tolist()
    for name in ("info", "configured", "mode", "tcp_offset", "payload"):
        assert getattr(said, name) == getattr(fresh, name)


def test_asking_sends_no_program():
    fake = robot()
    report(fake)
    assert fake.programs == []
    assert set(fake.closed) == set(fake.pipes)


@pytest.mark.parametrize(
    ("spoilt", "name", "line"),
    [
        ({"safety_mode": 3}, "safety mode", "PROTECTIVE_STOP, must be NORMAL or REDUCED; find the cause"),
        ({"safety_mode": 99}, "safety mode", "99 (unknown), must be NORMAL or REDUCED; look at the pendant"),
        ({"robot_mode": 5}, "mode", "the robot's mode is IDLE, must be RUNNING; power it on and release"),
        ({"program": "other"}, "program", "the robot's program is PLAYING, must be STOPPED; stop it"),
        ({"slider": 0.3}, "speed slider", "30 %, must be 100 %; set it to 100 % on the pendant"),
        ({"slider": 0.5}, "speed slider", "50 %, must be 100 %; set it to 100 % on the pendant"),
        ({"slider": 0.95}, "speed slider", "95 %, must be 100 %; set it to 100 % on the pendant"),
        ({"slider": float("nan")}, "speed slider", "nan %, must be 100 %"),
        ({"scaling": 0.5}, "speed scaling", "50 %, must be 100 %; end reduced mode"),
        (
            {"tcp_offset": (0.0, 0.0, 0.15, 0.0, 0.0, 0.0)},
            "TCP offset",
            "(0.0, 0.0, 150.0) mm, (0, 0, 0) mrad, must be 0 (the flange); set the TCP of the installation",
        ),
        ({"tcp_offset": (0.0,) * 5 + (0.01,)}, "TCP offset", "(0, 0, 10) mrad"),
        ({"payload": 0.6}, "payload", "0.60 kg, must be 0.00 kg within 0.05 kg; set the payload"),
        ({"q": [6.5, *POSTURE[1:]]}, "joint angles", "base at 372.4 deg, must be within -360 to 360 deg"),
    ],
)
def test_what_is_not_as_it_must_be_is_one_line_that_says_so_and_what_to_do(spoilt, name, line):
    fake = robot(**spoilt)
    assert failing(fake) == [name]
    with pytest.raises(DriverError) as refused:
        require(preflight(report(fake), UR3))
    assert f"the robot's {name} is " in str(refused.value)
    assert line in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("version", "words"),
    [
        ((3, 1, 0), "3.1.0, CB3"),
        ((10, 7, 0), "10.7.0, PolyScope X"),
    ],
)
def test_software_of_another_generation_is_refused_by_name_and_nothing_else_is_judged(version, words):
    fake = robot(slider=0.5)
    fake.state = fake.robot_state()
    fake.version = SoftwareVersion(*version)
    (condition,) = preflight(report(fake), UR3)
    assert condition.complaint == (
        f"the robot's software is {words}, must be 3.2 or later, CB3 or e-Series; "
        "this client was made for CB3 and e-Series controllers only"
    )


@pytest.mark.parametrize(("major", "words"), [(1, "1.15.0, CB2"), (10, "10.15.0, PolyScope X")])
def test_no_session_is_opened_with_another_generation(major, words):
    fake = robot()
    greeting = encode_message(replace(version_message(SoftwareVersion(3, 15, 0)), major=major), fake.version)
    fake.greeting = package(greeting)
    with pytest.raises(DriverError, match=words):
        UrDriver("robot", network=fake)
    assert set(fake.closed) == set(fake.pipes)


E_SERIES = SoftwareVersion(5, 12)


def e_series_rows(**reported):
    fake = robot(version=E_SERIES, **reported)
    return {c.name: c for c in preflight(report(fake), UR3) if c.name in ("control", "operational mode")}


@pytest.mark.parametrize(
    ("reported", "name", "line"),
    [
        (
            {"remote": "false", "operational": "AUTOMATIC"},
            "control",
            "the robot's control is local, must be remote; in local control it ignores programs from the network: "
            "enable remote control in its settings, and switch to it on the pendant",
        ),
        (
            {"remote": "true", "operational": "MANUAL"},
            "operational mode",
            "the robot's operational mode is MANUAL, must be AUTOMATIC or NONE; in manual mode programs are slow "
            "and need the enabling device: switch to automatic mode on the pendant, or with the selector",
        ),
    ],
)
def test_local_control_and_manual_mode_of_an_e_series_robot_are_refused(reported, name, line):
    rows = e_series_rows(**reported)
    assert rows[name].complaint == line
    assert [row.name for row in rows.values() if not row.holds] == [name]


def test_an_e_series_robot_in_remote_control_without_modes_passes():
    assert all(row.holds for row in e_series_rows(remote="true", operational="NONE").values())


def test_the_makers_simulator_may_stay_in_local_control():
    fake = robot(version=E_SERIES, remote="false", operational="NONE", serial="20175599999")
    fake.state = encode_state([ConfigurationData(), KinematicsInfo()], E_SERIES)
    (row,) = (c for c in preflight(report(fake), UR3) if c.name == "control")
    assert (row.reported, row.needed, row.holds) == ("local", "remote or local (simulator)", True)


def test_software_before_5_6_does_not_report_control_and_mode():
    question = "could not understand: 'is in remote control'"
    rows = e_series_rows(remote=question, operational=question)
    assert [row.verdict for row in rows.values()] == ["not reported"] * 2


def test_an_arm_that_dashboard_and_configuration_data_name_differently_is_refused():
    fake = robot()
    fake.state = encode_state([ConfigurationData(robot_type=RobotType.UR5)], fake.version)
    (arm,) = (c for c in preflight(report(fake), UR3) if c.holds is False)
    assert arm.complaint.startswith("the robot's arm is UR3 (dashboard), UR5 (port 30001), must be UR3;")


def test_an_arm_without_a_model_is_refused():
    fake = robot(model="UR16")
    assert model_of(report(fake), NO_CELL) is None
    assert failing(fake, None) == ["arm"]


@pytest.mark.parametrize("other", ["ur5", "ur10"])
def test_an_arm_that_stands_elsewhere_than_its_model_is_refused(other):
    assert failing(robot(arm=robot_model(other))) == ["flange pose"]


def test_an_arm_as_the_e_series_has_it_is_refused_by_its_flange_pose():
    e_series = robot_model("ur3")
    placement = e_series.pin_model.copy()
    placement.jointPlacements[4].translation += np.array([0.0, 0.01870, 0.0])  # d4 of a UR3e: 131.05 mm
    moved = replace(e_series, pin_model=placement, pin_data=placement.createData())
    (condition,) = (c for c in preflight(report(robot(arm=moved)), UR3) if c.holds is False)
    assert condition.reported.startswith("18.7 mm")


offsets = st.tuples(*[st.floats(-0.3, 0.3)] * 3, *[st.floats(-1.5, 1.5)] * 3)


@given(offset=offsets, q=st.lists(st.floats(-6.0, 6.0), min_size=6, max_size=6))
def test_the_flange_pose_is_judged_without_the_tcp_offset(offset, q):
    fake = robot(tcp_offset=offset, q=q)
    flange = next(c for c in preflight(report(fake), UR3) if c.name == "flange pose")
    assert flange.holds
    assert flange.reported.startswith("0.0 mm, 0.0 mrad")


def test_what_a_robot_does_not_report_is_neither_passed_nor_refused():
    fake = robot(payload=None)
    fake.state = encode_state([ConfigurationData(robot_type=RobotType.UR3)], fake.version)
    conditions = preflight(report(fake), UR3)
    unreported = {condition.name for condition in conditions if condition.holds is None}
    assert unreported == {"control mode", "speed slider", "TCP offset", "payload", "RTDE"}
    assert refusal(conditions) == ""
    assert conditions_text(conditions).count("not reported") == 5


def test_an_arm_that_is_not_reported_cannot_be_compared():
    fake = robot(has_dashboard=False)
    fake.state = encode_state([ConfigurationData(robot_type=99)], fake.version)
    conditions = {condition.name: condition.verdict for condition in preflight(report(fake), None)}
    assert [conditions[name] for name in ("arm", "flange pose", "joint angles")] == ["not reported"] * 3


def test_speed_scaling_of_0_without_a_program_is_no_speed():
    assert failing(robot(scaling=0.0)) == []
    assert failing(robot(scaling=0.0, program="other")) == ["program", "speed scaling"]


@pytest.mark.parametrize(
    ("version", "told"), [((3, 10, 0), None), ((3, 11, 0), 1.5)], ids=["before 3.11", "since 3.11"]
)
def test_the_payload_is_asked_for_by_rtde(version, told):
    fake = robot(payload=1.5, version=SoftwareVersion(*version))
    answer = ask_rtde(fake, "robot", Ports.standard().rtde, ("timestamp", "payload"))
    assert answer.version == fake.version
    assert answer.values.get("payload") == told
    assert "timestamp" in answer.values


def test_an_rtde_port_that_sends_nothing_or_nonsense_reports_nothing():
    fake = robot()
    answers = fake.took
    for nonsense in (b"", b"SSH-2.0-OpenSSH_9.2\r\n"):
        fake.took = lambda pipe, data, say=nonsense: say and pipe.incoming.append(say)
        assert ask_rtde(fake, "robot", Ports.standard().rtde, ("payload",)) is None
        assert next(c for c in preflight(report(fake), UR3) if c.name == "RTDE").holds is None
    fake.took = answers
    assert ask_rtde(fake, "robot", Ports.standard().rtde, ("payload",)).values == {"payload": 0.0}


@pytest.mark.parametrize(
    ("other", "words"),
    [
        ({"actual_q": (0.4,) * 6}, "mrad from port 30003"),
        ({"actual_TCP_pose": (0.0,) * 6}, " 0 mrad from port 30003"),
        ({"actual_TCP_pose": 1.0}, "nan mm"),
        ({"version": SoftwareVersion(3, 14, 0)}, "3.14.0"),
    ],
    ids=["posture", "arm", "no pose", "software"],
)
def test_rtde_of_another_controller_is_refused(other, words):
    told = report(robot())
    version = other.pop("version", told.rtde.version)
    told = replace(told, rtde=RtdeAnswer(version, told.rtde.values | other))
    line = refusal(preflight(told, UR3))
    assert line.startswith("the robot's RTDE is")
    assert words in line
