"""How much gain the loop bears: the arm integrates velocity, and everything takes the loop delay.

Open loop of one joint: L(s) = (gain_p + gain_i / s) / s * exp(-s T), T from command to report. For the
identified loop, dead time and lag apart and sampled as it is, `loop_margins` measures L where it matters.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan, hypot, inf, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from pc_client.control.loop_model import LoopModel, frequency_response


@dataclass(frozen=True, slots=True)
class LoopMargins:
    """How far a sampled feedback loop is from oscillating.

    Attributes:
        gain: factor by which both gains may grow.
        phase_deg: phase that may be lost at the crossover [deg].
        delay: time that the loop may take longer [s].
        peak: largest |S| = |1 / (1 + L)|: by how much the feedback amplifies an error at worst.
    """

    gain: float
    phase_deg: float
    delay: float
    peak: float


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


def sensitivity(
    loop: LoopModel, gain_p: float, gain_i: float, period: float, hertz: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """S = 1 / (1 + L) of the sampled loop at frequencies (m,) [Hz]: what feedback leaves of an error."""
    values: NDArray[np.complex128] = 1.0 / (1.0 + _open_loop(loop, gain_p, gain_i, period, hertz))
    return values


def loop_margins(loop: LoopModel, gain_p: float, gain_i: float, period: float) -> LoopMargins:
    """Measure the margins of the sampled loop.

    Args:
        loop: dead time and lag.
        gain_p: proportional gain [1/s], > 0.
        gain_i: integral gain [1/s2].
        period: control cycle [s].

    Returns:
        The margins; all are infinite, and the peak is 1, without feedback.
    """
    if gain_p == 0.0:
        return LoopMargins(inf, inf, inf, 1.0)
    hertz = np.geomspace(0.01, 0.5 / period, 4000)
    values = _open_loop(loop, gain_p, gain_i, period, hertz)
    size, phase = np.abs(values), np.unwrap(np.angle(values))
    # A double integrator begins at -180 deg; unwrapping may have begun a turn off.
    phase -= 2.0 * pi * round((phase[0] + pi / 2.0) / (2.0 * pi))
    crossing = int(np.argmax(size < 1.0))
    turning = np.flatnonzero((phase[:-1] > -pi) & (phase[1:] <= -pi))
    phase_margin = pi + float(phase[crossing])
    return LoopMargins(
        gain=1.0 / float(size[turning[-1]]) if len(turning) else inf,
        phase_deg=float(np.degrees(phase_margin)),
        delay=phase_margin / (2.0 * pi * float(hertz[crossing])),
        peak=float(np.max(1.0 / np.abs(1.0 + values))),
    )


def _open_loop(
    loop: LoopModel, gain_p: float, gain_i: float, period: float, hertz: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """L of the sampled loop: the integral takes an error into account one cycle after it was seen."""
    back = np.exp(-2j * np.pi * hertz * period)
    controller = gain_p + gain_i * period * back / (1.0 - back)
    values: NDArray[np.complex128] = (
        controller * period / (1.0 - back) * frequency_response(loop, period, hertz)
    )
    return values
