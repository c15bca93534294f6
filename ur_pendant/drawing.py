"""An arm, what it carries, what stands around it and what presses on it, in space.

The links of an arm are nodes below each other: a joint that turns is one new orientation, and all that hangs
on the flange follows. Names of things are only shown as labels: paths of nodes have numbers.
"""

from collections.abc import Iterable, Sequence, Set
from dataclasses import replace
from functools import lru_cache, partial
from itertools import count
from math import dist, hypot, isfinite, pi
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
import viser
from viser._messages import SetOrientationMessage

from pc_client.arrays import Array
from pc_client.driver.report import RobotInfo
from pc_client.driver.rtde import RtdeValues
from pc_client.kinematics.arms import ROBOTS, DhArm, RobotDescription, Six
from pc_client.kinematics.clearance import housings, load_meshes
from pc_client.kinematics.model import RobotModel, dh_lengths, load_pinocchio_model, model_of_arm
from protocol.pose import pose_inv, pose_to_T, pose_trans, rpy_to_rotvec
from protocol.primary.layout import KinematicsInfo
from ur_emulator.host.control_api.box_state import BoxState
from ur_emulator.machine.models.things import BodyShape
from ur_hil.cell import NO_CELL, Cell, Three
from ur_pendant.robot import Robot

Colour = tuple[int, int, int]
_HOUSING, _LID, _LOST, _TARGET = (206, 209, 213), (104, 132, 160), (130, 130, 130), (60, 150, 70)
_CARRIED, _SCENE, _THING, _LIMIT = (72, 76, 82), (196, 178, 148), (70, 130, 180), (240, 190, 40)
_FORCE, _CONTACT, _TRACE = (210, 60, 60), (230, 150, 0), (30, 110, 200)
_TRANSLUCENT = 0.35
_UNTURNED, _UNMOVED = 1e-4, 1e-5  # joints [rad] and things [m] that move by less stay: encoders have noise
_VISIBLY = 0.05  # the target is drawn when a joint is further away [rad]: an arm that moves lags by 0.02
_PER_NEWTON, _LONGEST = 0.005, 0.5  # length of an arrow [m/N], and the largest [m]
_LEAST_CONTACT, _LEAST_FORCE = 1.0, (15.0, 10.0)  # less is no arrow [N]: a bare CB3, or later arm, has 7 N
_PATH_POINTS, _PATH_EVERY, _PATH_STEP = 300, 3, 0.001  # one an update, drawn every third; least step [m]
_SEEN_FROM = (1.8, -1.3, 1.1)  # by pages that are opened [reaches of the arm]
_SIDE = 2.0  # of the square that stands for a plane [m]


def model_of(info: RobotInfo, kinematics: KinematicsInfo | None, cell: Cell = NO_CELL) -> RobotModel:
    """Return the client's model of the arm that a robot says it is.

    An arm whose lengths are not those of its name gets the reported ones; housings by its name, or to scale.
    """
    known = ROBOTS.get(info.model.lower())
    a, d = (kinematics.dh_a, kinematics.dh_d) if kinematics is not None else ((0.0,) * 6, (0.0,) * 6)
    # Axes 2 to 4 are parallel: a calibration shares the distance along them out among d2, d3 and d4.
    lengths = (d[0], a[1], a[2], d[1] + d[2] + d[3], d[4], d[5])
    if not all(0.01 < abs(length) < 10.0 for length in lengths):  # no arm has them
        return model_of_arm(known or ROBOTS["ur5e"], cell)
    if known and np.allclose(lengths, dh_lengths(model_of_arm(known)), 0.0, known.position_tolerance):
        return model_of_arm(known, cell)
    return model_of_arm(_own_arm(known, lengths), cell)


def _own_arm(known: RobotDescription | None, lengths: Six) -> RobotDescription:
    rows = [(arm, arm.geometry) for arm in ROBOTS.values() if isinstance(arm.geometry, DhArm)]
    long = abs(lengths[1]) + abs(lengths[2])
    like, shape = min(rows, key=lambda row: (row[0] is not known, abs(long + row[1].a2 + row[1].a3)))
    ratio = -long / (shape.a2 + shape.a3)
    scale = 1.0 if like is known else ratio
    shoulder, elbow, wrist = (scale * radius for radius in shape.radii)
    offsets = scale * shape.shoulder_offset, shape.elbow_offset * lengths[3] / shape.d4
    own = DhArm(*lengths, *offsets, scale * shape.foot, (shoulder, elbow, wrist))
    return replace(like, geometry=own, reach=ratio * like.reach)


