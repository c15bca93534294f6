"""What is drawn of a robot: where every part stands, and which parts are there."""

import re
from dataclasses import replace
from math import pi
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import viser
import viser.transforms as vtf

from pc_client.driver.report import RobotInfo
from pc_client.files import FILE_KINDS
from pc_client.kinematics.arms import ROBOTS
from pc_client.kinematics.model import dh_lengths, model_of_arm
from pc_client.kinematics.tool import surroundings
from protocol.pose import T_to_pose, pose_to_T
from protocol.primary.layout import KinematicsInfo
from protocol.ur_types import SoftwareVersion
from ur_emulator.machine.models.things import BodyShape, Contact
from ur_hil.cell import parse_cell
from ur_pendant.drawing import ArmDrawing, RobotDrawing, model_of

UR3 = (0.1519, -0.24365, -0.21325, 0.11235, 0.08535, 0.0819)
UR5E = (0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996)
LONG = (0.1625, -0.425, -0.4922, 0.1333, 0.0997, 0.0996)
Q = (0.3, -1.2, 1.4, -0.7, 0.9, -2.0)
HOSTILE = "<img onerror=alert(1)>/../x"
PATHS = re.compile(r"/robot0(/(\d+|arm|target|lid|flange|tcp|trace|force|contacts))*")


def info(model="UR5e", major=5):
    return RobotInfo(SoftwareVersion(major, 3), model, "1", True, 0, False)


def kinematics(d1, a2, a3, d4, d5, d6):
    zero = (0.0,) * 6
    return KinematicsInfo(
        dh_theta=zero,
        dh_a=(0.0, a2, a3, 0.0, 0.0, 0.0),
        dh_d=(d1, 0.0, 0.0, d4, d5, d6),
        dh_alpha=(pi / 2, 0.0, 0.0, pi / 2, -pi / 2, 0.0),
        calibration_status=0,
    )


def dh_frames(table, q):
    """Frames 0 to 6 of a DH table: the axis of joint k is z of frame k - 1."""
    frames = [np.eye(4)]
    for turn, a, d, alpha in zip(
        np.add(q, table.dh_theta), table.dh_a, table.dh_d, table.dh_alpha, strict=True
    ):
        c, s, ca, sa = np.cos(turn), np.sin(turn), np.cos(alpha), np.sin(alpha)
        rows = [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]]
        frames.append(frames[-1] @ np.array(rows))
    return frames


@pytest.fixture
def server():
    server = viser.ViserServer("127.0.0.1", 0, verbose=False)
    yield server
    server.stop()


def nodes(server) -> dict[str, Any]:
    return server.scene._handle_from_node_name


def labels(server) -> dict[str, str]:
    """Paths of what has a label, by its text."""
    found = {path: node for path, node in nodes(server).items() if isinstance(node, viser.LabelHandle)}
    return {node.text: path.rsplit("/", 1)[0] for path, node in found.items()}


def place(server, path):
    """T_world_node (4, 4), of the nodes above it as a page composes them."""
    T, parts = np.eye(4), path.split("/")
    for k in range(2, len(parts) + 1):
        node = nodes(server)["/".join(parts[:k])]
        T = T @ vtf.SE3.from_rotation_and_translation(vtf.SO3(node.wxyz), node.position).as_matrix()
    return T


@pytest.mark.parametrize(("name", "lengths"), [("UR3", UR3), ("UR5e", UR5E), ("UR5e", LONG), ("X", UR3)])
def test_links_stand_where_the_dh_table_puts_them(server, name, lengths):
    table = kinematics(*lengths)
    arm = ArmDrawing(server.scene, "/arm", model_of(info(name), table), (1, 2, 3))
    for q in (np.zeros(6), Q, np.negative(Q)):
        arm.show(q)
        frames = dh_frames(table, q)
        np.testing.assert_allclose(place(server, arm.flange), frames[6], atol=1e-4)  # of CB3 URDFs, rounded
        np.testing.assert_allclose(arm.T_base_flange, place(server, arm.flange), atol=1e-9)
        for k in range(1, 7):
            axis, step = frames[k - 1][:3, 2], place(server, arm.links[k].name)[:3, 3] - frames[k - 1][:3, 3]
            assert np.linalg.norm(np.cross(axis, step)) < 1e-4, f"link {k} is off the axis of its joint"
    offset = (0.01, 0.02, 0.1, 0.3, 0.0, -0.2)
    np.testing.assert_allclose(arm.T_base_tcp(offset), arm.T_base_flange @ pose_to_T(offset), atol=1e-12)


