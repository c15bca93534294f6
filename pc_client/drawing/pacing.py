"""How slow a drawing must be for an arm: one factor for all of it; only pen-up moves may become longer.

Slowed down by a factor a, on the same path, joint speeds fall by a and joint accelerations by a^2; so one
plan gives the factor that each moment needs. Marks come first: they are what is drawn. A pen-up move
that would need a larger factor than they do gets more time instead, and the marks behind it come later. The
factor itself is then found by bisection, by the checks of planning.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pc_client.drawing.joining import Joined, join
from pc_client.drawing.marks import Mark
from pc_client.errors import PlanningError
from pc_client.kinematics.robot_model import RobotModel
from pc_client.planning.limits import limits_of
from pc_client.planning.plan import JointPlan, PlannableMovement, plan_movement

__all__ = ["ACCURACY", "StretchedMovement", "factor_needed", "least_factor", "paced"]

#: Relative accuracy of the factor.
ACCURACY = 1e-3
#: Pen-up moves with this time, s of the hand, hold nothing up.
_WIDE_GAP_S = 3.0
#: A pen-up move that is too fast gets this much more time at least and at most, per attempt.
_LONGER = (1.03, 1.5)
_ATTEMPTS = 40
#: Speed, m/s, at which a path is planned first: far from any limit, so that its samples lie close.
_EASY_SPEED = 0.3


class StretchedMovement:
    """A trajectory in the form that planning takes, slowed down.

    Args:
        name: for messages.
        joined: the movement.
        factor: how many times as slow.
    """

    def __init__(self, name: str, joined: Joined, factor: float = 1.0) -> None:
        self.name = name
        self._trajectory = joined.trajectory.stretched(factor)

    @property
    def duration(self) -> float:
        """[s]."""
        return self._trajectory.duration

    def sample(self, t: NDArray[np.float64], /) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return positions (n, 3) [m] and velocities (n, 3) [m/s] at times (n,)."""
        motion = self._trajectory.evaluate(t)
        return motion.p, motion.v


def factor_needed(
    name: str, joined: Joined, arm: RobotModel
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The factor that each moment of a movement needs.

    Args:
        name: for messages.
        joined: the movement, as fast as the hand was.
        arm: who shall do it.

    Returns:
        Times (n,), s of the hand, and factors (n,); below 1 there is room.

    Raises:
        PlanningError: the path itself cannot be done, at any speed.
    """
    t = np.linspace(0.0, joined.trajectory.duration, 2001)
    easy = max(1.0, float(np.linalg.norm(joined.trajectory.evaluate(t).v, axis=1).max()) / _EASY_SPEED)
    limits = limits_of(arm)
    no_speeds = replace(limits, speed_fraction=1e6, qdd_max=(1e9,) * 6, tcp_speed_max=1e6, rest_speed_max=1e6)
    plan = plan_movement(StretchedMovement(name, joined, easy), model=arm, limits=no_speeds)
    qd = np.abs(plan.spline.sample(plan.t)[1]) / (limits.speed_fraction * np.array(arm.limits.qd_max))
    qdd = np.abs(plan.spline.qdd(plan.t)) / np.array(limits.qdd_max)
    tcp = np.linalg.norm(joined.trajectory.stretched(easy).evaluate(plan.t).v, axis=1) / limits.tcp_speed_max
    need = np.maximum(np.maximum(qd.max(axis=1), np.sqrt(qdd.max(axis=1))), tcp)
    return plan.t / easy, easy * need


def paced(
    name: str, marks: Sequence[Mark], gaps: NDArray[np.float64], lift: NDArray[np.float64], arm: RobotModel
) -> Joined:
    """Join marks with pen-up moves that ask no more of the arm than the marks do.

    Args:
        name: for messages.
        marks: in order of time, m, base frame.
        gaps: the least ones, (n_marks + 1,), s of the hand.
        lift: from the sheet to the lifted pen, (3,), m.
        arm: who shall do it.

    Raises:
        PlanningError: the path itself cannot be done, at any speed.
    """
    slow = join(marks, np.maximum(gaps, _WIDE_GAP_S), lift)
    allowed = max(1.0, float(factor_needed(name, slow, arm)[1].max()))
    gaps = gaps.copy()
    for _ in range(_ATTEMPTS):
        joined = join(marks, gaps, lift)
        t, need = factor_needed(name, joined, arm)
        worst = np.array(
            [need[(t >= begin) & (t <= end)].max(initial=0.0) for begin, end in joined.gap_intervals()]
        )
        late = (worst > allowed * (1.0 + ACCURACY)) & (gaps < _WIDE_GAP_S)
        if not late.any():
            break
        gaps[late] *= np.clip(worst[late] / allowed, *_LONGER)
    return joined


def least_factor(
    make: Callable[[float], PlannableMovement], guess: float, arm: RobotModel
) -> tuple[float, JointPlan]:
    """The least factor, at least 1, at which planning accepts a movement, and its plan.

    Args:
        make: the movement, slowed down by a factor.
        guess: where to look first.
        arm: who shall do it.

    Raises:
        PlanningError: it is refused although it is slow; the message is planning's.
    """

    def attempt(factor: float) -> JointPlan | None:
        try:
            return plan_movement(make(factor), model=arm)
        except PlanningError:
            return None

    high = max(1.0, guess)
    step = ACCURACY
    while (plan := attempt(high)) is None:
        if high > 2.0 * max(1.0, guess):
            return high, plan_movement(make(high), model=arm)  # raises, and says what is wrong
        step *= 2.0
        high *= 1.0 + step
    low, step = high, ACCURACY
    while low > 1.0:
        step *= 2.0
        low = max(1.0, high * (1.0 - step))
        better = attempt(low)
        if better is None:
            break
        high, plan = low, better
    while high > 1.0 and high / low > 1.0 + ACCURACY:
        middle = 0.5 * (low + high)
        better = attempt(middle)
        if better is None:
            low = middle
        else:
            high, plan = middle, better
    return high, plan
