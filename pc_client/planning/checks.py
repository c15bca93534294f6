"""Every limit that a planned motion must keep, checked before anything moves.

All quantities are measured before any is judged, so the report of a good plan and the refusal of a bad one
have the same numbers. Limits are in planning.limits, the arm's own in kinematics.robot_model.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pc_client.kinematics.clearance import Distances, clearance_model
from pc_client.kinematics.forward import tcp_positions
from pc_client.kinematics.robot_model import JointLimits, RobotModel
from pc_client.planning.joint_path import JointPath
from pc_client.planning.joint_spline import JointSpline
from pc_client.planning.limits import PlanLimits
from pc_client.planning.plan_report import Extreme, LeastClearance, PlanReport
from pc_client.planning.refusal import PathNames

Array = NDArray[np.float64]


class CartesianSamples(NamedTuple):
    """The movement as it was sampled for planning.

    Attributes:
        t: (n,) [s].
        p: (n, 3) TCP positions [m].
        v: (n, 3) TCP velocities [m/s].
        p_between: (n - 1, 3) positions half way in time between samples [m].
    """

    t: Array
    p: Array
    v: Array
    p_between: Array


def check_samples(names: PathNames, samples: CartesianSamples, limits: PlanLimits) -> Extreme:
    """Check the movement itself, before any kinematics: finite, slow enough, at rest at both ends.

    Args:
        names: how to name a sample.
        samples: the movement.
        limits: what is allowed.

    Returns:
        The top TCP speed.

    Raises:
        PlanningError: naming the first sample that is wrong.
    """
    for values, what in ((samples.p, "position"), (samples.v, "velocity")):
        bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
        if bad.size:
            raise names.refuse(int(bad[0]), f"the {what} is not finite; correct the movement")
    speed = np.linalg.norm(samples.v, axis=1)
    # A path may jump although its velocities look harmless.
    step_speed = np.linalg.norm(np.diff(samples.p, axis=0), axis=1) / np.diff(samples.t)
    speed[1:] = np.maximum(speed[1:], step_speed)
    top = _highest(speed, limits.tcp_speed_max)
    if top.share > 1.0:
        raise names.refuse(
            _first(speed > limits.tcp_speed_max),
            f"the TCP speed is {top.value:.3f} m/s at its highest, at most {limits.tcp_speed_max:g} m/s is"
            " allowed; give the movement more time or less size",
        )
    for sample, where in ((0, "begins"), (-1, "ends")):
        if (at_rest := float(np.linalg.norm(samples.v[sample]))) > limits.rest_speed_max:
            raise names.refuse(
                sample % len(speed),
                f"the movement {where} at {at_rest:.3f} m/s, at most {limits.rest_speed_max:g} m/s is"
                " allowed; let it begin and end at rest",
            )
    return top


def check_motion(
    model: RobotModel,
    names: PathNames,
    samples: CartesianSamples,
    tcp_speed: Extreme,
    path: JointPath,
    spline: JointSpline,
    limits: PlanLimits,
) -> PlanReport:
    """Measure a planned motion and compare it with its limits.

    Args:
        model: nominal arm.
        names: how to name a sample.
        samples: the movement.
        tcp_speed: what `check_samples` returned.
        path: its joint angles.
        spline: the spline through them.
        limits: what is allowed.

    Returns:
        The figures, all within limits.

    Raises:
        PlanningError: a limit is broken; names the sample where it is broken most, and the joint.
    """
    q, t = path.q, samples.t
    # The speed is highest at a knot or inside an interval; the half-way point is within 1e-3 of the latter.
    t_between = 0.5 * (t[1:] + t[:-1])
    q_between, qd_between = spline.sample(t_between)
    qd = np.abs(spline.sample(t)[1])
    qd[1:] = np.maximum(qd[1:], np.abs(qd_between))
    qdd = np.abs(spline.qdd(t))  # piecewise linear: highest at a knot
    qd_max = limits.speed_fraction * np.array(model.limits.qd_max)
    clearance = clearance_model(model).along(q)
    between_error = np.linalg.norm(tcp_positions(model, q_between) - samples.p_between, axis=1)

    report = PlanReport(
        robot=model.name,
        joint_limits=model.limits,
        limits=limits,
        cell=model.cell,
        duration=spline.duration,
        samples=len(t),
        path_length=float(np.linalg.norm(np.diff(samples.p, axis=0), axis=1).sum()),
        box_min=samples.p.min(axis=0),
        box_max=samples.p.max(axis=0),
        q_min=q.min(axis=0),
        q_max=q.max(axis=0),
        qd_peak=qd.max(axis=0),
        qdd_peak=qdd.max(axis=0),
        tcp_speed=tcp_speed,
        joint_range=measure_joint_range(q, model.limits, limits),
        joint_speed=_highest(qd, qd_max),
        joint_acceleration=_highest(qdd, np.array(limits.qdd_max)),
        sigma_min=_lowest(path.singularity.sigma_min, limits.sigma_min),
        condition_max=_highest(path.singularity.condition, np.inf),
        manipulability_min=_lowest(path.singularity.manipulability, 0.0),
        floor_clearance=_least(clearance.floor, limits.floor_clearance_min),
        own_clearance=_least(clearance.own, limits.own_clearance_min),
        cell_clearance=_least(clearance.cell, limits.cell_clearance_min),
        position_error=_highest(path.position_error, limits.position_error_max),
        rotation_error=_highest(path.rotation_error, limits.rotation_error_max),
        interpolation_error=_highest(between_error, limits.interpolation_error_max),
        ik_iterations=path.iterations / len(t),
    )
    _judge(names, report)
    return report


def measure_joint_range(q: Array, joint_limits: JointLimits, limits: PlanLimits) -> Extreme:
    """Return the least distance of a joint path (n, 6) from its ranges' ends; share > 1 is too near."""
    left = np.minimum(q - np.array(joint_limits.q_min), np.array(joint_limits.q_max) - q)
    return _lowest(left, limits.position_margin)


