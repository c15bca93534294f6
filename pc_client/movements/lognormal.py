"""The lognormal speed profile: its values at any time, and everything about it that has a closed form.

One lognormal of unit length (D = 1), a function of time only; `stroke.py` gives it a place and a direction.

    Lambda(t; t0, mu, sigma) = exp(-z^2 / 2) / (sigma sqrt(2 pi) (t - t0)),   z = (ln(t - t0) - mu) / sigma
    F(t)                     = integral of Lambda from t0 to t = Phi(z),      t > t0

Source: Plamondon's kinematic theory; Eq. 2 and 4 of Wolniakowski et al., "Towards human-like kinematics in
industrial robotic arms", with one amplitude D only (the printed Eq. 1 and 2 have three).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtr

from pc_client.errors import MovementError

__all__ = ["Inflections", "Lognormal", "LognormalValues", "evaluate_lognormals"]

_SQRT_TWO_PI = math.sqrt(2.0 * math.pi)


class LognormalValues(NamedTuple):
    """A lognormal at some times: `done` is F, 0 to 1; `rate` Lambda, 1/s; `rate_change` dLambda/dt, 1/s^2."""

    done: NDArray[np.float64]
    rate: NDArray[np.float64]
    rate_change: NDArray[np.float64]


class Inflections(NamedTuple):
    """The two inflections of Lambda, before and after the mode, in seconds."""

    before: float
    after: float


# Ages below are taken for 0: a lognormal divides by its age [s].
_YOUNGEST = 1e-100


def evaluate_lognormals(t: ArrayLike, t0: ArrayLike, mu: ArrayLike, sigma: ArrayLike) -> LognormalValues:
    """F, Lambda and dLambda/dt of unit lognormals; all arguments broadcast against each other.

    Args:
        t: times, s.
        t0: command times, s; before them all three values are 0.
        mu: log-time delays, ln s.
        sigma: log-time widths, > 0.
    """
    t, t0, mu, sigma = (np.asarray(value, dtype=np.float64) for value in (t, t0, mu, sigma))
    age = t - t0
    begun = age > _YOUNGEST
    age = np.where(begun, age, 1.0)
    z = (np.log(age) - mu) / sigma
    done = np.where(begun, ndtr(z), 0.0)
    # z**2 overflows to inf only where the lognormal is 0; clipping avoids numpy's warning.
    rate = np.where(begun, np.exp(-0.5 * np.minimum(z * z, 1e4)) / (sigma * _SQRT_TWO_PI * age), 0.0)
    rate_change = -rate / age * (1.0 + z / sigma)
    return LognormalValues(done, rate, rate_change)


@dataclass(frozen=True, slots=True)
class Lognormal:
    """One lognormal by its three parameters.

    Attributes:
        t0: time at which the command is given, s; the visible motion begins later.
        mu: logarithm of the time from command to half the length, ln s.
        sigma: width of the lognormal on the logarithmic time axis, > 0.
    """

    t0: float
    mu: float
    sigma: float

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (self.t0, self.mu, self.sigma))):
            raise MovementError(
                f"lognormal with t0={self.t0}, mu={self.mu}, sigma={self.sigma}: give finite numbers"
            )
        if self.sigma <= 0.0:
            raise MovementError(f"lognormal with sigma={self.sigma}: sigma must be greater than 0")

    @property
    def lognormal(self) -> Lognormal:
        """Itself, so that a stroke may be timed by its parameters or by a construction of `timing.py`."""
        return self

    def stretched(self, factor: float) -> Lognormal:
        """The same lognormal `factor` times as slow: t0 and std times factor, mu + ln(factor), sigma kept."""
        return Lognormal(self.t0 * factor, self.mu + math.log(factor), self.sigma)

    def evaluate(self, t: ArrayLike) -> LognormalValues:
        """F, Lambda and dLambda/dt at the times t (s), in the shape of t."""
        return evaluate_lognormals(t, self.t0, self.mu, self.sigma)

    def time_at_deviation(self, z: float) -> float:
        """Time (s) at which F = Phi(z), i.e. t0 + exp(mu + z sigma)."""
        return self.t0 + math.exp(self.mu + z * self.sigma)

    @property
    def mode(self) -> float:
        """Time of the top speed, s (Eq. 8)."""
        return self.time_at_deviation(-self.sigma)

    @property
    def median(self) -> float:
        """Time at which half the length is done, s."""
        return self.time_at_deviation(0.0)

    @property
    def mean(self) -> float:
        """Centre of gravity of the lognormal, s."""
        return self.time_at_deviation(0.5 * self.sigma)

    @property
    def std(self) -> float:
        """Standard deviation of the lognormal, s."""
        return math.exp(self.mu + 0.5 * self.sigma**2) * math.sqrt(math.expm1(self.sigma**2))

    @property
    def skewness(self) -> float:
        """Third standardised moment; above 0 always, and near 0 for small sigma."""
        return (math.exp(self.sigma**2) + 2.0) * math.sqrt(math.expm1(self.sigma**2))

    @property
    def kurtosis(self) -> float:
        """Fourth standardised moment (3 is a Gaussian's); above 3 always."""
        s2 = self.sigma**2
        return math.exp(4.0 * s2) + 2.0 * math.exp(3.0 * s2) + 3.0 * math.exp(2.0 * s2) - 3.0

    @property
    def peak(self) -> float:
        """Lambda at the mode, 1/s: the top speed of a stroke of length 1 m."""
        return math.exp(-self.mu + 0.5 * self.sigma**2) / (self.sigma * _SQRT_TWO_PI)

    @property
    def done_at_mode(self) -> float:
        """Share of the length done at the mode, Phi(-sigma): below one half always."""
        return float(ndtr(-self.sigma))

    @property
    def power(self) -> float:
        """Integral of Lambda^2 over all time, 1/s."""
        return math.exp(-self.mu + 0.25 * self.sigma**2) / (2.0 * self.sigma * math.sqrt(math.pi))

    @property
    def inflections(self) -> Inflections:
        """Where the second derivative of Lambda is zero."""
        s = self.sigma
        root = s * math.sqrt(0.25 * s * s + 1.0)
        before, after = (self.t0 + math.exp(self.mu - 1.5 * s * s + sign * root) for sign in (-1.0, 1.0))
        return Inflections(before, after)
