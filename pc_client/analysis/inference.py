"""What a set of figures allows to say: means with their intervals, and differences with interval and p value.

The unit is a movement or a seed: repetitions, .02 dB apart, are averaged before. Intervals are of 95 %, by
the bootstrap of `scipy.stats` (BCa, fixed seed). Those of few units are too narrow: of 5 normal values they
hold the mean in 81 % of all cases, of 10 in 93 %. p is of a permutation test with two sides, in which the
paired differences change their signs: 5 pairs cannot give less than .06, 10 not less than .002.
"""

from dataclasses import dataclass
from math import nan

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

_N_RESAMPLES, _SEED = 9999, 37
_FEWEST = 3
"""Units that an interval needs."""


@dataclass(frozen=True, slots=True)
class Interval:
    """A mean, the standard deviation of the units, and the mean's interval; nan with too few units."""

    mean: float
    spread: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Difference(Interval):
    """The mean of paired differences, and p of the hypothesis that the pairs do not differ."""

    n_pairs: int
    p: float


def mean_interval(values: ArrayLike) -> Interval:
    """The mean of values (n,), one a unit, n >= 1, with the interval that they allow."""
    x = np.asarray(values, dtype=np.float64)
    if not np.all(np.isfinite(x)):
        return Interval(float(np.mean(x)), nan, nan, nan)
    mean, spread = float(np.mean(x)), float(np.std(x, ddof=1)) if len(x) > 1 else nan
    if len(x) < _FEWEST:
        return Interval(mean, spread, nan, nan)
    if np.allclose(x, mean, rtol=1e-12):  # no resample differs
        return Interval(mean, 0.0, mean, mean)
    random = np.random.default_rng(_SEED)
    found = stats.bootstrap((x,), np.mean, n_resamples=_N_RESAMPLES, method="BCa", rng=random)
    low, high = found.confidence_interval
    return Interval(mean, spread, float(low), float(high))


def paired_difference(a: ArrayLike, b: ArrayLike) -> Difference:
    """Of a - b; the values (n,) belong together one by one."""
    with np.errstate(invalid="ignore"):  # endless levels of two perfect arms
        x = np.asarray(a, dtype=np.float64) - np.asarray(b, dtype=np.float64)
    found, p = mean_interval(x), nan
    if np.isfinite(found.low):
        random = np.random.default_rng(_SEED)
        given = {"permutation_type": "samples", "n_resamples": _N_RESAMPLES, "rng": random}
        p = float(stats.permutation_test((x,), np.mean, **given).pvalue)
    return Difference(found.mean, found.spread, found.low, found.high, len(x), p)
