"""The checks of motions beside those of a plan, before anything is sent.

What was learned, the excitation and a velocity law are in no plan: they are held against the limits of plans
and the controller's own. What the loop makes of a plan is predicted: the tool's largest deviation from its
path. The guard of a run allows this deviation and a margin. A plan that the controller would leave further
than its tolerances allow is refused.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pc_client.analysis.measures import snr_db, speed
from pc_client.arrays import Array
from pc_client.control.controller import CONTROLLERS, DEFAULT, Controller
from pc_client.control.loop import LEAST_GAIN_MARGIN, SAMPLING_TIME, loop_margins
from pc_client.control.reference import LEAD, JointReference, ReferenceTable, RunRecipe
from pc_client.control.tracker import ToolGuard, predict_run
from pc_client.driver.receiver import STOP_DECELERATION
from pc_client.errors import DriverError
from pc_client.kinematics.clearance import ClearanceModel, clearance_model
from pc_client.kinematics.model import RobotModel, tcp_positions
from pc_client.planning.joint_spline import JointSpline
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
    for distances, least in zip(bodies.along(q), limits.clearance_min, strict=True):
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


def broken_limit(plan: JointPlan, commands: Array, recipe: RunRecipe, model: RobotModel) -> str:
    """Name the first limit that a whole run of commands breaks; empty when all limits are kept.

    Args:
        plan: where the run begins, and the limits.
        commands: (n, 6) feed-forward of all cycles [rad/s].
        recipe: what of it was learned, and the controller's shares of the limits.
    """
    config, period, learned = recipe.controller, recipe.period, recipe.learned
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


_PATH_MARGIN, _ANGLE_MARGIN = 0.005, 0.035
"""What the guard allows beside the prediction [m, rad]: gears, friction and encoders come to .4 mm on the
worst emulated arms, a push of 200 N at the flange to more than the margin."""

_RESERVE = 1.2
"""Factor between a prediction and what must be allowed: no run ends because the prediction is not exact."""

_LEAST_SNR = 15.0
"""A person is warned below this [dB], a hair under the worst of the paper's Table I (15.96)."""

_MOST_SNR = 45.0
"""No arm comes to more [dB]: encoders and gears are not in a prediction."""

_SLOWER = (1.1, 1.2, 1.3, 1.5, 2.0, 3.0, 5.0)
"""Factors of duration that a refusal may name."""


class Prediction(NamedTuple):
    """What the loop makes of a movement on an ideal arm.

    Attributes:
        q: (n, 6) where the joints go [rad].
        distance: how far the tool is off its path at most [m].
        angle: likewise its orientation [rad].
        snr_db: Eq. 10, at most `_MOST_SNR`.
        doubt: one line, if that is little: why, and what would do.
    """

    q: Array
    distance: float
    angle: float
    snr_db: float
    doubt: str = ""

    def fits(self, config: Controller) -> bool:
        """Whether the tolerances of a controller allow this."""
        path, angle = config.path_tolerance, config.angle_tolerance
        return _RESERVE * self.distance <= path and _RESERVE * self.angle <= angle

    def follows(self, config: Controller) -> bool:
        """Whether it also follows the speed of the movement."""
        return self.fits(config) and self.snr_db >= _LEAST_SNR


def guarded(plan: JointPlan, recipe: RunRecipe, model: RobotModel) -> tuple[RunRecipe, Prediction | None]:
    """The recipe with the tolerances of one movement, and what the loop makes of it.

    The tolerances are the prediction and a margin, at most those of the controller. Of one that would
    oscillate there is no prediction.

    Raises:
        DriverError: the prediction is beyond the tolerances, or leads too near to floor, arm or cell.
    """
    own = recipe.controller
    if not loop_margins(recipe.loop, own.gain_p, own.gain_i, recipe.period).gain >= LEAST_GAIN_MARGIN:
        return recipe, None  # `identify` refuses such a controller, with its margin
    predicted = predict(plan.spline, recipe, model)
    complaint = ""
    if not predicted.fits(own):
        complaint = (
            f"allowed is {1e3 * own.path_tolerance:g} mm (path_tolerance) and "
            f"{math.degrees(own.angle_tolerance):.1f} deg (angle_tolerance), a sixth of it kept in reserve"
        )
    elif predicted.distance > _PATH_MARGIN:  # below it the clearances of the plan have room
        complaint = posture_complaint(clearance_model(model), plan.report.limits, predicted.q)
    if complaint:
        raise DriverError(
            f"{plan.name}: the controller {own.title!r} would lead the tool "
            f"{1e3 * predicted.distance:.1f} mm and {math.degrees(predicted.angle):.1f} deg off its path, "
            f"{complaint}: {_remedy(plan, recipe, model, Prediction.fits)}"
        )
    if not predicted.follows(own):
        doubt = (
            f"{plan.name}: the controller {own.title!r} is expected to reach an SNR of "
            f"{predicted.snr_db:.1f} dB at best on a loop of {1e3 * recipe.loop.delay:.0f} ms, "
            f"one that follows has {_LEAST_SNR:g} dB or more "
            f"(speedj_acceleration is {own.speedj_acceleration:g} rad/s2, the plan has "
            f"{plan.report.qdd_peak.max():.1f}): {_remedy(plan, recipe, model, Prediction.follows)}"
        )
        predicted = predicted._replace(doubt=doubt)
    tight = replace(
        own,
        path_tolerance=min(predicted.distance + _PATH_MARGIN, own.path_tolerance),
        angle_tolerance=min(predicted.angle + _ANGLE_MARGIN, own.angle_tolerance),
    )
    return replace(recipe, controller=tight), predicted


def predict(joints: JointReference, recipe: RunRecipe, model: RobotModel) -> Prediction:
    """Predict a run of a joint motion by the recipe."""
    table = ReferenceTable(joints, recipe)
    config, period = recipe.controller, recipe.period
    guard = ToolGuard(table, model, config.path_tolerance, config.angle_tolerance)
    q = predict_run(recipe, table, model)
    cycles = np.arange(0, len(q), round(SAMPLING_TIME / period))
    t = (cycles * period - LEAD).astype(np.float64)
    off = np.array([guard.deviation(at, q[k].tolist()) for at, k in zip(t, cycles, strict=True)])
    distance, angle = off.max(axis=0).tolist()
    moving = (t > -0.5e-6) & (t < joints.duration + 0.5e-6)
    reference: Array = np.array([table.at(at).q_array for at in t[moving]])
    speeds = (speed(t[moving], tcp_positions(model, postures)) for postures in (reference, q[cycles[moving]]))
    return Prediction(q, distance, angle, min(snr_db(*speeds), _MOST_SNR))


def _remedy(
    plan: JointPlan, recipe: RunRecipe, model: RobotModel, will_do: Callable[[Prediction, Controller], bool]
) -> str:
    """What would do: more time for the movement, or the default controller."""

    def does(joints: JointReference, config: Controller) -> bool:
        return will_do(predict(joints, replace(recipe, controller=config), model), config)

    own, other = recipe.controller, CONTROLLERS[DEFAULT]
    ways = []
    slower = (x for x in _SLOWER if does(JointSpline(x * plan.spline.t_knots, plan.spline.q_knots), own))
    if factor := next(slower, None):
        ways.append(f"give the movement {factor:g} times its duration")
    if own.name != other.name and does(plan.spline, other):
        ways.append(f"use the controller {other.name!r}")
    return " or ".join(ways) or "give the movement more time or less size"