# Links with a tube between their housings: which radius it has; and ends of housings without a neighbour.
_TUBES = {"upper_arm_link": 1, "forearm_link": 2}
_LIDS = {"upper_arm_link": (1, 3), "forearm_link": (0, 2), "wrist_1_link": (2,), "wrist_2_link": (2,)}


class _Mesh(NamedTuple):
    """Corners (n, 3) [m] and triangles (m, 3) of them; triangles that share corners look round."""

    vertices: Array
    faces: Array
    is_flat: bool = False


@lru_cache(maxsize=16)
def _links(description: RobotDescription) -> tuple[tuple[_Mesh, _Mesh | None], ...]:
    """Housing and lids of each link, base to wrist 3, in the frame of its joint; shared, never changed."""
    model, geometry = load_pinocchio_model(description), description.geometry
    if not isinstance(geometry, DhArm):
        return tuple((_published(link), None) for link in load_meshes(geometry, model))
    links = []
    for name, rings in housings(geometry).items():
        centres = [ring.mean(axis=0) for ring in rings]
        body, lids = [_loft(*rings[k : k + 2]) for k in range(0, len(rings), 2)], []
        if name in _TUBES:  # along z
            radius = 0.85 * geometry.radii[_TUBES[name]]
            body.append(_loft(*(_ring(radius) + (centres[k] + centres[k + 1]) / 2 for k in (0, 2))))
        for k in _LIDS.get(name, ()):
            outward = centres[k] - centres[k ^ 1]
            top = centres[k] + 0.12 * geometry.radii[2] * outward / hypot(*outward)
            lids.append(_loft(rings[k], top + 0.9 * (rings[k] - centres[k])))
        at = model.frames[model.getFrameId(name)].placement
        links.append((_joined(body, at), _joined(lids, at) if lids else None))
    return tuple(links)


def _published(link: Any) -> _Mesh:
    """A mesh of Pinocchio's collision library, at its place."""
    mesh = link.geometry
    corners = (mesh.tri_indices(k) for k in range(mesh.num_tris))
    faces = np.array([(c[0], c[1], c[2]) for c in corners])
    return _joined([_Mesh(mesh.vertices(), faces, True)], link.placement)


def _joined(parts: Sequence[_Mesh], placement: Any) -> _Mesh:
    """One mesh of several, at their place."""
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts)])
    vertices = np.vstack([part.vertices for part in parts]) @ placement.rotation.T + placement.translation
    faces = [part.faces + offset for part, offset in zip(parts, offsets, strict=False)]
    return _Mesh(vertices, np.vstack(faces), parts[0].is_flat)


def _loft(*rings: Array) -> _Mesh:
    """A closed body through rings of points (n, 3), each about its axis from the same side on."""
    n = len(rings[0])
    k, after = np.arange(n), np.roll(np.arange(n), -1)
    side = np.vstack((np.column_stack((k, after, n + k)), np.column_stack((after, n + after, n + k))))
    fan = np.column_stack((np.zeros(n - 2, int), k[1:-1], k[2:]))
    # The ends have corners of their own, so that light shows the edge.
    faces = [side + n * i for i in range(len(rings) - 1)] + [fan + n * len(rings), fan + n * (len(rings) + 1)]
    return _Mesh(np.vstack((*rings, rings[0], rings[-1])), np.vstack(faces))


def _ring(radius: float, z: float = 0.0) -> Array:
    """Points (n, 3) of a circle about z."""
    turn = np.linspace(0.0, 2.0 * pi, 24, endpoint=False)
    return np.column_stack((radius * np.cos(turn), radius * np.sin(turn), np.full_like(turn, z)))


