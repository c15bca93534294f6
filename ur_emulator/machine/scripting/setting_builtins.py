"""Builtins for TCP, payload and mounting, and the world model."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import hypot, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from protocol.pose import pose_inv, pose_sub, pose_trans, rotvec_to_matrix
from ur_emulator.machine.controller.force_sense import ForceSense
from ur_emulator.machine.controller.settings import Payload, ToolSettings
from ur_emulator.machine.controller.world_model import WorldModel, WorldModelError
from ur_emulator.machine.models.robot_model import ZERO6, RobotModel, Vector3, six
from ur_emulator.machine.scripting.builtin_group import BuiltinGroup, builtin, floats, refusing, vector
from urscript import HostFunction, ScriptRuntimeError
from urscript.values import Pose, Struct, log_form

# Greatest length of a tool [m] and of its rotation vector [rad]: beyond it poses lose precision.
MAX_TCP_OFFSET = 100.0
# Greatest distance of a centre of gravity from the flange along an axis [m]: far beyond it the simulation
# diverges.
MAX_COG = 1.0
# Largest moment of inertia [kg m^2]. Source: URScript manual e-Series, set_target_payload.
MAX_INERTIA = 133.0


@dataclass(frozen=True)
class SettingBuiltins(BuiltinGroup):
    """TCP, payload and mounting; a payload zeroes a force sensor. A cycle takes `_step_time` [s]."""

    _robot: RobotModel
    _tool: ToolSettings
    _force_sense: ForceSense
    _step_time: float

    @builtin("set_tcp")
    def _set_tcp(self, thread: object, pose: Any, name: str = "") -> None:
        offset = six([float(x) for x in pose])
        if max(map(abs, offset)) > MAX_TCP_OFFSET:
            raise ScriptRuntimeError(
                f"set_tcp: {log_form(pose)} is not a valid TCP; allowed: numbers up to {MAX_TCP_OFFSET:g}"
            )
        if self._tool.payload.at_tcp:
            _cog(offset[:3])
        self._tool.set_tcp(offset)

    @builtin("set_payload")
    def _set_payload(self, thread: object, m: float, cog: Any) -> None:
        mass, place = self._mass(m), _cog(self._tool.tcp_offset[:3] if cog is None else cog)
        self._tool.change_payload(Payload(mass, place, at_tcp=cog is None))
        self._force_sense.zero_built_in(0)

    @builtin("set_payload_mass")
    def _set_payload_mass(self, thread: object, m: float) -> None:
        self._tool.change_payload(replace(self._tool.payload, mass=self._mass(m), inertia=ZERO6))

    @builtin("set_payload_cog")
    def _set_payload_cog(self, thread: object, cog: Any) -> None:
        self._tool.change_payload(Payload(self._tool.payload.mass, _cog(cog)))

    @builtin("set_target_payload")
    def set_target_payload(
        self, thread: object, m: float, cog: Any, inertia: Any, transition_time: float = 0.0
    ) -> None:
        """Declare a payload, which counts fully after a time [s]."""
        if (
            len(inertia) != 6
            or not all(abs(moment) <= MAX_INERTIA for moment in inertia)
            or min(inertia[:3]) < 0.0
        ):
            raise ScriptRuntimeError(
                f"set_target_payload: inertia must be six moments of inertia up to {MAX_INERTIA:g} kg m^2, "
                "the first three not below 0"
            )
        payload = Payload(self._mass(m), _cog(cog), inertia=six(list(map(float, inertia))))
        self._tool.change_payload(payload, round(transition_time / self._step_time))

    @builtin("set_gravity")
    def _set_gravity(self, thread: object, d: Any) -> None:
        self._tool.gravity = vector(d)

    @builtin("set_base_acceleration")
    def _set_base_acceleration(self, thread: object, a: Any) -> None:
        self._tool.base_acceleration = vector(a)

    @builtin("estimate_payload")
    def _estimate_payload(self, thread: object, poses: list[Any], wrenches: list[Any]) -> Struct:
        """Estimate mass and centre of gravity from wrenches that were measured in several poses.

        Source: URScript manual e-Series 5.15, estimate_payload: poses of the TCP, wrenches at the flange in
        base axes; the least distance of the rotations. Chosen: least squares; gravity as it is set.
        """
        _require_poses(poses, wrenches)
        gravity = -np.array(self._tool.gravity)
        flange_of_tcp = pose_inv(self._tool.tcp_offset)
        turns = [rotvec_to_matrix(pose_trans(tuple(pose), flange_of_tcp)[3:]) for pose in poses]
        measured = np.array([tuple(map(float, wrench)) for wrench in wrenches])
        mass = float((measured[:, :3] @ gravity).sum() / (len(poses) * (gravity @ gravity)))
        if mass < _LEAST_MASS:
            return Struct({"mass": max(mass, 0.0), "cog": [0.0, 0.0, 0.0]})
        # The moment of the weight: centre x weight = -[weight] centre, centre = turn cog.
        weight = mass * gravity
        rows = np.concatenate([-_cross_matrix(weight) @ turn for turn in turns])
        cog, *_ = np.linalg.lstsq(rows, measured[:, 3:].ravel(), rcond=None)
        return Struct({"mass": mass, "cog": cog.tolist()})

    def _mass(self, mass: float) -> float:
        most = self._robot.payload_max
        if not 0.0 <= mass <= most:
            raise ScriptRuntimeError(f"a payload of {mass:g} kg is out of range; allowed: 0 to {most:g} kg")
        return float(mass)


def _cog(value: Any) -> Vector3:
    cog = vector(value)
    if max(map(abs, cog)) > MAX_COG:
        raise ScriptRuntimeError(
            f"a centre of gravity at {log_form(list(cog))} m is out of range; "
            f"allowed: numbers up to {MAX_COG:g} m from the flange"
        )
    return cog


_LEAST_POSES = 4
# A lighter payload has no centre of gravity that could be measured [kg].
_LEAST_MASS = 1e-3


def _require_poses(poses: Sequence[Any], wrenches: Sequence[Any]) -> None:
    n = len(poses)
    if n < _LEAST_POSES or len(wrenches) != n:
        raise ScriptRuntimeError(
            f"estimate_payload: {n} poses and {len(wrenches)} wrenches given; "
            f"allowed: as many of both, at least {_LEAST_POSES}"
        )
    if not all(isinstance(item, Pose | list) and len(item) == 6 for item in (*poses, *wrenches)):
        raise ScriptRuntimeError("estimate_payload: poses and wrenches must have six numbers each")
    least = pi / (2 * n)
    for one, other in combinations(poses, 2):
        angle = hypot(*pose_sub(tuple(one), tuple(other))[3:])
        if angle < least:
            raise ScriptRuntimeError(
                f"estimate_payload: two poses differ by {angle:.3f} rad only; "
                f"allowed: at least {least:.3f} rad with {n} poses"
            )


def _cross_matrix(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y, z = vector.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


class WorldBuiltins(BuiltinGroup):
    """The world model: named frames to attach and move, their poses, and what they weigh."""

    def __init__(self, world: WorldModel, declare: HostFunction) -> None:
        """Bind the builtins; `declare` is the one that declares a payload."""
        self._world = world
        self._declare = declare

    def functions(self) -> dict[str, HostFunction]:
        """Return the builtins; what the world model refuses is an error of the program."""
        world = self._world
        functions: dict[str, HostFunction] = super().functions() | {
            "add_frame": lambda thread, name, pose, reference: world.add(name, tuple(pose), reference),
            "attach_frame": lambda thread, child, parent: world.attach(child, parent),
            "delete_frame": lambda thread, name: world.delete(name),
            "delete_all_frames": lambda thread: world.delete_all(),
            "move_frame": lambda thread, name, pose, reference: world.move(name, tuple(pose), reference),
            "convert_pose": lambda thread, pose, *frames: Pose.of(world.convert(tuple(pose), *frames)),
            "reset_world_model": lambda thread: world.reset(),
            "is_frame": lambda thread, name: name in world,
            "get_frame_parent": lambda thread, name: world.parent(name),
            "get_children": lambda thread, name: world.children(name),
        }
        return refusing(functions, WorldModelError)

    @builtin("get_pose")
    def _get_pose(self, thread: object, name: str, rel_name: str, ref_name: str | None) -> Pose:
        reference = rel_name if ref_name is None else ref_name
        return Pose.of(self._world.relative_pose(name, rel_name, reference))

    @builtin("set_mass_properties")
    def _set_mass(self, thread: object, frame: str, m: float, cog: Any, inertia: Any) -> None:
        self._world.set_mass(frame, Payload(float(m), vector(cog), inertia=floats(inertia)))

    @builtin("set_payload_from_attached_frames")
    def _declare_attached(self, thread: object) -> None:
        payload = self._world.attached_payload()
        self._declare(thread, payload.mass, payload.cog, payload.inertia)
