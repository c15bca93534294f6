"""A lognormal from characteristic points of one speed profile, in closed form.

Three points of a lognormal are used: the inflection before the peak (2), the peak (3) and the inflection
behind it (4). Their heights give sigma, by one formula each, and with sigma any two of their times give mu:

    sigma^2 = -2 - 2 b - 1 / (2 b),   b = ln(v_i / v_3), i = 2 or 4
    sigma^2 = 2 sqrt(1 + b^2) - 2,    b = ln(v_4 / v_2)
    mu = ln((t_i - t_k) / (e^-a_i - e^-a_k)),   t0 = t_i - e^(mu - a_i)
    D  = sqrt(2 pi) sigma v_i exp(mu - a_i + a_i^2 / (2 sigma^2))

with a_2 = 1.5 s^2 + s sqrt(s^2 / 4 + 1), a_3 = s^2, a_4 = 1.5 s^2 - s sqrt(s^2 / 4 + 1), s = sigma.

Source: section 3.1 of the theory notes (Robust XZERO); O'Reilly & Plamondon, Pattern Recognition 42 (2009).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from pc_client.errors import MovementError
from pc_client.movements.lognormal import Lognormal

__all__ = [
    "CharacteristicPoints",
    "ScaledLognormal",
    "lognormal_from_points",
    "sigma_from_peak_ratio",
    "sigma_from_slope_ratio",
    "turn_rate",
]


class CharacteristicPoints(NamedTuple):
    """Times (s) and speeds of the inflection before the peak, the peak and the inflection after it."""

    times: tuple[float, float, float]
    speeds: tuple[float, float, float]


class ScaledLognormal(NamedTuple):
    """A lognormal and its area D, the length of a stroke."""

    lognormal: Lognormal
    length: float


def sigma_from_peak_ratio(ratio: float) -> float:
    """Sigma from the speed at one inflection over the speed at the peak.

    Args:
        ratio: v2/v3, in (0, e^-1/2), or v4/v3, in [e^-1/2, 1): a Gaussian has e^-1/2 on both sides, a
            lognormal less before the peak and more behind it.
    """
    if not 0.0 < ratio < 1.0:
        raise MovementError(f"inflection at {ratio} of the peak: the ratio must lie in (0, 1)")
    b = math.log(ratio)
    return math.sqrt(max(0.0, -2.0 - 2.0 * b - 1.0 / (2.0 * b)))


def sigma_from_slope_ratio(ratio: float) -> float:
    """Sigma from the speed at the inflection behind the peak over that at the one before, v4/v2, >= 1."""
    if not (math.isfinite(ratio) and ratio > 0.0):
        raise MovementError(f"inflections with speeds at ratio {ratio}: the ratio must be greater than 0")
    return math.sqrt(2.0 * math.sqrt(1.0 + math.log(ratio) ** 2) - 2.0)


def lognormal_from_points(
    points: CharacteristicPoints, sigma: float, i: int = 0, k: int = 2
) -> ScaledLognormal:
    """The lognormal of a known sigma through two of the three points.

    Args:
        points: the characteristic points.
        sigma: from one of the formulas of this module, > 0.
        i: the point whose time and speed are met, 0..2.
        k: the other point whose time is met, 0..2.
    """
    root = sigma * math.sqrt(0.25 * sigma * sigma + 1.0)
    a = (1.5 * sigma**2 + root, sigma**2, 1.5 * sigma**2 - root)
    mu = math.log((points.times[i] - points.times[k]) / (math.exp(-a[i]) - math.exp(-a[k])))
    t0 = points.times[i] - math.exp(mu - a[i])
    exponent = mu - a[i] + a[i] ** 2 / (2.0 * sigma**2)
    length = math.sqrt(2.0 * math.pi) * sigma * points.speeds[i] * math.exp(exponent)
    return ScaledLognormal(Lognormal(t0, mu, sigma), length)


def turn_rate(directions: tuple[float, float], distances: tuple[float, float]) -> float:
    """Change of direction per length: (phi_4 - phi_2) / (s_4 - s_2), rad per length."""
    return (directions[1] - directions[0]) / (distances[1] - distances[0])
