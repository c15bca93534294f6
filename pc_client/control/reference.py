"""What the arm should do at any time, prepared so that the control loop only looks it up.

Frames come on a fixed grid, so the whole reference is computed before the arm moves; a time off the grid
(jitter of a real controller's stamp) is computed when it comes, by the same function. Who runs, guards or
predicts a run has its reference from one `RunRecipe`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import floor
from typing import NamedTuple, Protocol, Self

import numpy as np

from pc_client.arrays import Array
from pc_client.control.controller import Controller
from pc_client.control.gear import GearModel
from pc_client.control.loop import LoopModel


class JointReference(Protocol):
    """Joint positions over time; before 0 and after `duration` the arm stands still."""

    @property
    def duration(self) -> float:
        """Length of the movement [s]."""

    def at(self, t: float) -> tuple[Sequence[float] | Array, Sequence[float] | Array]:
        """Positions (6,) [rad] and velocities (6,) [rad/s] at time t [s]."""


class TcpReference(Protocol):
    """The TCP's desired motion over time, for the log; `movements.Movement` is one."""

    def sample(self, t: Array, /) -> tuple[Array, Array]:
        """Positions (n, 3) [m] and velocities (n, 3) [m/s], base frame, at times (n,) [s]."""


class ReferencePoint(NamedTuple):
    """The reference at one time; its arrays are read-only.

    Attributes:
        t: time since the movement began [s], negative before it.
        q: (6,) desired joint positions as plain floats [rad].
        qd_feedforward: (6,) velocities to command now, before feedback [rad/s].
        q_array: (6,) the same positions [rad].
        qd_array: (6,) desired joint velocities [rad/s].
        p: (3,) desired TCP position, base frame [m].
        v: (3,) desired TCP velocity, base frame [m/s].
    """

    t: float
    q: tuple[float, ...]
    qd_feedforward: Array
    q_array: Array
    qd_array: Array
    p: Array
    v: Array


LEAD = 0.2
"""Time at rest before a movement, position loop closed [s]: takes up what the approach left."""

SETTLE = 0.3
"""Time at rest after it, position loop closed [s]."""


@dataclass(frozen=True, slots=True)
class RunRecipe:
    """What a run is made of: prediction, guard, runner and laws of users have their reference from here.

    Attributes:
        controller: with a preview the feed-forward is the mean of qd + lag qdd, the input whose lagged output
            is qd, over the cycle that begins later by the loop's delay; without, the reference velocity at
            the current time. For a law of a user, the numbers beside it.
        loop: the identified one; before that, a shorter one.
        period: control cycle [s].
        gear: with a preview: the feed-forward is that of motors behind such gears; None: that of the joints.
        learned: (n, 6) velocities to add to the feed-forward [rad/s], one a cycle from `lead` before the
            movement on; None: nothing.
    """

    controller: Controller
    loop: LoopModel
    period: float
    gear: GearModel | None = None
    learned: Array | None = None

    @classmethod
    def first(cls, controller: Controller, period: float) -> Self:
        """Before the loop is identified: the shortest one of a robot, a cycle [s] to the arm and one back."""
        return cls(controller, LoopModel.of_delay(2.0 * period, 0.0), period)

    @property
    def ahead(self) -> tuple[float, float]:
        """By how much the feed-forward is ahead, and the lag that it makes up for [s]."""
        loop = self.loop
        return (loop.dead_time, loop.lag) if self.controller.compensates_lag else (loop.delay, 0.0)


# Time stamps are multiples of the cycle up to rounding; one microsecond separates neighbours and is
# 1e-4 of a cycle.
_TICKS_PER_SECOND = 1_000_000


class ReferenceTable:
    """A reference sampled on the control grid, with its feed-forward.

    Args:
        lead: time before the movement that is needed [s].
        settle: time after it [s].
        tcp: the TCP reference to log, or None when there is none.
    """

    def __init__(
        self,
        joints: JointReference,
        recipe: RunRecipe,
        tcp: TcpReference | None = None,
        *,
        lead: float = LEAD,
        settle: float = SETTLE,
    ) -> None:
        self.duration, self.lead, self.settle = joints.duration, lead, settle
        self.period = period = recipe.period
        self._joints, self._tcp = joints, tcp
        self._gear, learned = recipe.gear, recipe.learned
        self._has_preview = recipe.controller.uses_preview
        self._lookahead, self._lag = recipe.ahead
        self._learned = None if learned is None else np.pad(learned, ((1, 1), (0, 0)))  # at rest at both ends
        self._points: dict[int, ReferencePoint] = {}
        grid = np.arange(round((lead + self.duration + settle) / period) + 2) * period - lead
        self._compute(np.round(grid * _TICKS_PER_SECOND).astype(int).tolist())

    def commands(self) -> Array:
        """The feed-forward of a whole run (n, 6) [rad/s], one a cycle: all that is sent but for feedback."""
        n = round((self.lead + self.duration + self.settle) / self.period) + 1
        return np.array([self.at(k * self.period - self.lead).qd_feedforward for k in range(n)])

    def at(self, t: float) -> ReferencePoint:
        """The reference at time t [s] since the movement began, negative before it."""
        tick = round(t * _TICKS_PER_SECOND)
        point = self._points.get(tick)
        if point is None:
            self._compute([tick])
            point = self._points[tick]
        return point

    def _compute(self, ticks: list[int]) -> None:
        """Add the points at these times [us]."""
        times = np.array(ticks) / _TICKS_PER_SECOND
        if self._tcp is None:
            p = v = np.full((len(times), 3), np.nan)
        else:
            p, v = (np.array(x, dtype=np.float64) for x in self._tcp.sample(times))
        p.setflags(write=False)
        v.setflags(write=False)
        for i, tick in enumerate(ticks):
            t = float(times[i])
            q, qd = (np.array(x, dtype=np.float64) for x in self._joints.at(t))
            of_reference = self._mean_velocity(t + self._lookahead) if self._has_preview else qd
            feedforward = of_reference if self._learned is None else of_reference + self._learned_at(t)
            for array in (q, qd, feedforward):
                array.setflags(write=False)
            self._points[tick] = ReferencePoint(t, tuple(q.tolist()), feedforward, q, qd, p[i], v[i])

    def _mean_velocity(self, t: float) -> Array:
        """Mean (6,) [rad/s] of the motors' velocity + lag * acceleration over the cycle from t [s] on.

        Both are differences over the cycle, of position and of velocity: nothing is integrated numerically.
        """
        q_now, qd_now = self._motors_at(t)
        q_later, qd_later = self._motors_at(t + self.period)
        return (q_later - q_now + self._lag * (qd_later - qd_now)) / self.period

    def _motors_at(self, t: float) -> tuple[Array, Array]:
        q, qd = (np.asarray(x, dtype=np.float64) for x in self._joints.at(t))
        return (q, qd) if self._gear is None else self._gear.motors(q, qd)

    def _learned_at(self, t: float) -> Array:
        """What was learned for time t [s]; between two cycles in between, 0 outside."""
        assert self._learned is not None
        position = (t + self.lead) / self.period + 1.0
        k = min(max(floor(position), 0), len(self._learned) - 2)
        share = min(max(position - k, 0.0), 1.0)
        value: Array = (1.0 - share) * self._learned[k] + share * self._learned[k + 1]
        return value
