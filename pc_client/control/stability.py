"""How much gain the loop bears: the arm integrates velocity, and everything takes the loop delay.

Open loop of one joint: L(s) = (gain_p + gain_i / s) / s * exp(-s T), T from command to report.
"""

from __future__ import annotations

from math import atan, hypot, inf, pi, sqrt


def largest_gain(loop_delay: float) -> float:
    """Proportional gain at which an integrator with delay begins to oscillate, pi / (2 T).

    Args:
        loop_delay: delay from command to reported position [s], > 0.

    Returns:
        The gain [1/s].

    Source: phase of exp(-s T) / s reaches -180 deg at w = pi / (2 T), where its modulus is 1 / w.
    """
    return pi / (2.0 * loop_delay)


def gain_margin(gain_p: float, gain_i: float, loop_delay: float) -> float:
    """By which factor both gains may grow before the loop oscillates; below 1 it is unstable.

    Args:
        gain_p: proportional gain [1/s], >= 0.
        gain_i: integral gain [1/s2], >= 0.
        loop_delay: delay from command to reported position [s], > 0.

    Returns:
        The gain margin; infinite without feedback, 0 when the integral part alone is too strong.
    """
    if gain_p == 0.0:
        return inf if gain_i == 0.0 else 0.0
    corner = gain_i / gain_p

    def phase_margin(w: float) -> float:
        return pi / 2.0 - atan(corner / w) - w * loop_delay

    if corner * loop_delay >= 1.0:
        return 0.0
    # The phase rises up to this frequency and falls through -180 deg beyond it.
    low = max(sqrt(corner / loop_delay - corner * corner), 1e-9)
    high = largest_gain(loop_delay)
    for _ in range(60):
        middle = 0.5 * (low + high)
        if phase_margin(middle) > 0.0:
            low = middle
        else:
            high = middle
    return low * low / hypot(gain_p * low, gain_i)
