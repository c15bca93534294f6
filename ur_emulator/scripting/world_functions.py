"""Builtins of the world model: named frames to attach and move, their poses, and what they weigh."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any

from ur_emulator.controller.tool_settings import Payload
from ur_emulator.controller.world_model import WorldModel, WorldModelError
from ur_emulator.scripting.script_arm import floats
from urscript.errors import ScriptRuntimeError
from urscript.values import Pose

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
