"""A gripper of the table on the arm: its TCP in kinematics and checks, its payload, its shape, its record."""

from types import SimpleNamespace

import numpy as np
import pytest
from fake_robot import FakeRobot

from pc_client.arm import connect
from pc_client.driver.report import read_report
from pc_client.driver.watchdog import refusal
from pc_client.errors import CellError, DriverError
from pc_client.experiment.preflight import preflight
from pc_client.files import FILE_KINDS
from pc_client.kinematics.clearance import clearance_model
from pc_client.kinematics.model import (
    check_flange,
    nearest_posture,
    robot_model,
    tcp_jacobian,
    tcp_pose,
)
from pc_client.kinematics.tool import surroundings
from pc_client.planning.limits import limits_of
from protocol.pose import T_to_pose
from protocol.ur_types import Ports
from ur_hil.cell import Cell, Solid, Tool, Wall, parse_cell
from ur_hil.tools import TOOLS

HAND = TOOLS["robotiq-2f85"]
POSTURE = np.array([0.4, -1.77, -2.1, -0.1, 1.3, 1.86])
BARE = robot_model("ur3")
MODEL = robot_model("ur3", surroundings(None, "robotiq-2f85"))


def test_the_tcp_lies_before_the_flange_in_all_kinematics():
    flange, tcp = tcp_pose(BARE, POSTURE), tcp_pose(MODEL, POSTURE)
    np.testing.assert_allclose(tcp[:3, :3], flange[:3, :3], atol=1e-12)
    np.testing.assert_allclose(tcp[:3, 3], flange[:3, 3] + HAND.length * flange[:3, 2], atol=1e-12)
    step = 1e-6
    moved = [tcp_pose(MODEL, POSTURE + step * axis)[:3, 3] - tcp[:3, 3] for axis in np.eye(6)]
    np.testing.assert_allclose(tcp_jacobian(MODEL, POSTURE)[:3], np.transpose(moved) / step, atol=1e-5)
    np.testing.assert_allclose(nearest_posture(MODEL, tcp, POSTURE + 0.1), POSTURE, atol=1e-6)
    assert MODEL.reach == BARE.reach + HAND.length
    assert limits_of(MODEL).approach_speed * MODEL.reach == pytest.approx(0.25)


def test_a_robot_with_another_tcp_is_refused_while_it_moves():
    q = POSTURE.tolist()
    check_flange(MODEL, q, T_to_pose(tcp_pose(MODEL, POSTURE)))
    with pytest.raises(DriverError, match=r"its flange 150.0 mm"):
        check_flange(MODEL, q, T_to_pose(tcp_pose(BARE, POSTURE)))


def refused(**values):
    fake = FakeRobot()
    fake.q = POSTURE.tolist()
    for name, value in {"payload": HAND.mass, "payload_cog": HAND.cog, **values}.items():
        setattr(fake, name, value)
    return refusal(preflight(read_report(fake, "robot", Ports.standard()), MODEL))


def test_a_robot_has_the_tcp_and_the_payload_of_the_tool():
    tcp = (0.0, 0.0, HAND.length, 0.0, 0.0, 0.0)
    assert refused(tcp_offset=tcp) == ""
    assert refused(tcp_offset=(0.0,) * 6) == (
        "the robot's TCP offset is (0.0, 0.0, 0.0) mm, (0, 0, 0) mrad, must be (0.0, 0.0, 150.0) mm, (0, 0, 0) "
        "mrad; set it in the installation, or by set_tcp(p[0.0, 0.0, 0.15, 0.0, 0.0, 0.0])"
    )
    for wrong in ({"payload": 0.0}, {"payload_cog": (0.0, 0.0, 0.0)}):
        said = refused(tcp_offset=tcp, **wrong)
        assert "must be 0.90 kg at (0.0, 0.0, 58.0) mm within 0.05 kg, 20 mm" in said
        assert "set_payload(0.9, [0.0, 0.0, 0.058])" in said
    assert refused(tcp_offset=tcp, payload=None) == ""  # nobody reports it


def test_its_shape_must_touch_nothing():
    tip = tcp_pose(MODEL, POSTURE)[2, 3]
    clearance = clearance_model(MODEL).along(POSTURE)
    assert clearance.floor.nearest[0].first == "tool cylinder 'Robotiq 2F-85'"
    assert clearance.floor.least[0] < tip
    assert clearance.own.least[0] > 0.01


def test_the_text_of_a_cell_has_the_tool():
    wall = Wall("window", (0.0, -1.0, 0.0), -0.6)
    text = 'format = 1\nname = "bench"\n[[walls]]\nname = "window"\ny_max = 0.6'
    for cell in (surroundings(parse_cell(text, "f", FILE_KINDS["cell"]), HAND.name), MODEL.cell):
        assert parse_cell(cell.text, "f", FILE_KINDS["cell"]) == cell
        assert cell.summary.endswith("tool of 0.9 kg, cylinder 'Robotiq 2F-85', TCP 150 mm beyond the flange")
    made = surroundings(Cell("bench", walls=(wall,)), HAND.name)
    assert (made.walls, made.tool, made.text) == ((wall,), MODEL.cell.tool, "")


@pytest.mark.parametrize("name", ["vacuum", "none", "robotiq-2f85,robotiq-hande"])
def test_other_tools_are_refused(name):
    with pytest.raises(CellError, match="the client moves an arm with one of robotiq-2f85, "):
        surroundings(None, name)


def test_two_tools_are_refused_before_a_robot_is_asked():
    pen = Tool((Solid("pen", "capsule", (0.01, 0.1), (0.0, 0.0, 0.06)),), 0.1)
    with pytest.raises(CellError, match="cell 'bench' has a tool, and robotiq-2f85 is given"):
        connect("robot.invalid", cell=Cell("bench", tool=pen), tool="robotiq-2f85")
    with pytest.raises(CellError, match="unknown tool 'hand'"):
        connect("robot.invalid", tool="hand")


def test_the_floor_of_the_noise_is_that_of_the_tcp():
    from pc_client.analysis.noise_floor import _nominal

    def run(text):
        whose = SimpleNamespace(robot_model="UR3", cell_text=text)
        return SimpleNamespace(recording=SimpleNamespace(provenance=whose))

    lengths = [_nominal(run(text)).cell.tool.length for text in ("", MODEL.cell.text, "no TOML")]
    assert lengths == [0.0, HAND.length, 0.0]
