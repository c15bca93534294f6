"""Builtins that say how moves shall be planned."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf
from typing import Any

from ur_emulator.controller.planning import PlanningSettings, ToolWrenchLimit
from ur_emulator.models.robot_model import six
from ur_emulator.scripting.script_arm import require_positive
from urscript.values import Pose

_AXES = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")


def planning_functions(planning: PlanningSettings) -> Mapping[str, Callable[..., Any]]:
    """Return the builtins of motion version, jerk limit and wrench limit."""

    def limit_set(thread: object, frame: Pose, *most: float | None) -> None:
        given = {name: value for name, value in zip(_AXES, most, strict=True) if value is not None}
        require_positive("tool_wrench_limit_set", **given)
        limits = [inf if value is None else float(value) for value in most]
        planning.limit_tool_wrench(ToolWrenchLimit(six(frame), six(limits)))

    return {
        "motion_version_set": lambda thread, version: planning.set_motion_version(int(version)),
        "motion_version_get": lambda thread: planning.motion_version,
        "jerk_gain_scaling_set": lambda thread, gain: planning.set_jerk_gain(float(gain)),
        "jerk_gain_scaling_get": lambda thread: planning.jerk_gain,
        "tool_wrench_limit_set": limit_set,
        "tool_wrench_limit_disable": lambda thread: planning.limit_tool_wrench(None),
    }