def test_an_arm_is_the_one_of_its_name_unless_it_reports_other_lengths():
    for name in ROBOTS:
        nominal = model_of_arm(ROBOTS[name])
        assert model_of(info(nominal.title), None).description is ROBOTS[name]
        d1, a2, a3, d4, d5, d6 = dh_lengths(nominal)
        # As a calibration reports it: axes 2 to 4 are parallel, only the sum along them is seen.
        table = replace(
            kinematics(d1, a2 - 1e-3, a3, d4, d5, d6), dh_d=(d1, -310.0, 9.0, d4 + 301.001, d5, d6)
        )
        assert model_of(info(nominal.title), table).description is ROBOTS[name]
    longer, unknown = (
        model_of(info(name), kinematics(*LONG)).description.geometry for name in ("UR5e", "UR99")
    )
    assert longer.a3 == unknown.a3 == LONG[2]
    assert longer.radii == ROBOTS["ur5e"].geometry.radii  # the joints are those of a UR5e
    assert unknown.radii != longer.radii
    for lengths in ((0.0,) * 6, (float("nan"),) * 6, (1e9,) * 6):
        assert model_of(info("UR16e"), kinematics(*lengths)).description is ROBOTS["ur16e"]


class FakeRobot(SimpleNamespace):
    def __init__(self, **given):
        super().__init__(
            **{"values": {}, "info": None, "kinematics": None, "state": None, "problem": ""} | given
        )

    def report(self, q=Q, **values):
        self.values = {"actual_q": tuple(q), "target_q": tuple(q)} | values


def state(shapes=(), contacts=(), things=(), tcp_pose=(0.0,) * 6):
    return SimpleNamespace(
        shapes=tuple(shapes), contacts=tuple(contacts), things=tuple(things), tcp_pose=tcp_pose
    )


def drawing(server, robot, *args) -> RobotDrawing:
    return RobotDrawing(server, "/robot0", robot, *args)


def test_nothing_is_drawn_before_a_robot_says_who_and_where_it_is(server):
    robot = FakeRobot()
    drawn = drawing(server, robot)
    drawn.update()
    robot.info = info()
    drawn.update()
    robot.report(q=(float("nan"),) * 6)
    drawn.update()
    assert drawn.arm is None
    robot.report(tcp_offset=(0.0, 0.0, 0.2, 0.0, 0.0, 0.0))
    drawn.update()
    assert (drawn.arm.model.name, len(drawn.arm.links)) == ("ur5e", 7)
    np.testing.assert_allclose(
        drawn.T_base_tcp, dh_frames(kinematics(*UR5E), Q)[6] @ pose_to_T((0, 0, 0.2, 0, 0, 0)), atol=1e-6
    )
    np.testing.assert_allclose(place(server, f"{drawn.arm.flange}/tcp"), drawn.T_base_tcp, atol=1e-6)


def test_noise_of_encoders_moves_nothing(server, monkeypatch):
    robot = FakeRobot(info=info())
    robot.report()
    drawn, sent = drawing(server, robot), []
    for _ in range(4):
        drawn.update()
    monkeypatch.setattr(
        type(server.scene), "_queue_scene_message", lambda self, message: sent.append(message)
    )
    robot.report(q=np.add(Q, 3e-5))
    for _ in range(4):
        drawn.update()
    assert not sent
    robot.report(q=np.add(Q, (0.01, 0, 0, 0, 0, 0)))
    drawn.update()
    assert {message.name for message in sent} == {drawn.arm.links[1].name}


