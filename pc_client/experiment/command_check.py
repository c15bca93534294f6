"""The checks of motions that no plan contains: what was learned, the excitation, a velocity law.

The limits are those that plans are held against, and the controller's own.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pc_client.control.controller import Controller
from pc_client.driver.receiver import STOP_DECELERATION
from pc_client.kinematics.clearance import ClearanceModel, clearance_model
from pc_client.kinematics.robot_model import RobotModel
from pc_client.planning.limits import PlanLimits
from pc_client.planning.plan import JointPlan
from protocol.ur_types import JOINT_NAMES

Array = NDArray[np.float64]

_LEARNED_DISPLACEMENT = 0.05
"""What was learned may lead a joint this far [rad]."""

_CLEARANCE_STEP = 4
"""Every so many cycles the arm's clearance is measured: 32 ms, in which it moves by less than a margin."""

_REACTION = 0.1
"""From a frame to the start of the robot's ramp [s]: the loop's delay, and the robot's patience with us."""

_N_ALONG_STOP = 8
"""Postures at which the way to rest is checked; it advances by their distance in less than the reaction."""


def posture_complaint(bodies: ClearanceModel, limits: PlanLimits, q: Array) -> str:
    """Name the first joint range or clearance that one of the postures (n, 6) [rad] breaks; empty: none."""
    arm, margin = bodies.robot.limits, limits.position_margin
    left = np.minimum(q - np.array(arm.q_min), np.array(arm.q_max) - q)
    k, joint = divmod(int(left.argmin()), 6)
    if not left[k, joint] >= margin:  # nor what is no number, which must not come to the clearance
        return (
            f"{JOINT_NAMES[joint]} comes to {math.degrees(q[k, joint]):.0f} deg, at least "
            f"{math.degrees(margin):.1f} deg from the end of its range is asked"
        )
    clearance = bodies.along(q)
    for distances, least in (
        (clearance.floor, limits.floor_clearance_min),
        (clearance.own, limits.own_clearance_min),
        (clearance.cell, limits.cell_clearance_min),
    ):
        k = int(distances.least.argmin())
        if not (distance := float(distances.least[k])) >= least:
            return distances.nearest[k].says(distance, least)
    return ""


def way_to_rest(model: RobotModel, q: Array, qd: Array) -> Array:
    """Postures through which an arm comes to rest when it is stopped, [rad].

    After the reaction the joint that needs longest brakes as the arm can, the others in proportion: a
    straight line in joint space.

    Args:
        model: nominal arm; its deceleration is its limit of acceleration, or that of the robot's program.
        q: (6,) or (n, 6) postures when the stop is decided [rad].
        qd: velocities there, of the same shape [rad/s].

    Returns:
        (m, 6), the given postures among them.
    """
    deceleration = np.minimum(STOP_DECELERATION, model.limits.qdd_max)
    ramp = np.max(np.abs(qd) / deceleration, axis=-1, keepdims=True)
    way = (_REACTION + 0.5 * ramp) * qd
    along = np.linspace(0.0, 1.0, _N_ALONG_STOP)[:, None, None]
    postures: Array = (q + along * way).reshape(-1, 6)
    return postures


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
    }
    for what, share in motion.items():
        if not (most := float(np.max(share))) <= 1.0:
            return f"{what} would be {most:.0%} of what is allowed"
    return posture_complaint(clearance_model(model), limits, q_sent)
