"""Builtins that say how moves shall be planned."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ur_emulator.controller.planning import PlanningSettings


def planning_functions(planning: PlanningSettings) -> Mapping[str, Callable[..., Any]]:
    """Return the builtins of motion version and jerk limit."""
    return {
        "motion_version_set": lambda thread, version: planning.set_motion_version(int(version)),
        "motion_version_get": lambda thread: planning.motion_version,
        "jerk_gain_scaling_set": lambda thread, gain: planning.set_jerk_gain(float(gain)),
        "jerk_gain_scaling_get": lambda thread: planning.jerk_gain,
    }
