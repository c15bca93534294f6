"""From a movement to a joint plan: sample, solve, spline, check. The entry of this package."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from pc_client.arrays import Array, read_only
from pc_client.errors import PlanningError
from pc_client.kinematics.arms import ROBOTS
from pc_client.kinematics.model import (
    RobotModel,
    measure_singularity,
    robot_model,
    tcp_jacobian,
    tcp_positions,
)
from pc_client.movements.movement import Movement
from pc_client.movements.samples import JointTrajectory
from pc_client.movements.trajectory import Similarity
from pc_client.planning import checks
from pc_client.planning.checks import CartesianSamples, PlanReport, check_motion, check_samples
from pc_client.planning.joint_path import JointPath, fixed_tcp_rotation, follow_path
from pc_client.planning.joint_spline import JointSpline
from pc_client.planning.limits import PathNames, PlanLimits, limits_of

DEFAULT_DT = 0.004
"""Time between samples of a plan [s]: half a control cycle; the spline between is then good to < 1 um."""


Motion = Movement | JointTrajectory
"""What can be planned: a movement of the TCP, or joint angles over time."""


class PlannableMovement(Protocol):
    """What planning needs of a movement; a `Movement` is one, whose samples and orientations count too."""

    @property
    def name(self) -> str:
        """For messages and file names."""

    @property
    def duration(self) -> float:
        """[s]."""

    def sample(self, t: Array, /) -> tuple[Array, Array]:
        """Return positions (n, 3) [m] and velocities (n, 3) [m/s] at times (n,) in [0, duration]."""


@dataclass(frozen=True, slots=True)
class JointPlan:
    """A checked motion of the joints; its arrays are read-only, since controller, log and report share them.

    Attributes:
        t: (n,) sample times [s].
        p: (n, 3) TCP positions at the samples [m].
        q: (n, 6) joint angles at the samples [rad].
        spline: the reference to follow, through q.
        report: what was checked, and how much room is left.
    """

    name: str
    t: Array = field(repr=False)
    p: Array = field(repr=False)
    q: Array = field(repr=False)
    spline: JointSpline = field(repr=False)
    report: PlanReport = field(repr=False)

    @property
    def start_q(self) -> Array:
        """(6,) joint angles at the start [rad]: where the arm must be before the stream starts."""
        start: Array = self.q[0]
        return start

    @property
    def duration(self) -> float:
        """[s]."""
        return self.spline.duration

    def shifted(self, turns: ArrayLike) -> JointPlan:
        """Return the same motion with whole turns added to the joints.

        The arm is in the same places; only the distance from the ends of the joint ranges changes.

        Args:
            turns: (6,) whole numbers of turns.

        Raises:
            PlanningError: turns that are not whole, or a joint that would come too near the end of its range.
        """
        whole = np.asarray(turns, dtype=np.float64)
        if not np.array_equal(whole, np.rint(whole)):
            raise PlanningError(
                f"{self.name}: a plan can be shifted by whole turns only, not {whole.tolist()}"
            )
        if not whole.any():
            return self
        offset = 2.0 * np.pi * whole
        report = self.report
        q = self.q + offset
        joint_range = checks.measure_joint_range(q, report.joint_limits, report.limits)
        if joint_range.share > 1.0:
            raise PathNames(self.name, self.t, self.p).refuse(
                joint_range.sample,
                f"{np.degrees(joint_range.value):.1f} deg from the end of its range after the shift by"
                f" {whole.tolist()} turns; use other turns",
                joint=joint_range.joint,
            )
        report = replace(
            report, q_min=report.q_min + offset, q_max=report.q_max + offset, joint_range=joint_range
        )
        return replace(self, q=read_only(q), spline=self.spline.shifted(offset), report=report)


@dataclass(frozen=True, slots=True)
class Plan:
    """What an arm shall do, checked against all limits.

    Attributes:
        movement: what the TCP shall do.
        joints: what the joints shall do.
        text: the movement as its file says it; empty for one made of samples.
    """

    movement: Movement
    joints: JointPlan
    text: str

    def __repr__(self) -> str:
        arm = ROBOTS[self.joints.report.robot].title
        return f"<Plan of {self.movement.name!r} for a {arm}: {self.joints.duration:.2f} s>"


def make_plan(motion: Motion, model: RobotModel) -> Plan:
    """Plan what the TCP, or what the joints shall do; one that may be moved where the arm can do it.

    Raises:
        PlanningError: the arm cannot do it.
    """
    if isinstance(motion, JointTrajectory):
        return _plan_joints(motion, model)
    if motion.may_be_moved and (shift := model.description.library_shift).any():
        motion = motion.transformed(Similarity(1.0, np.eye(3), shift))
    return Plan(motion, plan_movement(motion, model=model), motion.text)


def plan_movement(
    movement: PlannableMovement,
    *,
    model: RobotModel | None = None,
    dt: float = DEFAULT_DT,
    limits: PlanLimits | None = None,
    q_branch: ArrayLike | None = None,
) -> JointPlan:
    """Plan a movement of the TCP.

    Args:
        model: nominal arm; a UR3 by default.
        dt: longest time between samples [s]; a little less where the duration is no whole number of steps, or
            the time between two samples of a movement that is given as samples.
        limits: what the plan must keep; by default what belongs to the arm.
        q_branch: (6,) posture whose IK branch is followed [rad]; the arm's preferred one by default.

    Raises:
        PlanningError: the movement cannot be done; names the sample, its time and point, and the joint.
    """
    arm = robot_model() if model is None else model
    limits = limits_of(arm) if limits is None else limits
    knots = movement.knots if isinstance(movement, Movement) else np.array((0.0, movement.duration))
    samples = _sample(movement, _sample_times(movement.name, knots, dt))
    names = PathNames(movement.name, samples.t, samples.p)
    tcp_speed = check_samples(names, samples, limits)
    turned = movement.rotations(samples.t) if isinstance(movement, Movement) else None
    path = follow_path(
        arm, names, fixed_tcp_rotation() if turned is None else turned, q_branch=q_branch, limits=limits
    )
    spline = JointSpline(samples.t, path.q)
    report = check_motion(arm, names, samples, tcp_speed, path, spline, limits)
    return JointPlan(
        movement.name, read_only(samples.t), read_only(samples.p), read_only(path.q), spline, report
    )


def _plan_joints(trajectory: JointTrajectory, model: RobotModel) -> Plan:
    """A clamped cubic spline through joint angles, checked as all plans."""
    limits, name = limits_of(model), trajectory.name
    spline = JointSpline(trajectory.t, trajectory.q)
    t = _sample_times(name, trajectory.t, DEFAULT_DT)
    q, qd = spline.sample(t)
    jacobians = np.array([tcp_jacobian(model, posture) for posture in q])
    p = tcp_positions(model, q)
    v = np.einsum("nij,nj->ni", jacobians[:, :3], qd)
    movement = Movement.from_samples(t, p, name=name)
    samples = CartesianSamples(t, p, v, movement.sample(0.5 * (t[1:] + t[:-1])).p)
    names = PathNames(name, t, p)
    exact = np.zeros(len(t))
    path = JointPath(q, exact, exact, measure_singularity(jacobians, model.description.reach))
    report = check_motion(model, names, samples, check_samples(names, samples, limits), path, spline, limits)
    return Plan(movement, JointPlan(name, read_only(t), read_only(p), read_only(q), spline, report), "")


def _sample_times(name: str, knots: Array, dt: float) -> Array:
    """The times of knots (n,) [s], and equal steps of at most `dt` between each two of them."""
    duration = float(knots[-1])
    if not (np.isfinite(duration) and duration > 0.0):
        raise PlanningError(f"{name}: a movement needs a positive duration in s, not {duration!r}")
    if not (np.isfinite(dt) and dt > 0.0):
        raise PlanningError(f"{name}: the time between samples must be positive in s, not {dt!r}")
    spans = np.diff(knots)
    steps = np.ceil(spans / min(dt, 0.5 * duration) - 1e-9).clip(1).astype(int)
    step = np.arange(steps.sum()) - np.repeat(np.cumsum(steps) - steps, steps)
    return np.append(np.repeat(knots[:-1], steps) + step * np.repeat(spans / steps, steps), duration)


def _sample(movement: PlannableMovement, t: Array) -> CartesianSamples:
    """Sample a movement at times (n,) [s] and half way between, and check the shapes."""
    # One call for the samples and the points between them: every second one is a sample.
    times = np.insert(t, np.arange(1, len(t)), 0.5 * (t[1:] + t[:-1]))
    p, v = (np.asarray(values, dtype=np.float64) for values in movement.sample(times))
    if p.shape != (len(times), 3) or v.shape != (len(times), 3):
        raise PlanningError(
            f"{movement.name}: sample(t) of {len(times)} times must give two arrays of shape"
            f" ({len(times)}, 3), not {p.shape} and {v.shape}"
        )
    return CartesianSamples(t, p[::2].copy(), v[::2].copy(), p[1::2].copy())
