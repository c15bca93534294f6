"""The time of a stroke: from a window in time to the lognormal that fills it.

Two constructions, both exact. `LiteralTiming` is the paper's (Eq. 7-9) and what its recipe uses;
`TwoSidedTiming` asks both tails of the lognormal to lie inside the window and is what strokes that overlap
use. Each has its lognormal and a slower copy of itself. This module is independent of space.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from scipy.optimize import brentq

from pc_client.errors import MovementError
from pc_client.movements.lognormal import Lognormal

__all__ = [
    "FULL_COVERAGE",
    "LiteralTiming",
    "Timing",
    "TwoSidedTiming",
    "lead_from_k",
    "sigma_for_k",
    "sigma_for_mode_fraction",
]

#: Deviations z of the window's end at which the paper calls a stroke complete: Phi(3 sqrt 2) = (1 + erf 3) /
#: 2. Source: Eq. 6 and 7.
FULL_COVERAGE = 3.0 * math.sqrt(2.0)


class Timing(Protocol):
    """Anything that defines one lognormal and can be slowed down."""

    @property
    def lognormal(self) -> Lognormal:
        """The lognormal itself."""
        ...

    def stretched(self, factor: float) -> Timing:
        """The same timing, `factor` times as slow."""
        ...


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

    Inverse of k = (lead + duration) / (lead + duration / 2); k = 2 is no lead at all, k towards 1 an endless
    one.
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
        """The same construction in a window `factor` times as long and as late."""
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

    @property
    def mode_fraction(self) -> float:
        """Where in the window the peak is, 0 to 1/2."""
        return _mode_fraction(self.sigma, self.coverage)

    def stretched(self, factor: float) -> TwoSidedTiming:
        """The same construction in a window `factor` times as long and as late."""
        return TwoSidedTiming(self.start * factor, self.duration * factor, self.sigma, self.coverage)


def sigma_for_mode_fraction(fraction: float, coverage: float = FULL_COVERAGE) -> float:
    """The sigma whose two-sided lognormal has its peak at this fraction of the window, in [.05, .5)."""
    if not (0.05 <= fraction < 0.5):
        raise MovementError(
            f"mode fraction {fraction}: the peak of a lognormal lies in [0.05, 0.5) of its window"
        )
    return float(brentq(lambda sigma: _mode_fraction(sigma, coverage) - fraction, 1e-9, 2.0, xtol=1e-15))


def _mode_fraction(sigma: float, coverage: float) -> float:
    # exp(-s^2) - exp(-c s), by expm1: both terms tend to 1 for small sigma.
    return (math.expm1(-sigma * sigma) - math.expm1(-coverage * sigma)) / (2.0 * math.sinh(coverage * sigma))


def _check_window(start: float, duration: float) -> None:
    if not (math.isfinite(start) and math.isfinite(duration) and duration > 0.0):
        raise MovementError(
            f"stroke window at {start} s for {duration} s: give finite times, longer than 0 s"
        )
