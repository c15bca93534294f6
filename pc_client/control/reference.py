"""What the arm should do at any time, prepared so that the control loop only looks it up.

Frames come on a fixed grid, so the whole reference is computed before the arm moves; a time off the grid
(jitter of a real controller's stamp) is computed when it comes, by the same function.
"""

from collections.abc import Sequence
from math import floor
from typing import NamedTuple, Protocol

import numpy as np

from pc_client.arrays import Array


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
    """The reference at one time.

    Attributes:
        q: (6,) desired joint positions as plain floats [rad].
        qd_feedforward: (6,) velocities to command now, before feedback, as plain floats [rad/s].
        q_array: (6,) the same positions for the log [rad].
        qd_array: (6,) desired joint velocities [rad/s].
        p: (3,) desired TCP position, base frame [m].
        v: (3,) desired TCP velocity, base frame [m/s].
    """

    q: tuple[float, ...]
    qd_feedforward: tuple[float, ...]
    q_array: Array
    qd_array: Array
    p: Array
    v: Array


# Time stamps are multiples of the cycle up to rounding; one microsecond separates neighbours and is
# 1e-4 of a cycle.
_TICKS_PER_SECOND = 1_000_000


class ReferenceTable:
    """A reference sampled on the control grid, with its feed-forward.

    Args:
        period: control cycle of the robot [s].
        lead: time before the movement that is needed [s].
        settle: time after it [s].
        lookahead: None: feed-forward is the reference velocity at the current time. A number: it is the
            mean reference velocity over the cycle that begins this much later [s].
        motors: with a lookahead: what the motors have to do so that the joints follow; the feed-forward is
            taken from it. None: what the joints do.
        lag: with a lookahead: time constant of a first-order lag to make up for [s]. The feed-forward is
            then the mean of qd + lag qdd, the input whose lagged output is qd.
        learned: (n, 6) velocities to add to the feed-forward [rad/s], one a cycle from `lead` before the
            movement on, or None.
        tcp: the TCP reference to log, or None when there is none.
    """

    def __init__(
        self,
        joints: JointReference,
        *,
        period: float,
        lead: float,
        settle: float,
        lookahead: float | None = None,
        motors: JointReference | None = None,
        lag: float = 0.0,
        learned: Array | None = None,
        tcp: TcpReference | None = None,
    ) -> None:
        self.duration = joints.duration
        self.lead = lead
        self.settle = settle
        self._joints = joints
        self._motors = joints if motors is None else motors
        self._tcp = tcp
        self.period = period
        self._lookahead = lookahead
        self._lag = lag
        self._learned = learned
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
            p, v = self._tcp.sample(times)
        for i, tick in enumerate(ticks):
            t = float(times[i])
            q, qd = (np.array(x, dtype=np.float64) for x in self._joints.at(t))
            of_reference = qd if self._lookahead is None else self._mean_velocity(t + self._lookahead)
            feedforward = of_reference if self._learned is None else of_reference + self._learned_at(t)
            self._points[tick] = ReferencePoint(
                tuple(q.tolist()), tuple(feedforward.tolist()), q, qd, p[i], v[i]
            )

    def _mean_velocity(self, t: float) -> Array:
        """Mean (6,) [rad/s] of the motors' velocity + lag * acceleration over the cycle from t [s] on.

        Both are differences over the cycle, of position and of velocity: nothing is integrated numerically.
        """
        q_now, qd_now = (np.asarray(x, dtype=np.float64) for x in self._motors.at(t))
        q_later, qd_later = (np.asarray(x, dtype=np.float64) for x in self._motors.at(t + self.period))
        return (q_later - q_now + self._lag * (qd_later - qd_now)) / self.period

    def _learned_at(self, t: float) -> Array:
        """What was learned for time t [s]; between two cycles in between, 0 outside."""
        assert self._learned is not None
        position = (t + self.lead) / self.period
        k = floor(position)
        share = position - k
        n = len(self._learned)
        value = np.zeros(self._learned.shape[1])
        if 0 <= k < n:
            value += (1.0 - share) * self._learned[k]
        if 0 <= k + 1 < n:
            value += share * self._learned[k + 1]
        return value