def test_shapes_come_move_and_go_and_names_are_only_text(server):
    carried = BodyShape("tool_0", True, "capsule", (0.04, 0.03), (0.0, 0.0, 0.05, 0.0, 0.0, 0.0))
    things = [
        BodyShape("table", False, "plane", (), (0.0, 0.0, -0.02, 0.0, 0.0, 0.0)),
        BodyShape("scene", False, "box", (0.2, 0.2, 0.1), (0.5, 0.0, 0.05, 0.0, 0.0, 0.3)),
        BodyShape("scene", False, "box", (0.2, 0.2, 0.1), (0.9, 0.0, 0.05, 0.0, 0.0, 0.3)),
        BodyShape(HOSTILE, False, "cylinder", (0.03, 0.1), (0.4, 0.3, 0.05, 0.0, 0.0, 0.0)),
        BodyShape("ball", False, "sphere", (0.05,), (0.4, -0.3, 0.05, 0.0, 0.0, 0.0)),
        BodyShape("left", False, "safety plane", (), (0.0, 0.5, 0.0, 1.0, 0.0, 0.0)),
    ]
    robot = FakeRobot(info=info(), state=state([carried, *things]))
    robot.report()
    drawn = drawing(server, robot, (1.0, 2.0, 0.0))
    drawn.update()
    assert all(PATHS.fullmatch(path) for path in nodes(server) if path.startswith("/robot0"))
    texts = labels(server)
    assert set(texts) == {HOSTILE, "ball", "left"}
    np.testing.assert_allclose(place(server, texts["ball"])[:3, 3], (1.4, 1.7, 0.05), atol=1e-9)

    (hanging,) = (path for path in nodes(server) if re.fullmatch(rf"{drawn.arm.flange}/\d+", path))
    robot.report(q=np.negative(Q))
    drawn.update()
    base = pose_to_T((1.0, 2.0, 0.0, 0.0, 0.0, 0.0))
    np.testing.assert_allclose(place(server, hanging), base @ drawn.arm.T_base_tcp(carried.pose), atol=1e-6)

    before, moved = (
        nodes(server)[texts["ball"]],
        BodyShape("ball", False, "sphere", (0.05,), (0.0, 0.7, 0.1, 0.0, 0.5, 0.0)),
    )
    robot.state = state([*things[:2], moved])
    drawn.update()
    assert nodes(server)[texts["ball"]] is before
    np.testing.assert_allclose(place(server, texts["ball"]), base @ pose_to_T(moved.pose), atol=1e-6)
    assert not {hanging, texts[HOSTILE]} & set(nodes(server))
    assert len([path for path in nodes(server) if re.fullmatch(r"/robot0/\d+", path)]) == 3


def test_what_is_gripped_goes_with_the_flange_until_the_next_state(server):
    robot = FakeRobot(info=info())
    robot.report(tcp_offset=(0.0, 0.0, 0.2, 0.0, 0.0, 0.0))
    drawn = drawing(server, robot)
    drawn.update()
    tcp, base = T_to_pose(drawn.T_base_tcp), (0.4, 0.1, 0.2, 0.3, 0.4, 0.5)
    block, other = (BodyShape(name, False, "sphere", (0.03,), base) for name in ("block", "other"))
    for touches in (True, False):
        things = [
            SimpleNamespace(name="block", touches_tool=touches),
            SimpleNamespace(name="other", touches_tool=False),
        ]
        robot.report(tcp_offset=(0.0, 0.0, 0.2, 0.0, 0.0, 0.0))
        drawn.update()
        robot.state = state([block, other], (), things, tcp)
        drawn.update()
        before = drawn.T_base_tcp
        robot.report(q=np.add(Q, 0.1), tcp_offset=(0.0, 0.0, 0.2, 0.0, 0.0, 0.0))
        drawn.update()
        moved = drawn.T_base_tcp @ np.linalg.inv(before) @ pose_to_T(base)
        texts = labels(server)
        np.testing.assert_allclose(
            place(server, texts["block"]), moved if touches else pose_to_T(base), atol=1e-4
        )
        np.testing.assert_allclose(place(server, texts["other"]), pose_to_T(base), atol=1e-6)


def test_a_cell_is_drawn_where_no_box_says_what_is_there(server):
    text = """
format = 1
name = "cell"
[floor]
z = -0.1
[[walls]]
name = "window"
point = [0.0, 0.6, 0.0]
normal = [0.0, -1.0, -1.0]
[[boxes]]
name = "press"
centre = [0.5, 0.0, 0.1]
size = [0.1, 0.2, 0.3]
rpy = [0.0, 0.0, 0.5]
"""
    cell = surroundings(parse_cell(text, "cell.toml", FILE_KINDS["cell"]), "robotiq-2f85")
    robot = FakeRobot(info=info())
    robot.report()
    drawn = drawing(server, robot, (0.0, 0.0, 0.0), cell)
    drawn.update()
    texts = labels(server)
    assert set(texts) == {"window", "press"}
    T = place(server, texts["window"])
    np.testing.assert_allclose(T[:3, 2], (0.0, -(0.5**0.5), -(0.5**0.5)), atol=1e-9)
    assert T[:3, 2] @ (T[:3, 3] - (0.0, 0.6, 0.0)) == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(
        place(server, texts["press"]), pose_to_T((0.5, 0.0, 0.1, 0.0, 0.0, 0.5)), atol=1e-9
    )
    assert any(re.fullmatch(rf"{drawn.arm.flange}/\d+", path) for path in nodes(server))
    np.testing.assert_allclose(
        drawn.T_base_tcp, drawn.arm.T_base_tcp((0.0, 0.0, cell.tool.length, 0.0, 0.0, 0.0))
    )
    robot.state = state()
    drawn.update()  # a box that knows better
    assert not [path for path in nodes(server) if re.fullmatch(r"/robot0/\d+", path)]


