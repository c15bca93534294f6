"""A plan in words, for the person who confirms it."""

from __future__ import annotations

import numpy as np

from pc_client.planning.approach import Approach
from pc_client.planning.plan import JointPlan
from protocol.ur_types import JOINT_NAMES


def plan_text(plan: JointPlan) -> str:
    """Return the plan as a few lines: box of motion, top speeds, duration, margins, start posture."""
    title = f"{plan.name} on a {plan.report.robot} (nominal kinematics, TCP at the flange)"
    return "\n".join(
        (title, *(f"  {line}" for line in plan.report.lines()), f"  start posture   {_degrees(plan.start_q)}")
    )


def approach_text(approach: Approach) -> str:
    """Return the approach to the start as a few lines."""
    names = ", ".join(JOINT_NAMES)
    title = (
        f"first, slowly (at most {np.degrees(approach.v):.0f} deg/s, about {approach.duration:.1f} s,"
        f" {_clear(approach)}), joints {names}:"
    )
    lines = (f"  from            {_degrees(approach.q_from)}",)
    return "\n".join(
        (title, *lines, *(f"  to              {_degrees(waypoint)}" for waypoint in approach.waypoints))
    )


def _clear(approach: Approach) -> str:
    floor = f"{approach.floor_clearance * 1e3:.0f} mm clear of the floor"
    if not np.isfinite(approach.cell_clearance):
        return floor
    return f"{floor}, {approach.cell_clearance * 1e3:.0f} mm of walls and solids of the cell"


def _degrees(q: np.typing.NDArray[np.float64]) -> str:
    return "(" + ", ".join(f"{angle:.1f}" for angle in np.degrees(q)) + ") deg"
