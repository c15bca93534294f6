"""PlanningSettings: how programs want their moves to be planned.

Source: URScript manual e-Series 5.22, motion versions, 5.24, jerk_gain_scaling_set, and 5.19,
tool_wrench_limit_set.
"""

from __future__ import annotations

from dataclasses import dataclass

from ur_emulator.models.robot_model import Vector6

# Accelerations of jerk-limited moves change within this time at a gain of 1 [s]. Chosen.
JERK_TIME = 0.1


@dataclass(frozen=True, slots=True)
class ToolWrenchLimit:
    """Greatest wrench that motion may cause on the payload.

    Attributes:
        frame: pose in the flange frame.
        most: magnitudes along and about its axes [N, Nm]; infinite: not limited.
    """

    frame: Vector6
    most: Vector6


@dataclass(slots=True)
class PlanningSettings:
    """Settings that stay until the controller ends.

    Attributes:
        motion_version: 1, or 2: movej and movel are jerk-limited, and their limits are those of the arm.
        jerk_gain: share of the jerk limit, 0.01 to 1.
        tool_wrench_limit: None if there is none.
    """

    motion_version: int = 1
    jerk_gain: float = 1.0
    tool_wrench_limit: ToolWrenchLimit | None = None

    @property
    def smoothing(self) -> float:
        """Time in which the acceleration of a jerk-limited move changes [s]."""
        return JERK_TIME / self.jerk_gain

    def set_motion_version(self, version: int) -> None:
        """Set the version: 1 or 2."""
        self.motion_version = version

    def set_jerk_gain(self, gain: float) -> None:
        """Set the share of the jerk limit, 0.01 to 1."""
        self.jerk_gain = gain

    def limit_tool_wrench(self, limit: ToolWrenchLimit | None) -> None:
        """Limit the wrench of the payload in moves from now on, or remove the limit."""
        self.tool_wrench_limit = limit
