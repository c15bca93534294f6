"""What is drawn of a robot: where every part stands, and which parts are there."""

import re
from dataclasses import replace
from math import pi
from types import SimpleNamespace

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
from ur_hil.cell import NO_CELL, parse_cell
from ur_pendant.drawing import ArmDrawing, RobotDrawing, model_of

UR3 = (0.1519, -0.24365, -0.21325, 0.11235, 0.08535, 0.0819)
UR5E = (0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996)
LONG = (0.1625, -0.425, -0.4922, 0.1333, 0.0997, 0.0996)
Q = (0.3, -1.2, 1.4, -0.7, 0.9, -2.0)
TCP = (0.0, 0.0, 0.2, 0.0, 0.0, 0.0)
HOSTILE = "<img onerror=alert(1)>/../x"
PATHS = re.compile(r"/robot0(/(\d+|arm|target|lid|flange|tcp|trace|force|contacts))*")
SHAPE = re.compile(r"/robot0/\d+")


def info(model="UR5e", major=5):
    return RobotInfo(SoftwareVersion(major, 3), model, "1", True, 0, False)


def kinematics(d1, a2, a3, d4, d5, d6):
    return KinematicsInfo(
        dh_theta=(0.0,) * 6,
        dh_a=(0.0, a2, a3, 0.0, 0.0, 0.0),
        dh_d=(d1, 0.0, 0.0, d4, d5, d6),
        dh_alpha=(pi / 2, 0.0, 0.0, pi / 2, -pi / 2, 0.0),
        calibration_status=0,
    )


def dh_frames(table, q):
    """Frames 0 to 6 of a DH table: the axis of joint k is z of frame k - 1."""
    frames = [np.eye(4)]
    for turn, a, d, alpha in zip(q, table.dh_a, table.dh_d, table.dh_alpha, strict=True):
        c, s, ca, sa = np.cos(turn), np.sin(turn), np.cos(alpha), np.sin(alpha)
        rows = [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]]
        frames.append(frames[-1] @ np.array(rows))
    return frames


def near(value, tolerance=1e-6):
    return pytest.approx(np.asarray(value), abs=tolerance)


class Scene:
    """A robot that reports what it is told, and what is drawn of it."""

    def __init__(self, server, at=(0.0, 0.0, 0.0), cell=NO_CELL, **reported):
        self.nodes = server.scene._handle_from_node_name
        self.robot = SimpleNamespace(values={}, info=None, kinematics=None, state=None, problem="")
        self.drawing = RobotDrawing(server, "/robot0", self.robot, at, cell)
        if reported:
            self.report(**{"info": info(), "q": Q} | reported)

    def report(self, q=None, values=None, **changes):
        if q is not None:
            self.robot.values = {"actual_q": tuple(q), "target_q": tuple(q)} | (values or {})
        vars(self.robot).update(changes)
        self.drawing.update()

    def labels(self):
        """Paths of what has a label, by its text."""
        found = {path: node for path, node in self.nodes.items() if isinstance(node, viser.LabelHandle)}
        return {node.text: path.rsplit("/", 1)[0] for path, node in found.items()}

    def place(self, path):
        """T_world_node (4, 4), of the nodes above it as a page composes them."""
        T, parts = np.eye(4), path.split("/")
        for k in range(2, len(parts) + 1):
            node = self.nodes["/".join(parts[:k])]
            T = T @ vtf.SE3.from_rotation_and_translation(vtf.SO3(node.wxyz), node.position).as_matrix()
        return T

    def shapes(self, below="/robot0"):
        return [path for path in self.nodes if re.fullmatch(rf"{below}/\d+", path)]


def state(shapes=(), contacts=(), things=(), tcp_pose=(0.0,) * 6):
    return SimpleNamespace(shapes=shapes, contacts=contacts, things=things, tcp_pose=tcp_pose)


@pytest.mark.parametrize(("name", "lengths"), [("UR3", UR3), ("UR5e", UR5E), ("UR5e", LONG), ("X", UR3)])
def test_links_stand_where_the_dh_table_puts_them(server, name, lengths):
    table, scene = kinematics(*lengths), Scene(server)
    arm = ArmDrawing(server.scene, "/arm", model_of(info(name), table), (1, 2, 3))
    for q in (np.zeros(6), Q, np.negative(Q)):
        arm.show(q)
        frames = dh_frames(table, q)
        assert scene.place(arm.flange) == near(frames[6], 1e-4)  # of CB3 URDFs, rounded
        assert arm.T_base_flange == near(scene.place(arm.flange))
        for k in range(1, 7):
            step = scene.place(arm.links[k].name)[:3, 3] - frames[k - 1][:3, 3]
            assert np.linalg.norm(np.cross(frames[k - 1][:3, 2], step)) < 1e-4, f"link {k} is off the axis"