def test_the_target_is_seen_when_it_is_elsewhere(server):
    robot = FakeRobot(info=info())
    robot.report(target_q=np.add(Q, 0.02).tolist())
    drawn = drawing(server, robot)
    drawn.update()
    assert "/robot0/target/0" not in nodes(server)
    elsewhere = np.add(Q, 0.2)
    robot.report(target_q=tuple(elsewhere))
    drawn.update()
    target = nodes(server)["/robot0/target/0"]
    flange = drawn.arm.flange.replace("/arm/", "/target/")
    assert (target.visible, target.opacity) == (True, 0.35)
    np.testing.assert_allclose(place(server, flange), dh_frames(kinematics(*UR5E), elsewhere)[6], atol=1e-6)
    robot.report()
    drawn.update()
    assert not target.visible


def test_forces_are_arrows_from_where_they_act(server):
    robot = FakeRobot(info=info())
    robot.report(actual_TCP_force=(3.0, -2.0, 1.0, 9.0, 9.0, 9.0))
    drawn = drawing(server, robot)
    drawn.update()
    force, contacts = nodes(server)["/robot0/force"], nodes(server)["/robot0/contacts"]
    assert (force.visible, contacts.visible) == (False, False)
    robot.report(actual_TCP_force=(0.0, 20.0, 0.0, 0.0, 0.0, 0.0))
    press = Contact("forearm", "wall", (0.5, 0.0, 0.3), (1e5, 0.0, 0.0))
    resting = Contact("can", "table", (0.1, 0.1, 0.0), (0.0, 0.0, -0.5))
    robot.state = state(contacts=[press, resting, press])
    drawn.update()
    tcp = drawn.T_base_tcp[:3, 3]
    assert (force.visible, contacts.visible) == (True, True)
    np.testing.assert_allclose(force.points, [[tcp, np.add(tcp, (0.0, 0.1, 0.0))]], atol=1e-6)
    np.testing.assert_allclose(contacts.points, [[(0.5, 0.0, 0.3), (1.0, 0.0, 0.3)]] * 2, atol=1e-6)
    robot.report()
    robot.state = state()
    drawn.update()
    assert (force.visible, contacts.visible) == (False, False)


def test_the_path_of_the_tcp_grows_and_fades(server):
    robot = FakeRobot(info=info())
    drawn, tcps = drawing(server, robot), []
    for k in range(31):
        robot.report(q=np.add(Q, 0.02 * min(k, 20)))
        drawn.update()
        tcps.append(drawn.T_base_tcp[:3, 3])
    trace = nodes(server)["/robot0/trace"]
    assert trace.visible
    np.testing.assert_allclose(trace.points[:, 0], tcps[:20], atol=1e-6)
    np.testing.assert_allclose(trace.points[:, 1], tcps[1:21], atol=1e-6)
    for _ in range(303):
        drawn.update()
    assert not trace.visible


def test_a_lost_robot_is_grey_and_another_one_is_drawn_anew(server):
    robot = FakeRobot(info=info())
    robot.report()
    drawn = drawing(server, robot)
    drawn.update()
    arm, colour = drawn.arm, drawn.arm.links[3].color
    robot.problem = "connection lost"
    drawn.update()
    assert (drawn.arm.links[3].color != colour, drawn.arm.links[3].opacity) == (True, 0.35)
    robot.problem, robot.info = "", info()  # the same kind of arm answers again
    drawn.update()
    assert (drawn.arm, drawn.arm.links[3].color, drawn.arm.links[3].opacity) == (arm, colour, None)
    robot.info, robot.kinematics = info("UR3", 3), kinematics(*UR3)
    robot.report(target_q=np.add(Q, 0.3).tolist())
    drawn.update()
    assert drawn.arm is not arm
    assert drawn.arm.model.name == "ur3"
    assert not [path for path in nodes(server) if path.endswith("/lid")]  # published meshes have none
    np.testing.assert_allclose(place(server, drawn.arm.flange), dh_frames(kinematics(*UR3), Q)[6], atol=1e-4)
