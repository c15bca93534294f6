"""The lognormal speed profile in closed form, and the lognormal that fills a window in time.

One lognormal of unit length (D = 1), a function of time only; `sigma_lognormal` gives it a place and a
direction. Two constructions from a window, both exact: `LiteralTiming` is the paper's (Eq. 7-9) and what its
recipe uses; `TwoSidedTiming` puts both tails inside the window and is what strokes that overlap use.

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
from numpy.typing import ArrayLike
from scipy.special import ndtr

from pc_client.arrays import Array
from pc_client.errors import MovementError

_SQRT_TWO_PI = math.sqrt(2.0 * math.pi)


class LognormalValues(NamedTuple):
    """A lognormal at some times: `done` is F, 0 to 1; `rate` Lambda, 1/s; `rate_change` dLambda/dt, 1/s^2."""

    done: Array
    rate: Array
    rate_change: Array


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
        """Itself: a stroke is timed by the parameters or by a construction from a window."""
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
        """Centre of gravity, s."""
        return self.time_at_deviation(0.5 * self.sigma)

    @property
    def std(self) -> float:
        """Standard deviation, s."""
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


#: Deviations z of the window's end at which the paper calls a stroke complete: Phi(3 sqrt 2) = (1 + erf 3) /
#: 2. Source: Eq. 6 and 7.
FULL_COVERAGE = 3.0 * math.sqrt(2.0)


def sigma_for_k(k: float) -> float:
    """The positive root of Eq. 9, sigma^2 + 3 sqrt2 sigma - ln k = 0.

    Args:
        k: (t_end - t0) / (t_max - t0), greater than 1. The paper leaves k undefined; this is what makes Eq. 9
            follow from Eq. 7 and 8.

    Returns:
        sigma (the paper's text calls this root sigma^2; it is sigma).
    """
    if not (math.isfinite(k) and k > 1.0):
        raise MovementError(f"k = {k}: the end of a stroke comes after its peak, so k must be greater than 1")
    # Written without the difference of nearly equal numbers that the textbook root has for k near 1.
    log_k = math.log(k)
    return 2.0 * log_k / (FULL_COVERAGE + math.sqrt(18.0 + 4.0 * log_k))


def lead_from_k(k: float, duration: float) -> float:
    """The lead (s) of the command before the stroke, for a peak in the middle of the stroke's `duration` (s).

    Inverse of k = (lead + duration) / (lead + duration / 2); k = 2 is no lead, k towards 1 an endless one.
    """
    if not (1.0 < k <= 2.0):
        raise MovementError(f"k = {k}: with the peak in the middle of the stroke k must lie in (1, 2]")
    return duration * (1.0 - 0.5 * k) / (k - 1.0)


@dataclass(frozen=True, slots=True)
class LiteralTiming:
    """The paper's construction: all of the length done at the end of the window, the peak in its middle.

    Attributes:
        start: start of the window, s (the paper's t_min of the stroke before).
        duration: length of the window, s, > 0.
        lead: how long before the window the command is given, s, >= 0. The paper leaves it open. 0 is the
            literal reading (k = 2: the first quarter of the window is without motion, kurtosis 3.4); a lead
            of one to five durations gives the centred lognormals with kurtosis about 3 that its text asks
            for.

    Source: Eq. 7-9 with k = (lead + duration) / (lead + duration / 2).
    """

    start: float
    duration: float
    lead: float

    def __post_init__(self) -> None:
        _check_window(self.start, self.duration)
        if not (math.isfinite(self.lead) and self.lead >= 0.0):
            raise MovementError(f"stroke with lead {self.lead} s: the lead must be 0 or more")

    @property
    def k(self) -> float:
        """(t_end - t0) / (t_max - t0)."""
        return (self.lead + self.duration) / (self.lead + 0.5 * self.duration)

    @property
    def lognormal(self) -> Lognormal:
        """The lognormal that fulfils Eq. 7 and 8."""
        sigma = sigma_for_k(self.k)
        return Lognormal(
            self.start - self.lead, math.log(self.lead + self.duration) - FULL_COVERAGE * sigma, sigma
        )

    def stretched(self, factor: float) -> LiteralTiming:
        """The same in a window `factor` times as long and as late."""
        return LiteralTiming(self.start * factor, self.duration * factor, self.lead * factor)


@dataclass(frozen=True, slots=True)
class TwoSidedTiming:
    """Both tails inside the window: F = Phi(-c) at its start and Phi(c) at its end.

    Attributes:
        start: start of the window, s.
        duration: length of the window, s, > 0.
        sigma: width and, with it, asymmetry of the lognormal, > 0: people show .1 to .35 in reaches.
        coverage: c; 3 sqrt 2 leaves 2.2e-5 of the length outside the window, 3 leaves .27 %.

    Source: mu = ln(T / (2 sinh(c sigma))), t0 = start - exp(mu - c sigma), from the two conditions; the same
    idea, with c = 3, is in Berio et al.'s handwriting synthesis.
    """

    start: float
    duration: float
    sigma: float
    coverage: float = FULL_COVERAGE

    def __post_init__(self) -> None:
        _check_window(self.start, self.duration)
        if not (math.isfinite(self.sigma) and 0.0 < self.sigma <= 2.0):
            raise MovementError(f"stroke with sigma {self.sigma}: sigma must lie in (0, 2]")
        if not (math.isfinite(self.coverage) and 0.0 < self.coverage <= 10.0):
            raise MovementError(f"stroke with coverage {self.coverage}: the coverage c must lie in (0, 10]")

    @property
    def lognormal(self) -> Lognormal:
        """The lognormal that has both tails in the window."""
        mu = math.log(self.duration / (2.0 * math.sinh(self.coverage * self.sigma)))
        return Lognormal(self.start - math.exp(mu - self.coverage * self.sigma), mu, self.sigma)

    def stretched(self, factor: float) -> TwoSidedTiming:
        """The same in a window `factor` times as long and as late."""
        return TwoSidedTiming(self.start * factor, self.duration * factor, self.sigma, self.coverage)


def _check_window(start: float, duration: float) -> None:
    if not (math.isfinite(start) and math.isfinite(duration) and duration > 0.0):
        raise MovementError(
            f"stroke window at {start} s for {duration} s: give finite times, longer than 0 s"
        )


Timing = Lognormal | LiteralTiming | TwoSidedTiming
"""What gives a stroke its lognormal: the parameters themselves, or a construction from a window."""