class ArmDrawing:
    """An arm in space.

    Attributes:
        links: joints 1 to k carry the mesh with number k. Each is a node below the one before.
        flange: path of a node in the flange's frame, for what hangs there.
    """

    def __init__(
        self, scene: viser.SceneApi, name: str, model: RobotModel, colour: Colour, opacity: float = 1.0
    ) -> None:
        """Draw it below the node `name`, with all joints at zero."""
        self.model, self._data = model, model.pin_model.createData()
        self._q: Array = np.full(6, np.inf)
        links, lids = [], []
        for joint, (body, lid) in enumerate(_links(model.description)):
            name = f"{name}/{joint}"
            at = model.pin_model.jointPlacements[joint].translation
            look = {"flat_shading": body.is_flat, "side": "double"}
            links.append(scene.add_mesh_simple(name, body.vertices, body.faces, position=at, **look))
            if lid is not None:
                lids.append(scene.add_mesh_simple(f"{name}/lid", lid.vertices, lid.faces, color=_LID, **look))
        self.links, self._lids, self.flange = tuple(links), lids, f"{name}/flange"
        at = model.pin_model.frames[model.flange_frame].placement
        scene.add_frame(self.flange, show_axes=False, position=at.translation, wxyz=_wxyz(at.rotation))
        self.paint(colour, opacity)
        self.show(np.zeros(6))

    def show(self, q: Sequence[float] | Array) -> bool:
        """Put it into a posture (6,) [rad]; return whether a joint turned visibly."""
        if turned := [k for k in range(6) if abs(q[k] - self._q[k]) > _UNTURNED]:
            self._q[turned] = [q[k] for k in turned]
            pin.framesForwardKinematics(self.model.pin_model, self._data, self._q)
            for k in turned:
                _turn(self.links[k + 1], _wxyz(self._data.liMi[k + 1].rotation))
        return bool(turned)

    def paint(self, colour: Colour, opacity: float) -> None:
        """Give it a colour, and an opacity up to 1."""
        for mesh in (*self.links, *self._lids):
            mesh.opacity = opacity if opacity < 1.0 else None
        for mesh in self.links:
            mesh.color = colour

    @property
    def T_base_flange(self) -> Array:
        """(4, 4) in the posture that is shown [m]."""
        return np.array(self._data.oMf[self.model.flange_frame].homogeneous)

    def T_base_tcp(self, offset: Sequence[float]) -> Array:
        """(4, 4) of a TCP with the pose `offset` in the flange frame [m, rad]."""
        return np.asarray(self.T_base_flange @ pose_to_T(offset))


def _round(radius: float, length: float, caps: bool) -> _Mesh:
    """A cylinder along z, or a capsule, whose length is without its ends."""
    up = radius * np.sin(np.linspace(0.0, pi / 2.0, 7)) if caps else np.zeros(1)
    across = np.sqrt(np.maximum(radius * radius - up * up, 1e-12))
    half = [(r, length / 2.0 + z) for r, z in zip(across, up, strict=True)]
    return _loft(*(_ring(r, -z) for r, z in reversed(half)), *(_ring(r, z) for r, z in half))


def _shapes_of(cell: Cell) -> list[BodyShape]:
    """What stands around an arm, and its tool."""
    up, shapes = np.array((0.0, 0.0, 1.0)), []
    walls = [(wall.name, np.array(wall.normal), wall.offset) for wall in cell.walls]
    for name, normal, offset in [("table", up, cell.floor_z), *walls]:
        turn = pin.log3(pin.Quaternion.FromTwoVectors(up, normal).matrix())
        shapes.append(BodyShape(name, False, "plane", (), (*(offset * normal), *turn)))
    for solid in (*cell.solids, *cell.things, *cell.tool.solids):
        pose = (*solid.centre, *rpy_to_rotvec(solid.rpy))
        shapes.append(BodyShape(solid.name, solid in cell.tool.solids, solid.shape, solid.sizes, pose))
    return shapes


