"""PlanningSettings: how programs want their moves to be planned.

Source: URScript manual e-Series 5.22, motion versions, and 5.24, jerk_gain_scaling_set.
"""

from __future__ import annotations

from dataclasses import dataclass

# Accelerations of jerk-limited moves change within this time at a gain of 1 [s]. Chosen.
JERK_TIME = 0.1


@dataclass(slots=True)
class PlanningSettings:
    """Settings that stay until the controller ends.

    Attributes:
        motion_version: 1, or 2: movej and movel are jerk-limited, and their limits are those of the arm.
        jerk_gain: share of the jerk limit, 0.01 to 1.
    """

    motion_version: int = 1
    jerk_gain: float = 1.0

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
