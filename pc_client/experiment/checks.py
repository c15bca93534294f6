"""The checks of motions beside those of a plan, before anything is sent.

What was learned, the excitation and a velocity law are in no plan: they are held against the limits of plans
and the controller's own. What the loop makes of a plan is predicted: the tool's largest deviation from its
path. The guard of a run allows this deviation and a margin. A plan that the controller would leave further
than its tolerances allow is refused.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pc_client.arrays import Array
from pc_client.control.controller import CONTROLLERS, DEFAULT, Controller
from pc_client.control.loop import LEAST_GAIN_MARGIN, SAMPLING_TIME, LoopModel, loop_margins
from pc_client.control.reference import JointReference, ReferenceTable
from pc_client.control.tracker import ToolGuard, predict_run
from pc_client.driver.receiver import STOP_DECELERATION
from pc_client.errors import DriverError
from pc_client.kinematics.clearance import ClearanceModel, clearance_model
from pc_client.kinematics.model import RobotModel
from pc_client.planning.limits import PlanLimits
from pc_client.planning.plan import JointPlan
from protocol.ur_types import JOINT_NAMES

_LEARNED_DISPLACEMENT = 0.05
"""What was learned may lead a joint this far [rad]."""

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
    for distances, least in zip(bodies.along(q), limits.clearances_min, strict=True):
        k = int(distances.least.argmin())
        if not (distance := float(distances.least[k])) >= least:
            return distances.nearest[k].says(distance, least)
    return ""


def way_to_rest(model: RobotModel, q: Array, qd: Array) -> Array:
    """Postures (m, 6) [rad] through which an arm comes to rest when it is stopped, the given ones among them.

    After the reaction the joint that needs longest brakes as the arm can, the others in proportion: a
    straight line in joint space.

    Args:
        model: nominal arm; its deceleration is its limit of acceleration, or that of the robot's program.
        q: (6,) or (n, 6) postures when the stop is decided [rad].
        qd: velocities there, of the same shape [rad/s].
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
    """Name the first limit that a whole run of commands breaks; empty when all limits are kept.

    Args:
        plan: where the run begins, and the limits.
        commands: (n, 6) feed-forward of all cycles [rad/s].
        learned: (m, 6) the part of it that was learned from the run before [rad/s], or None.
        config: its shares of the limits.
        period: control cycle [s].
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


LEAD = 0.2
"""Time at rest before a movement, position loop closed [s]: takes up what the approach left."""

SETTLE = 0.3
"""Time at rest after it, position loop closed [s]."""

_PATH_MARGIN, _ANGLE_MARGIN = 0.005, 0.035
"""What the guard allows beside the prediction [m, rad]: gears, friction and encoders come to .4 mm on the
worst emulated arms, a push of 200 N at the flange to more than the margin."""

_RESERVE = 1.2
"""Factor between a prediction and what must be allowed: no run ends because the prediction is not exact."""

_SLOWER = (1.1, 1.2, 1.3, 1.5, 2.0, 3.0, 5.0)
"""Factors of duration that a refusal may name."""


def shortest_loop(period: float) -> LoopModel:
    """The shortest loop of a robot: one cycle [s] until a command acts, one until the feedback shows it."""
    return LoopModel.of_delay(2.0 * period, 0.0)


def guarded(
    plan: JointPlan, config: Controller, model: RobotModel, loop: LoopModel, period: float
) -> Controller:
    """The controller with the tolerances of one movement: what the loop predicts, and a margin.

    Its own tolerances are the largest that are allowed. The loop is the identified one, or the shortest.

    Raises:
        DriverError: the prediction is beyond the tolerances, or leads too near to floor, arm or cell.
    """
    if not loop_margins(loop, config.gain_p, config.gain_i, period).gain >= LEAST_GAIN_MARGIN:
        return config  # `identify` refuses such a controller, with its margin
    predicted = _predict(plan.spline, config, model, loop, period)
    complaint = ""
    if not predicted.fits(config):
        complaint = (
            f"allowed is {1e3 * config.path_tolerance:g} mm (path_tolerance) and "
            f"{math.degrees(config.angle_tolerance):.1f} deg (angle_tolerance), a sixth of it kept in reserve"
        )
    elif predicted.distance > _PATH_MARGIN:  # below it the clearances of the plan have room
        complaint = posture_complaint(clearance_model(model), plan.report.limits, predicted.q)
    if complaint:
        raise DriverError(
            f"{plan.name}: the controller {config.title!r} would lead the tool "
            f"{1e3 * predicted.distance:.1f} mm and {math.degrees(predicted.angle):.1f} deg off its path, "
            f"{complaint}: {_remedy(plan, config, model, loop, period)}"
        )
    return replace(
        config,
        path_tolerance=min(predicted.distance + _PATH_MARGIN, config.path_tolerance),
        angle_tolerance=min(predicted.angle + _ANGLE_MARGIN, config.angle_tolerance),
    )


class _Prediction(NamedTuple):
    """Where the joints go, (n, 6) [rad], and how far the tool is off its path at most [m, rad]."""

    q: Array
    distance: float
    angle: float

    def fits(self, config: Controller) -> bool:
        """Whether the tolerances of a controller allow this."""
        path, angle = config.path_tolerance, config.angle_tolerance
        return _RESERVE * self.distance <= path and _RESERVE * self.angle <= angle


class _Slower(NamedTuple):
    """A joint reference that takes `factor` times as long."""

    reference: JointReference
    factor: float

    @property
    def duration(self) -> float:
        return self.factor * self.reference.duration

    def at(self, t: float) -> tuple[Array, Array]:
        q, qd = self.reference.at(t / self.factor)
        return np.asarray(q), np.asarray(qd) / self.factor


def _predict(
    joints: JointReference, config: Controller, model: RobotModel, loop: LoopModel, period: float
) -> _Prediction:
    lookahead = loop.dead_time if config.compensates_lag else loop.delay
    table = ReferenceTable(
        joints,
        period=period,
        lead=LEAD,
        settle=SETTLE,
        lookahead=lookahead if config.uses_preview else None,
        lag=loop.lag if config.compensates_lag else 0.0,
    )
    guard = ToolGuard(table, model, config.path_tolerance, config.angle_tolerance)
    q = predict_run(table, config, model, loop)
    sampled = range(0, len(q), round(SAMPLING_TIME / period))
    off = np.array([guard.deviation(k * period - LEAD, q[k].tolist()) for k in sampled])
    distance, angle = off.max(axis=0).tolist()
    return _Prediction(q, distance, angle)


def _remedy(plan: JointPlan, config: Controller, model: RobotModel, loop: LoopModel, period: float) -> str:
    """What would do: more time for the movement, or the default controller."""
    slower = (
        factor
        for factor in _SLOWER
        if _predict(_Slower(plan.spline, factor), config, model, loop, period).fits(config)
    )
    other = CONTROLLERS[DEFAULT]
    ways = []
    if factor := next(slower, None):
        ways.append(f"give the movement {factor:g} times its duration")
    if config.name != other.name and _predict(plan.spline, other, model, loop, period).fits(other):
        ways.append(f"use the controller {other.name!r}")
    return " or ".join(ways) or "give the movement more time or less size"
