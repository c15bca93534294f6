"""The joint reference: a C² cubic spline that a control cycle can read in microseconds.

scipy solves for the spline; this class lays its coefficients out so that q and qd at one time are a single
product of a row (1, u, u², u³) with a 4 x 12 block. It knows joints only as columns, and no limits.
"""

from __future__ import annotations

from bisect import bisect_right

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from pc_client.arrays import Array, read_only
from pc_client.errors import PlanningError


class JointSpline:
    """Cubic spline through joint angles over time, at rest at both ends.

    Source: paper section III, "3rd degree spline interpolators" giving joint positions and velocities.

    Args:
        t: (n,) times of the knots [s], increasing from 0, n >= 2.
        q: (n, 6) joint angles at the knots [rad].

    Raises:
        PlanningError: fewer than two knots, times that do not increase from 0, or values that are not finite.
    """

    def __init__(self, t: ArrayLike, q: ArrayLike) -> None:
        times, knots = read_only(t), read_only(q)
        if knots.ndim != 2 or len(knots) < 2 or times.shape != (len(knots),):
            raise PlanningError(
                "a joint spline needs times (n,) and knots of shape (n >= 2, joints), not"
                f" {times.shape} and {knots.shape}"
            )
        if times[0] != 0.0 or not (np.diff(times) > 0.0).all() or not np.isfinite(times[-1]):
            raise PlanningError("the times of a joint spline must be finite and increase from 0 s")
        bad = np.argwhere(~np.isfinite(knots))
        if bad.size:
            sample, joint = (int(index) for index in bad[0])
            raise PlanningError(f"knot {sample} of a joint spline is not finite", sample=sample, joint=joint)
        self.t_knots = times
        self.q_knots = knots
        self.duration = float(times[-1])
        self._starts: list[float] = times[:-1].tolist()  # bisect finds a number faster among Python's own
        # scipy's c is (4, intervals, joints), highest power first, in u = time since the interval's start.
        c3, c2, c1, c0 = CubicSpline(times, knots, bc_type="clamped").c
        q_rows = np.stack((c0, c1, c2, c3), axis=1)
        qd_rows = np.stack((c1, 2.0 * c2, 3.0 * c3, np.zeros_like(c3)), axis=1)
        self._coefficients: Array = np.ascontiguousarray(np.concatenate((q_rows, qd_rows), axis=2))
        rest = read_only(np.zeros(knots.shape[1]))
        self._at_start = (knots[0], rest)
        self._at_end = (knots[-1], rest)

    def at(self, t: float) -> tuple[Array, Array]:
        """Return q (6,) [rad] and qd (6,) [rad/s] at one time; outside [0, duration] an end at rest."""
        if t <= 0.0:
            return self._at_start
        if t >= self.duration:
            return self._at_end
        i = bisect_right(self._starts, t) - 1
        u = t - self._starts[i]
        uu = u * u
        row: Array = np.array((1.0, u, uu, uu * u)).dot(self._coefficients[i])
        n = len(row) >> 1
        return row[:n], row[n:]

    def sample(self, t: ArrayLike) -> tuple[Array, Array]:
        """Return q (n, 6) [rad] and qd (n, 6) [rad/s] at many times, as `at` does at one."""
        times, i, u = self._locate(t)
        powers = np.stack((np.ones_like(u), u, u * u, u * u * u), axis=1)
        rows = np.einsum("np,npj->nj", powers, self._coefficients[i])
        n = rows.shape[1] // 2
        q, qd = rows[:, :n], rows[:, n:]
        for outside, (q_end, rest) in (
            (times <= 0.0, self._at_start),
            (times >= self.duration, self._at_end),
        ):
            q[outside], qd[outside] = q_end, rest
        return q, qd

    def qdd(self, t: ArrayLike) -> Array:
        """Return joint accelerations (n, 6) [rad/s²] at many times; zero outside [0, duration]."""
        times, i, u = self._locate(t)
        half = self._coefficients.shape[2] // 2
        qd_rows = self._coefficients[i][:, :, half:]
        acceleration: Array = qd_rows[:, 1] + 2.0 * u[:, None] * qd_rows[:, 2]
        acceleration[(times < 0.0) | (times > self.duration)] = 0.0
        return acceleration

    def shifted(self, offset: ArrayLike) -> JointSpline:
        """Return the same motion with `offset` (6,) [rad] added to every joint angle, e.g. whole turns."""
        return JointSpline(self.t_knots, self.q_knots + np.asarray(offset, dtype=np.float64))

    def _locate(self, t: ArrayLike) -> tuple[Array, NDArray[np.intp], Array]:
        """Return times (n,), the interval of each, and the time since that interval's start."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        inside = np.clip(times, 0.0, self.duration)
        i = np.searchsorted(self.t_knots[:-1], inside, side="right") - 1
        return times, i, inside - self.t_knots[i]