def test_an_arm_is_the_one_of_its_name_unless_it_reports_other_lengths():
    for name in ROBOTS:
        nominal = model_of_arm(ROBOTS[name])
        assert model_of(info(nominal.title), None).description is ROBOTS[name]
        d1, a2, a3, d4, d5, d6 = dh_lengths(nominal)
        # As a calibration reports it: axes 2 to 4 are parallel, only the sum along them is seen.
        table = kinematics(d1, a2 - 1e-3, a3, d4, d5, d6)
        table = replace(table, dh_d=(d1, -310.0, 9.0, d4 + 301.001, d5, d6))
        assert model_of(info(nominal.title), table).description is ROBOTS[name]
    longer, unknown = (
        model_of(info(name), kinematics(*LONG)).description.geometry for name in ("UR5e", "UR99")
    )
    assert longer.a3 == unknown.a3 == LONG[2]
    assert longer.radii == ROBOTS["ur5e"].geometry.radii  # the joints are those of a UR5e
    assert unknown.radii != longer.radii
    for lengths in ((0.0,) * 6, (float("nan"),) * 6, (1e9,) * 6):
        assert model_of(info("UR16e"), kinematics(*lengths)).description is ROBOTS["ur16e"]


def test_nothing_is_drawn_before_a_robot_says_who_and_where_it_is(server):
    scene = Scene(server)
    for reported in ({}, {"info": info()}, {"q": (float("nan"),) * 6}):
        scene.report(**reported)
        assert scene.drawing.arm is None
    scene.report(q=Q, values={"tcp_offset": TCP})
    drawn = scene.drawing
    assert (drawn.arm.model.name, len(drawn.arm.links)) == ("ur5e", 7)
    assert drawn.T_base_tcp == near(dh_frames(kinematics(*UR5E), Q)[6] @ pose_to_T(TCP))
    assert scene.place(f"{drawn.arm.flange}/tcp") == near(drawn.T_base_tcp)


def test_noise_of_encoders_moves_nothing(server, monkeypatch):
    scene, sent = Scene(server, q=Q), []
    for _ in range(3):
        scene.report()
    monkeypatch.setattr(type(server.scene), "_queue_scene_message", lambda _, message: sent.append(message))
    for _ in range(4):
        scene.report(q=np.add(Q, 3e-5))
    assert not sent
    scene.report(q=np.add(Q, (0.01, 0, 0, 0, 0, 0)))
    assert {message.name for message in sent} == {scene.drawing.arm.links[1].name}


def test_shapes_come_move_and_go_and_names_are_only_text(server):
    carried = BodyShape("tool_0", True, "capsule", (0.04, 0.03), (0.0, 0.0, 0.05, 0.0, 0.0, 0.0))
    things = (
        BodyShape("table", False, "plane", (), (0.0, 0.0, -0.02, 0.0, 0.0, 0.0)),
        BodyShape("scene", False, "box", (0.2, 0.2, 0.1), (0.5, 0.0, 0.05, 0.0, 0.0, 0.3)),
        BodyShape("scene", False, "box", (0.2, 0.2, 0.1), (0.9, 0.0, 0.05, 0.0, 0.0, 0.3)),
        BodyShape(HOSTILE, False, "cylinder", (0.03, 0.1), (0.4, 0.3, 0.05, 0.0, 0.0, 0.0)),
        BodyShape("ball", False, "sphere", (0.05,), (0.4, -0.3, 0.05, 0.0, 0.0, 0.0)),
        BodyShape("left", False, "safety plane", (), (0.0, 0.5, 0.0, 1.0, 0.0, 0.0)),
    )
    scene = Scene(server, (1.0, 2.0, 0.0), state=state((carried, *things)))
    base, arm, texts = pose_to_T((1.0, 2.0, 0.0, 0.0, 0.0, 0.0)), scene.drawing.arm, scene.labels()
    assert all(PATHS.fullmatch(path) for path in scene.nodes if path.startswith("/robot0"))
    assert set(texts) == {HOSTILE, "ball", "left"}
    assert scene.place(texts["ball"])[:3, 3] == near((1.4, 1.7, 0.05))
    (hanging,) = scene.shapes(arm.flange)
    scene.report(q=np.negative(Q))
    assert scene.place(hanging) == near(base @ arm.T_base_tcp(carried.pose))
    before, moved = scene.nodes[texts["ball"]], (0.0, 0.7, 0.1, 0.0, 0.5, 0.0)
    scene.report(state=state((*things[:2], replace(things[4], pose=moved))))
    assert scene.nodes[texts["ball"]] is before
    assert scene.place(texts["ball"]) == near(base @ pose_to_T(moved))
    assert not {hanging, texts[HOSTILE]} & set(scene.nodes)
    assert len(scene.shapes()) == 3