def _judge(names: PathNames, report: PlanReport) -> None:
    """Raise for the first quantity of a report that breaks its limit."""
    limits = report.limits
    reach, speed, acceleration = report.joint_range, report.joint_speed, report.joint_acceleration
    spline = report.interpolation_error
    floor, own, cell = report.floor_clearance, report.own_clearance, report.cell_clearance
    for extreme, what in (
        (
            reach,
            f"{np.degrees(reach.value):.1f} deg from the end of its range, at least"
            f" {np.degrees(limits.position_margin):.1f} deg is asked; choose another branch or turn",
        ),
        (floor.extreme, f"{floor.says}; raise the movement"),
        (own.extreme, f"{own.says}; move the movement away from the base"),
        (cell.extreme, f"{cell.says}; move the movement, or correct the cell file"),
        (
            speed,
            f"speed {speed.value:.2f} rad/s, at most {speed.limit:.2f} rad/s is allowed"
            f" ({limits.speed_fraction * 100:.0f} % of the arm's limit); give the movement more time",
        ),
        (
            acceleration,
            f"acceleration {acceleration.value:.1f} rad/s², at most"
            f" {acceleration.limit:.0f} rad/s² is allowed;"
            " give the movement more time or smoother corners",
        ),
        (
            spline,
            f"the joint spline leaves the movement by {spline.value * 1e3:.3f} mm, at most"
            f" {limits.interpolation_error_max * 1e3:g} mm is allowed; sample it finer",
        ),
    ):
        if extreme.share > 1.0:
            raise names.refuse(extreme.sample, what, joint=extreme.joint)


def _least(distances: Distances, limit: float) -> LeastClearance:
    """Return where bodies come nearest, relative to the distance that must be kept."""
    extreme = _lowest(distances.least, limit)
    if not distances.nearest:
        return LeastClearance(extreme, None)
    nearest = distances.nearest[extreme.sample]
    return LeastClearance(extreme._replace(joint=nearest.joint), nearest)


def _highest(values: Array, limit: Array | float) -> Extreme:
    """Return where values (n,) or (n, 6) come highest relative to their limit."""
    share = values / limit
    index = np.unravel_index(int(share.argmax()), share.shape)
    joint = int(index[1]) if values.ndim == 2 else None
    at_joint = limit if isinstance(limit, float) else float(limit[joint])
    return Extreme(float(values[index]), int(index[0]), joint, at_joint, float(share[index]))


def _lowest(values: Array, limit: float) -> Extreme:
    """Return where values (n,) or (n, 6) that must stay above `limit` come lowest."""
    index = np.unravel_index(int(values.argmin()), values.shape)
    joint = int(index[1]) if values.ndim == 2 else None
    lowest = float(values[index])
    return Extreme(lowest, int(index[0]), joint, limit, limit / lowest if lowest > 0.0 else np.inf)


def _first(mask: NDArray[np.bool_]) -> int:
    return int(mask.argmax())