class RobotDrawing:
    """Everything of one robot in space, below the node `name`.

    Attributes:
        root: node of the base, for what stands there.
        arm: as it was measured; None until the robot says who it is and where it stands. Another kind of arm
            gets a new one.
        T_base_tcp: (4, 4) of the measured TCP [m].
    """

    def __init__(
        self, server: viser.ViserServer, name: str, robot: Robot, at: Three = (0, 0, 0), cell: Cell = NO_CELL
    ) -> None:
        """Put its base to the point `at` [m]; draw `cell` and its tool if no control API has others."""
        self._scene, self._name, self._robot, self._cell = server.scene, name, robot, cell
        self._camera = server.initial_camera
        self.arm: ArmDrawing | None = None
        self.T_base_tcp: Array = np.eye(4)
        self._info: RobotInfo | None = None
        self._state: BoxState | None = None
        self._offset: tuple[float, ...] = ()
        self._held: Set[str] = frozenset()
        self._target: ArmDrawing | None = None
        self._shapes: dict[tuple[object, ...], viser.SceneNodeHandle] = {}
        self._path: Array = np.empty((0, 3))
        self._numbers, self._turns, self._is_lost = count(), count(), False
        self.root = self._scene.add_frame(name, show_axes=False, position=at)
        none = np.zeros((1, 2, 3))
        size = {"shaft_radius": 0.005, "head_radius": 0.012, "head_length": 0.03}
        arrows = partial(self._scene.add_arrows, points=none, visible=False, **size)
        self._force = arrows(f"{name}/force", colors=_FORCE)
        self._contacts = arrows(f"{name}/contacts", colors=_CONTACT)
        self._trace = self._scene.add_line_segments(f"{name}/trace", none, _TRACE, thickness=0.003)

    def _arm_of(self, info: RobotInfo) -> ArmDrawing:
        """Return the arm as it is drawn, or begin with another kind of arm."""
        model = model_of(info, self._robot.kinematics, self._cell)
        if self.arm is not None and self.arm.model.description == model.description:
            return self.arm
        self._show_shapes((), "")
        for part in ("arm", "target"):
            self._scene.remove_by_name(f"{self._name}/{part}")
        self.arm = arm = ArmDrawing(self._scene, f"{self._name}/arm", model, _HOUSING)
        self._target, self._state, self._is_lost, self._offset = None, None, False, ()
        self._path = np.empty((0, 3))
        self._tcp = self._scene.add_frame(f"{arm.flange}/tcp", axes_length=0.08, axes_radius=0.003)
        self._show_shapes(_shapes_of(self._cell), arm.flange)
        self._camera.position = np.multiply(_SEEN_FROM, model.description.reach)
        return arm

    @property
    def solids(self) -> list[Any]:
        """Nodes of the links, base to wrist 3, and of what the flange carries."""
        carried = [node for (_, is_carried, *_), node in self._shapes.items() if is_carried]
        return [*(self.arm.links if self.arm is not None else ()), *carried]

    def update(self) -> None:
        """Draw what the robot reports now."""
        values, info, state = self._robot.values, self._robot.info, self._robot.state
        q = _six(values, "actual_q")
        if info is None or q is None:
            return
        arm = self.arm
        if arm is None or info is not self._info:
            self._info, arm = info, self._arm_of(info)
        if self._is_lost != bool(self._robot.problem):
            self._is_lost = not self._is_lost
            arm.paint(*((_LOST, _TRANSLUCENT) if self._is_lost else (_HOUSING, 1.0)))
        offset = _six(values, "tcp_offset") or arm.model.tcp_offset
        if arm.show(q) or offset != self._offset:
            self.T_base_tcp = arm.T_base_tcp(offset)
            if offset != self._offset:
                self._offset = offset
                _place(self._tcp, offset)
        tcp, force = self.T_base_tcp[:3, 3], _six(values, "actual_TCP_force") or (0.0, 0.0, 0.0)
        _point(self._force, [(tcp, force[:3])], _LEAST_FORCE[info.version.major >= 5])
        self._show_path(tcp)
        target = _six(values, "target_q") or q
        is_away = max(abs(a - b) for a, b in zip(q, target, strict=True)) > _VISIBLY
        if self._target is None and is_away:
            self._target = ArmDrawing(self._scene, f"{self._name}/target", arm.model, _TARGET, _TRANSLUCENT)
        if self._target is not None:
            self._target.links[0].visible = is_away
            if is_away:
                self._target.show(target)
        if state is not None and state is not self._state:
            self._state, self._held = state, {thing.name for thing in state.things if thing.touches_tool}
            self._show_shapes(map(self._gripped, state.shapes), arm.flange)
            _point(self._contacts, [(c.position, c.force) for c in state.contacts], _LEAST_CONTACT)

    def _show_path(self, tcp: Array) -> None:
        """Go on with the path of the TCP (3,) [m]."""
        last = self._path[-1] if len(self._path) else tcp
        point = tcp if dist(tcp, last) > _PATH_STEP else last
        self._path = path = np.vstack((self._path[1 - _PATH_POINTS :], point))
        if next(self._turns) % _PATH_EVERY == 0:
            moved = (path[1:] != path[:-1]).any(axis=1)
            self._trace.visible = bool(moved.any())
            if self._trace.visible:
                self._trace.points = np.stack((path[:-1][moved], path[1:][moved]), axis=1)

    def _show_shapes(self, shapes: Iterable[BodyShape], flange: str) -> None:
        """Draw these shapes and no others."""
        before, self._shapes = self._shapes, {}
        for shape in shapes:
            key: tuple[object, ...] = (shape.name, shape.is_carried, shape.shape, shape.size)
            while key in self._shapes:
                key = (*key, "another")
            if (node := before.pop(key, None)) is None:
                path = f"{flange if shape.is_carried else self._name}/{next(self._numbers)}"
                node = self._add(path, shape)
            self._shapes[key] = node
            _place(node, shape.pose)
        for node in before.values():
            node.remove()

    def _gripped(self, shape: BodyShape) -> BodyShape:
        """The shape of a thing that is held as one that hangs on the flange: states come seldom."""
        if shape.name not in self._held or self._state is None:
            return shape
        to_flange = pose_trans(self._offset, pose_inv(self._state.tcp_pose))
        return replace(shape, is_carried=True, pose=pose_trans(to_flange, shape.pose))

    def _add(self, path: str, shape: BodyShape) -> viser.SceneNodeHandle:
        """Draw a shape, with its name if it has one of its own."""
        if (shape.name, shape.shape) == ("table", "plane"):
            return self._scene.add_grid(path, 2 * _SIDE, 2 * _SIDE, cell_size=0.1, section_size=0.5)
        is_tool = shape.is_carried and shape.name not in self._held
        if is_tool:
            colour = _CARRIED
        elif shape.shape == "safety plane":
            colour = _LIMIT
        else:
            colour = _SCENE if shape.name == "scene" else _THING
        match shape.shape:
            case "box":
                node = self._scene.add_box(path, colour, shape.size)
            case "plane" | "safety plane":
                node = self._scene.add_box(path, colour, (_SIDE, _SIDE, 0.001), opacity=0.2)
            case _:
                radius, length = (*shape.size, 0.0)[:2]
                mesh = _round(radius, length, shape.shape != "cylinder")
                node = self._scene.add_mesh_simple(
                    path, mesh.vertices, mesh.faces, color=colour, side="double"
                )
        if colour in (_THING, _LIMIT):
            self._scene.add_label(f"{path}/0", shape.name)
        return node


