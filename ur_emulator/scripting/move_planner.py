"""MovePlanner: the limits of moves that the controller plans by what the arm can do.

Source: URScript manual e-Series 5.2x: optimovej and optimovel take shares of the greatest acceleration and
speed along the path and are jerk-limited; so are movej and movel of motion version 2, whose limits are not
above what the arm can do. Chosen: what the drives can give from rest by the controller's model, at points of
the path; the form of the ramps; a move with a blend at its end keeps the ramps of version 1.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf

from ur_emulator.controller.arm_dynamics import ArmDynamics
from ur_emulator.controller.planning import PlanningSettings
from ur_emulator.controller.tool_settings import ToolSettings
from ur_emulator.motion.leg import Leg
from ur_emulator.motion.tool import UnreachableError
from ur_emulator.scripting.tool_wrench import gentle

# Points of a path where the arm is asked.
_POINTS = 9
# Share of the rated speed that the fastest joint has at a share of 1: rounding does not exceed the limit.
_TOP_SHARE = 0.99


class MovePlanner:
    """Plans moves of one arm."""

    def __init__(self, dynamics: ArmDynamics, planning: PlanningSettings, tool: ToolSettings) -> None:
        self._dynamics = dynamics
        self._planning = planning
        self._tool = tool

    def limited(self, leg: Leg) -> Leg:
        """Return a move that keeps the limit of the tool's wrench."""
        limit = self._planning.tool_wrench_limit
        return leg if limit is None else gentle(leg, limit, self._tool.payload)

    def usual(self, leg: Leg) -> Leg:
        """Return a move of movej or movel in the motion version that is set."""
        leg = self.limited(leg)
        if self._planning.motion_version == 1:
            return leg
        a, v = self._greatest(leg)
        return self._smooth(replace(leg, a=min(leg.a, a), v=min(leg.v, v)))

    def optimal(self, leg: Leg, a_share: float, v_share: float) -> Leg:
        """Return a move with shares of the greatest acceleration and speed along its path."""
        a, v = self._greatest(leg)
        return self._smooth(self.limited(replace(leg, a=a_share * a, v=v_share * v)))

    def _smooth(self, leg: Leg) -> Leg:
        if leg.r > 0.0:
            return leg
        window = self._planning.smoothing
        if leg.t > 0.0:
            window = min(window, 0.5 * leg.t)
            return replace(leg, t=leg.t - window, smoothing=window)
        return replace(leg, smoothing=window)

    def _greatest(self, leg: Leg) -> tuple[float, float]:
        """Return the greatest acceleration and speed along a path [unit/s^2, unit/s]."""
        a = v = inf
        robot = leg.tool.arm.robot
        if leg.path.length > 0.0:
            for k in range(_POINTS):
                s = leg.path.length * k / (_POINTS - 1)
                try:
                    q, slope = leg.path.at(s, leg.near(s))
                except UnreachableError:
                    break  # the move itself ends there
                a = min(a, self._dynamics.greatest_acceleration(q, slope))
                for most, rate in zip(robot.qd_max, slope, strict=True):
                    v = min(v, _TOP_SHARE * most / abs(rate)) if rate else v
        return (a, v) if a < inf else (leg.a, leg.v)
