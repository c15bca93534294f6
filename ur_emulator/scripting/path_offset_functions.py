"""Builtins of path offset: a program displaces the tool from the path while it moves."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ur_emulator.models.robot_model import ZERO6
from ur_emulator.motion.generators import StopJ
from ur_emulator.motion.path_offset import OffsetType, PathOffset
from ur_emulator.scripting.script_arm import Cycles, ScriptArm, floats, require_positive
from urscript.run.waits import NEXT_CYCLE
from urscript.values import Pose


class ProgramPathOffset:
    """The path offset of one program."""

    def __init__(self, arm: ScriptArm) -> None:
        self._arm = arm
        self._offset = PathOffset(arm.tool)

    def end(self) -> None:
        """Disable it; the arm ramps to rest."""
        self._arm.motion.remove_overlay(self._offset)

    def functions(self) -> Mapping[str, Callable[..., Any]]:
        """Return the builtins."""
        arm, motion, path_offset = self._arm, self._arm.motion, self._offset

        def enable(thread: object) -> None:
            if not motion.has_overlay(path_offset):
                path_offset.begin(arm.tool)
                motion.add_overlay(path_offset)

        def disable(thread: object, a: float) -> Cycles:
            require_positive("path_offset_disable", a=a)
            arm.take(thread, ramp := StopJ(a))
            self.end()
            while not ramp.done:
                yield NEXT_CYCLE

        def set_offset(thread: object, offset: Any, kind: float) -> None:
            path_offset.set(floats(tuple(offset)), OffsetType(int(kind)))

        def get_offset(thread: object, kind: float) -> Pose:
            is_on = motion.has_overlay(path_offset)
            return Pose.of(path_offset.applied(OffsetType(int(kind))) if is_on else ZERO6)

        def set_alpha_filter(thread: object, alpha: float) -> None:
            path_offset.alpha = float(alpha)

        def set_max_offset(thread: object, translation: float, rotation: float) -> None:
            require_positive("path_offset_set_max_offset", transLimit=translation, rotLimit=rotation)
            path_offset.limits = (float(translation), float(rotation))

        return {
            "path_offset_enable": enable,
            "path_offset_disable": disable,
            "path_offset_set": set_offset,
            "path_offset_get": get_offset,
            "path_offset_set_alpha_filter": set_alpha_filter,
            "path_offset_set_max_offset": set_max_offset,
        }