@pytest.mark.parametrize("touches", [True, False])
def test_what_is_gripped_goes_with_the_flange_until_the_next_state(server, touches):
    scene, at, offset = (
        Scene(server, values={"tcp_offset": TCP}),
        (0.4, 0.1, 0.2, 0.3, 0.4, 0.5),
        {"tcp_offset": TCP},
    )
    before = scene.drawing.T_base_tcp
    shapes = [BodyShape(name, False, "sphere", (0.03,), at) for name in ("block", "other")]
    block = SimpleNamespace(name="block", touches_tool=touches)
    scene.report(state=state(shapes, (), [block], T_to_pose(before)))
    scene.report(q=np.add(Q, 0.1), values=offset)
    moved = scene.drawing.T_base_tcp @ np.linalg.inv(before) if touches else np.eye(4)
    texts = scene.labels()
    assert scene.place(texts["block"]) == near(moved @ pose_to_T(at), 1e-4)
    assert scene.place(texts["other"]) == near(pose_to_T(at))


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
    scene = Scene(server, cell=cell, q=Q)
    texts, arm = scene.labels(), scene.drawing.arm
    assert set(texts) == {"window", "press"}
    T = scene.place(texts["window"])
    assert T[:3, 2] == near((0.0, -(0.5**0.5), -(0.5**0.5)))
    assert T[:3, 2] @ (T[:3, 3] - (0.0, 0.6, 0.0)) == near(0.0)
    assert scene.place(texts["press"]) == near(pose_to_T((0.5, 0.0, 0.1, 0.0, 0.0, 0.5)))
    assert scene.shapes(arm.flange)
    assert scene.drawing.T_base_tcp == near(arm.T_base_tcp((0.0, 0.0, cell.tool.length, 0.0, 0.0, 0.0)))
    scene.report(state=state())  # a box that knows better
    assert not scene.shapes()


def test_the_target_is_seen_when_it_is_elsewhere(server):
    scene, elsewhere = Scene(server, values={"target_q": tuple(np.add(Q, 0.02))}), np.add(Q, 0.2)
    assert "/robot0/target/0" not in scene.nodes
    scene.report(q=Q, values={"target_q": tuple(elsewhere)})
    target = scene.nodes["/robot0/target/0"]
    flange = scene.drawing.arm.flange.replace("/arm/", "/target/")
    assert (target.visible, target.opacity) == (True, 0.35)
    assert scene.place(flange) == near(dh_frames(kinematics(*UR5E), elsewhere)[6])
    scene.report(q=Q)
    assert not target.visible


def test_forces_are_arrows_from_where_they_act(server):
    scene = Scene(server, values={"actual_TCP_force": (3.0, -2.0, 1.0, 9.0, 9.0, 9.0)})
    force, contacts = scene.nodes["/robot0/force"], scene.nodes["/robot0/contacts"]
    assert (force.visible, contacts.visible) == (False, False)
    press = Contact("forearm", "wall", (0.5, 0.0, 0.3), (1e5, 0.0, 0.0))
    resting = Contact("can", "table", (0.1, 0.1, 0.0), (0.0, 0.0, -0.5))
    pushed = {"actual_TCP_force": (0.0, 20.0, 0.0, 0.0, 0.0, 0.0)}
    scene.report(q=Q, values=pushed, state=state(contacts=[press, resting, press]))
    tcp = scene.drawing.T_base_tcp[:3, 3]
    assert (force.visible, contacts.visible) == (True, True)
    assert force.points == near([[tcp, np.add(tcp, (0.0, 0.1, 0.0))]])
    assert contacts.points == near([[(0.5, 0.0, 0.3), (1.0, 0.0, 0.3)]] * 2)
    scene.report(q=Q, state=state())
    assert (force.visible, contacts.visible) == (False, False)


def test_the_path_of_the_tcp_grows_and_fades(server):
    scene, tcps = Scene(server, info=None), []
    scene.report(info=info())
    for k in range(31):
        scene.report(q=np.add(Q, 0.02 * min(k, 20)))
        tcps.append(scene.drawing.T_base_tcp[:3, 3])
    trace = scene.nodes["/robot0/trace"]
    assert trace.visible
    assert trace.points[:, 0] == near(tcps[:20])
    assert trace.points[:, 1] == near(tcps[1:21])
    for _ in range(303):
        scene.report()
    assert not trace.visible


def test_a_lost_robot_is_grey_and_another_one_is_drawn_anew(server):
    scene = Scene(server, q=Q)
    drawn = scene.drawing
    arm, colour = drawn.arm, drawn.arm.links[3].color
    scene.report(problem="connection lost")
    assert (arm.links[3].color != colour, arm.links[3].opacity) == (True, 0.35)
    scene.report(problem="", info=info())  # the same kind of arm answers again
    assert (drawn.arm, arm.links[3].color, arm.links[3].opacity) == (arm, colour, None)
    scene.report(
        q=Q, info=info("UR3", 3), kinematics=kinematics(*UR3), values={"target_q": tuple(np.add(Q, 0.3))}
    )
    assert (drawn.arm is arm, drawn.arm.model.name) == (False, "ur3")
    assert not [path for path in scene.nodes if path.endswith("/lid")]  # published meshes have none
    assert scene.place(drawn.arm.flange) == near(dh_frames(kinematics(*UR3), Q)[6], 1e-4)
