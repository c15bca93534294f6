"""How much gain the loop bears: the arm integrates velocity, and everything takes the loop delay.

Open loop of one joint: L(s) = (gain_p + gain_i / s) / s * P(s), P from command to reported velocity. All is
measured on the loop as it is sampled, and there is no other definition of a margin: what is accepted,
recorded and tabled comes from `loop_margins`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi

import numpy as np
from numpy.typing import NDArray

from pc_client.control.loop_model import LoopModel, frequency_response

LEAST_GAIN_MARGIN = 2.0
"""A controller needs at least this gain margin on the identified loop: 6 dB, the usual one."""

_LOWEST = 1e-3
"""Frequencies from this on are looked at [Hz]; no loop with a delay of milliseconds turns below it."""

_N_FREQUENCIES = 4000


@dataclass(frozen=True, slots=True)
class LoopMargins:
    """How far a sampled feedback loop is from oscillating; of an unstable one, how far it is beyond.

    Attributes:
        gain: factor by which both gains may grow; above 1 exactly when the loop is stable.
        phase_deg: phase that may be lost at the crossover [deg]; not above 0 for an unstable loop.
        delay: time that the loop may take longer [s]; not above 0 for an unstable loop.
        peak: largest |S| = |1 / (1 + L)|: by how much the feedback amplifies an error at worst; infinite for
            an unstable loop.
    """

    gain: float
    phase_deg: float
    delay: float
    peak: float


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
        gain_p: proportional gain [1/s], >= 0.
        gain_i: integral gain [1/s2], >= 0.
        period: control cycle [s].

    Returns:
        The margins; without feedback all are infinite and the peak is 1.
    """
    if gain_p == 0.0 and gain_i == 0.0:
        return LoopMargins(inf, inf, inf, 1.0)
    hertz = np.geomspace(_LOWEST, 0.5 / period, _N_FREQUENCIES)
    values = _open_loop(loop, gain_p, gain_i, period, hertz)
    gain = _gain_margin(loop, gain_p, gain_i, period, hertz, values)
    size, phase = np.abs(values), np.unwrap(np.angle(values))
    if phase[0] > 0.0:  # a double integrator begins at -180 deg, and may begin beyond
        phase -= 2.0 * pi
    # Where |L| is 1 for the last time; at an end of the range when it is never or always above.
    last = int(np.flatnonzero(np.append(True, size[1:] >= 1.0))[-1])
    near = slice(last, last + 2)
    crossover = float(np.interp(0.0, -np.log(size[near]), hertz[near]))
    phase_margin = pi + float(np.interp(crossover, hertz[near], phase[near]))
    return LoopMargins(
        gain=gain,
        phase_deg=float(np.degrees(phase_margin)),
        delay=phase_margin / (2.0 * pi * crossover),
        peak=float(np.max(1.0 / np.abs(1.0 + values))) if gain > 1.0 else inf,
    )


def _gain_margin(
    loop: LoopModel,
    gain_p: float,
    gain_i: float,
    period: float,
    hertz: NDArray[np.float64],
    values: NDArray[np.complex128],
) -> float:
    """The smallest factor k with a pole of 1 + k L on the unit circle: 1 over the largest crossing.

    Both gains together move the poles along root loci. For small k a pole leaves z = 1 inwards or outwards,
    which is the sign of Im L near 0; the first crossing of the negative real axis is where a loop that was
    stable is no more.
    """
    if values[0].imag >= 0.0:
        return 0.0  # the integral part alone is too strong: unstable with gains however small
    side = values.imag
    turns = np.flatnonzero((side[:-1] < 0.0) != (side[1:] < 0.0))
    share = side[turns] / (side[turns] - side[turns + 1])
    between = hertz[turns] + share * (hertz[turns + 1] - hertz[turns])
    # At half the sampling frequency L is real: the curve may end on the axis without crossing it.
    crossings = _open_loop(loop, gain_p, gain_i, period, np.append(between, hertz[-1])).real
    return float(-1.0 / crossings.min())


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
