"""Builtins for TCP, payload, mounting and the world model, and the protective stop."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from itertools import combinations
from math import hypot, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from protocol.pose import pose_inv, pose_sub, pose_trans, rotvec_to_matrix
from ur_emulator.controller.events import ProgramRequests
from ur_emulator.controller.force_sense import ForceSense
from ur_emulator.controller.settings import Payload, ToolSettings
from ur_emulator.controller.world_model import WorldModel, WorldModelError
from ur_emulator.models.robot_model import RobotModel, Vector3, six
from ur_emulator.scripting.script_arm import floats
from urscript.errors import ScriptRuntimeError
from urscript.values import Pose, Struct, log_form

# Greatest length of a tool [m] and of its rotation vector [rad]: beyond it poses lose precision.
MAX_TCP_OFFSET = 100.0
# Greatest distance of a centre of gravity from the flange along an axis [m]: far beyond it the simulation
# diverges.
MAX_COG = 1.0
# Largest moment of inertia [kg m^2]. Source: URScript manual e-Series, set_target_payload.
MAX_INERTIA = 133.0


def settings_functions(
    robot: RobotModel,
    tool: ToolSettings,
    force_sense: ForceSense,
    requests: ProgramRequests,
    step_time: float,
) -> Mapping[str, Callable[..., Any]]:
    """Return the builtins for TCP, payload and mounting, and the protective stop.

    Args:
        robot: has the greatest payload.
        tool: what they set.
        force_sense: a sensor is zeroed with the payload.
        requests: get the protective stop.
        step_time: duration of a cycle [s].
    """

    def set_tcp(thread: object, pose: Any, name: str = "") -> None:
        offset = six([float(x) for x in pose])
        if max(map(abs, offset)) > MAX_TCP_OFFSET:
            raise ScriptRuntimeError(
                f"set_tcp: {log_form(pose)} is not a valid TCP; allowed: numbers up to {MAX_TCP_OFFSET:g}"
            )
        if tool.payload.at_tcp:
            cog_of(offset[:3])
        tool.set_tcp(offset)

    def cog_of(value: Any) -> Vector3:
        cog = _vector(value)
        if max(map(abs, cog)) > MAX_COG:
            raise ScriptRuntimeError(
                f"a centre of gravity at {log_form(list(cog))} m is out of range; "
                f"allowed: numbers up to {MAX_COG:g} m from the flange"
            )
        return cog

    def mass_of(mass: float) -> float:
        if not 0.0 <= mass <= robot.payload_max:
            raise ScriptRuntimeError(
                f"a payload of {mass:g} kg is out of range; allowed: 0 to {robot.payload_max:g} kg"
            )
        return float(mass)

    def set_payload(thread: object, m: float, cog: Any) -> None:
        mass, place = mass_of(m), cog_of(tool.tcp_offset[:3] if cog is None else cog)
        tool.set_payload(mass, None if cog is None else place)
        force_sense.payload_declared()

    def set_payload_mass(thread: object, m: float) -> None:
        tool.set_payload_mass(mass_of(m))

    def set_payload_cog(thread: object, cog: Any) -> None:
        tool.set_payload_cog(cog_of(cog))

    def set_target_payload(
        thread: object, m: float, cog: Any, inertia: Any, transition_time: float = 0.0
    ) -> None:
        if (
            len(inertia) != 6
            or not all(abs(moment) <= MAX_INERTIA for moment in inertia)
            or min(inertia[:3]) < 0.0
        ):
            raise ScriptRuntimeError(
                f"set_target_payload: inertia must be six moments of inertia up to {MAX_INERTIA:g} kg m^2, "
                "the first three not below 0"
            )
        payload = Payload(mass_of(m), cog_of(cog), inertia=six(list(map(float, inertia))))
        tool.change_payload(payload, round(transition_time / step_time))

    def set_gravity(thread: object, d: Any) -> None:
        tool.set_gravity(_vector(d))

    return {
        "set_tcp": set_tcp,
        "set_payload": set_payload,
        "set_payload_mass": set_payload_mass,
        "set_payload_cog": set_payload_cog,
        "set_target_payload": set_target_payload,
        "set_base_acceleration": lambda thread, a: tool.set_base_acceleration(_vector(a)),
        "set_gravity": set_gravity,
        "protective_stop": lambda thread: requests.protective_stop(),
    }


def _vector(values: Any) -> Vector3:
    x, y, z = map(float, values)
    return (x, y, z)


# --- estimate_payload: mass and centre of gravity from wrenches measured in several poses
#
# Source: URScript manual e-Series 5.15, estimate_payload: poses of the TCP, wrenches at the flange in base
# axes; the least distance of the rotations. Chosen: least squares; gravity as it is set.

_LEAST_POSES = 4
# A lighter payload has no centre of gravity that could be measured [kg].
_LEAST_MASS = 1e-3


def payload_functions(tool: ToolSettings) -> Mapping[str, Callable[..., Any]]:
    """Return the builtin.

    Args:
        tool: has TCP and gravity.
    """

    def estimate_payload(thread: object, poses: list[Any], wrenches: list[Any]) -> Struct:
        _require_poses(poses, wrenches)
        gravity = -np.array(tool.gravity)
        flange_of_tcp = pose_inv(tool.tcp_offset)
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

    return {"estimate_payload": estimate_payload}


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


# --- builtins of the world model: named frames to attach and move, their poses, and what they weigh

Function = Callable[..., Any]


def world_functions(world: WorldModel, declare: Function) -> Mapping[str, Function]:
    """Return the builtins of the world model.

    Args:
        world: the frames.
        declare: the builtin that declares a payload.
    """

    def get_pose(thread: object, name: str, rel_name: str, ref_name: str | None) -> Pose:
        return Pose.of(world.relative_pose(name, rel_name, rel_name if ref_name is None else ref_name))

    def set_mass_properties(thread: object, frame: str, m: float, cog: Any, inertia: Any) -> None:
        x, y, z = map(float, cog)
        world.set_mass(frame, Payload(float(m), (x, y, z), inertia=floats(inertia)))

    def set_payload_from_attached_frames(thread: object) -> None:
        payload = world.attached_payload()
        declare(thread, payload.mass, payload.cog, payload.inertia)

    functions: dict[str, Function] = {
        "add_frame": lambda thread, name, pose, reference: world.add(name, tuple(pose), reference),
        "attach_frame": lambda thread, child, parent: world.attach(child, parent),
        "delete_frame": lambda thread, name: world.delete(name),
        "delete_all_frames": lambda thread: world.delete_all(),
        "move_frame": lambda thread, name, pose, reference: world.move(name, tuple(pose), reference),
        "get_pose": get_pose,
        "convert_pose": lambda thread, pose, *frames: Pose.of(world.convert(tuple(pose), *frames)),
        "reset_world_model": lambda thread: world.reset(),
        "is_frame": lambda thread, name: name in world,
        "get_frame_parent": lambda thread, name: world.parent(name),
        "get_children": lambda thread, name: world.children(name),
        "set_mass_properties": set_mass_properties,
        "set_payload_from_attached_frames": set_payload_from_attached_frames,
    }
    return {name: _refusing(name, function) for name, function in functions.items()}


def _refusing(name: str, function: Function) -> Function:
    """Return a builtin whose refusals are errors of the program."""

    @wraps(function)
    def call(*arguments: Any) -> Any:
        try:
            return function(*arguments)
        except WorldModelError as error:
            raise ScriptRuntimeError(f"{name}: {error}") from None

    return call
