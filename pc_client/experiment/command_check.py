"""The check of a whole run of commands that no plan contains: what was learned, before it is sent.

The limits are those that the plan itself was held against, and the controller's own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pc_client.control.controller import Controller
from pc_client.kinematics.clearance import clearance_model
from pc_client.kinematics.robot_model import RobotModel
from pc_client.planning.checks import measure_joint_range
from pc_client.planning.plan import JointPlan

Array = NDArray[np.float64]

_LEARNED_DISPLACEMENT = 0.05
"""What was learned may lead a joint this far [rad]."""

_CLEARANCE_STEP = 4
"""Every so many cycles the arm's clearance is measured: 32 ms, in which it moves by less than a margin."""


def broken_limit(
    plan: JointPlan,
    commands: Array,
    learned: Array | None,
    model: RobotModel,
    config: Controller,
    period: float,
) -> str:
    """Name the first limit that a whole run of commands breaks.

    Args:
        plan: where the run begins, and the limits.
        commands: (n, 6) feed-forward of all cycles [rad/s].
        learned: (m, 6) the part of it that was learned from the run before [rad/s], or None.
        model: the nominal arm.
        config: its shares of the limits.
        period: control cycle [s].

    Returns:
        One phrase; empty when all limits are kept.
    """
    limits = plan.report.limits
    q_sent = plan.start_q + np.cumsum(commands, axis=0) * period
    acceleration = np.abs(np.diff(commands, axis=0)) / period
    learned_displacement = np.zeros(1) if learned is None else np.abs(np.cumsum(learned, axis=0)) * period
    motion = {
        "joint speed": np.abs(commands) / (config.speed_share * np.array(model.limits.qd_max)),
        "joint acceleration": acceleration / np.minimum(limits.qdd_max, config.slew_limit),
        "learned displacement": learned_displacement / _LEARNED_DISPLACEMENT,
        "joint range": np.array(measure_joint_range(q_sent, model.limits, limits).share),
    }
    for what, share in motion.items():
        # What is no number must not come to the clearance.
        if not (most := float(np.max(share))) <= 1.0:
            return f"{what} would be {most:.0%} of what is allowed"
    clearance = clearance_model(model).along(q_sent)
    for what, distances, needed in (
        ("itself", clearance.own, limits.own_clearance_min),
        ("the floor", clearance.floor, limits.floor_clearance_min),
        ("the cell", clearance.cell, limits.cell_clearance_min),
    ):
        if not (least := float(np.min(distances.least))) >= needed:
            return f"the arm would come within {1e3 * least:.0f} mm of {what}, asked: {1e3 * needed:.0f} mm"
    return ""
