"""Every limit that a planned motion must keep, checked before anything moves; the figures as a report.

All quantities are measured before any is judged, so the report of a good plan and the refusal of a bad one
have the same numbers. Limits are in `planning.limits`, the arm's own in `kinematics.arms`.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pc_client.arrays import Array
from pc_client.kinematics.arms import JointLimits
from pc_client.kinematics.clearance import Clearance, Distances, Nearest, clearance_model
from pc_client.kinematics.model import RobotModel, tcp_positions
from pc_client.planning.joint_path import JointPath
from pc_client.planning.joint_spline import JointSpline
from pc_client.planning.limits import PathNames, PlanLimits
from protocol.ur_types import JOINT_NAMES
from ur_hil.cell import Cell


class Extreme(NamedTuple):
    """The worst value of a quantity along a path.

    Attributes:
        value: in the unit of the quantity.
        sample: index of the sample where it occurs (the nearest one, when it occurs between two).
        joint: index 0..5 of the joint it belongs to, or None.
        limit: what the value is held against, at that joint.
        share: `value` over its limit (of a quantity to keep low) or limit over `value` (of one to keep high).
    """

    value: float
    sample: int
    joint: int | None
    limit: float
    share: float

    @property
    def joint_name(self) -> str:
        """Of the joint; empty without one."""
        return "" if self.joint is None else JOINT_NAMES[self.joint]


class LeastClearance(NamedTuple):
    """How near bodies come along a path.

    Attributes:
        extreme: the distance [m], held against the one that must be kept.
        nearest: which bodies these are; None where there are none.
    """

    extreme: Extreme
    nearest: Nearest | None

    @property
    def says(self) -> str:
        """The refusal of what comes too near; empty where there is nothing."""
        return "" if self.nearest is None else self.nearest.says(self.extreme.value, self.extreme.limit)

    @property
    def text(self) -> str:
        """Distance and bodies, e.g. `31 mm, forearm from box 'press'`; empty where there is nothing."""
        if self.nearest is None:
            return ""
        return f"{self.extreme.value * 1e3:.0f} mm, {self.nearest.first} from {self.nearest.second}"


@dataclass(frozen=True, slots=True)
class PlanReport:
    """Figures of a plan, all in SI.

    Attributes:
        path_length: length of the TCP path [m].
        box_min: (3,) lower corner of the box that the TCP stays in [m].
        box_max: (3,) upper corner [m].
        q_min: (6,) lowest joint angles [rad].
        q_max: (6,) highest joint angles [rad].
        qd_peak: (6,) top joint speeds [rad/s].
        qdd_peak: (6,) top joint accelerations [rad/s²].
        tcp_speed: top TCP speed [m/s].
        joint_range: least distance of a joint from an end of its range [rad].
        joint_speed: top joint speed relative to its limit [rad/s].
        joint_acceleration: top joint acceleration relative to its limit [rad/s²].
        sigma_min: least smallest singular value of the Jacobian.
        condition_max: largest condition number.
        clearance: how near bodies come.
        position_error: largest error of the inverse kinematics [m].
        rotation_error: the same for the orientation [rad].
        interpolation_error: largest distance of the spline from the movement half way between samples [m].
    """

    robot: str
    joint_limits: JointLimits
    limits: PlanLimits
    cell: Cell
    duration: float
    samples: int
    path_length: float
    box_min: Array
    box_max: Array
    q_min: Array
    q_max: Array
    qd_peak: Array
    qdd_peak: Array
    tcp_speed: Extreme
    joint_range: Extreme
    joint_speed: Extreme
    joint_acceleration: Extreme
    sigma_min: Extreme
    condition_max: Extreme
    clearance: Clearance[LeastClearance]
    position_error: Extreme
    rotation_error: Extreme
    interpolation_error: Extreme

    def lines(self) -> tuple[str, ...]:
        """Return the figures that matter to someone who stands beside the arm, one a line."""
        size = (self.box_max - self.box_min) * 1e3
        speed, acceleration, margin = self.joint_speed, self.joint_acceleration, self.joint_range
        return (
            f"box of motion   x {_span(self, 0)}  y {_span(self, 1)}  z {_span(self, 2)} m"
            f"  ({size[0]:.0f} x {size[1]:.0f} x {size[2]:.0f} mm)",
            f"duration        {self.duration:.2f} s, path {self.path_length:.3f} m",
            f"top TCP speed   {self.tcp_speed.value:.3f} m/s ({_percent(self.tcp_speed)} of the"
            f" {self.limits.tcp_speed_max:g} m/s allowed)",
            f"top joint speed {np.degrees(speed.value):.0f} deg/s, {speed.joint_name}"
            f" ({_percent(speed)} of what is allowed)",
            f"top joint accel {np.degrees(acceleration.value):.0f} deg/s², {acceleration.joint_name}"
            f" ({_percent(acceleration)} of what is allowed)",
            f"joint range     nearest to its end: {margin.joint_name},"
            f" {np.degrees(margin.value):.0f} deg away",
            f"singularity     smallest singular value {self.sigma_min.value:.3f}"
            f" (at least {self.limits.sigma_min:g}), condition number up to {self.condition_max.value:.0f}",
            f"cell            {self.cell.summary}",
            f"clearance       {'; '.join(least.text for least in self.clearance if least.text)}",
            f"accuracy        inverse kinematics {self.position_error.value:.1e} m,"
            f" spline {self.interpolation_error.value * 1e6:.2f} um",
        )


def _span(report: PlanReport, axis: int) -> str:
    return f"{report.box_min[axis]:.3f}..{report.box_max[axis]:.3f}"


def _percent(extreme: Extreme) -> str:
    return f"{extreme.share * 100:.0f} %"


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

    It returns the top TCP speed.

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
            int((speed > limits.tcp_speed_max).argmax()),
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
        tcp_speed: what `check_samples` returned.

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
    distances = clearance_model(model).along(q)
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
        clearance=Clearance(*map(_least, distances, limits.clearance_min)),
        position_error=_highest(path.position_error, limits.position_error_max),
        rotation_error=_highest(path.rotation_error, limits.rotation_error_max),
        interpolation_error=_highest(between_error, limits.interpolation_error_max),
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
    floor, own, cell = report.clearance
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