def _six(values: RtdeValues, name: str) -> tuple[float, ...] | None:
    value = values.get(name)
    return value if isinstance(value, tuple) and len(value) == 6 and all(map(isfinite, value)) else None


def _wxyz(rotation: Array) -> tuple[float, float, float, float]:
    quaternion = pin.Quaternion(rotation)
    return quaternion.w, quaternion.x, quaternion.y, quaternion.z


def _turn(node: viser.SceneNodeHandle, wxyz: tuple[float, float, float, float]) -> None:
    """Set an orientation that has changed; viser would compare it first, for a third of the window's time."""
    node._impl.wxyz[:] = wxyz
    node._impl.api._queue_scene_message(SetOrientationMessage(node._impl.name, wxyz))


def _place(node: viser.SceneNodeHandle, pose: Sequence[float]) -> None:
    """Put a node to a pose (6,) [m, rad]."""
    for name, value in (("position", pose[:3]), ("wxyz", _wxyz(pin.exp3(np.array(pose[3:]))))):
        if np.abs(np.subtract(getattr(node, name), value)).max() > _UNMOVED:
            setattr(node, name, value)


def _point(arrows: viser.ArrowsHandle, forces: Iterable[tuple[Any, Sequence[float]]], least: float) -> None:
    """Let an arrow begin at each point (3,) [m] with the length of its force (3,) [N]."""
    ends = []
    for at, force in forces:
        if (size := hypot(*force)) >= least:
            ends.append((at, at + min(_PER_NEWTON, _LONGEST / size) * np.array(force)))
    arrows.visible = bool(ends)
    if ends:
        arrows.points = np.array(ends)
