"""The loop as the client knows it: a dead time, a first-order lag, an integrator; and how much gain it bears.

    q(s) = qd_cmd(s) exp(-s dead_time) / (1 + s lag) / s

A command is held from its frame to the next one. What this does to the positions that are reported once a
cycle is exact here: `velocity_response` is the sampled response of the differenced position, the very signal
that Eq. 10 judges, to one held command.

With feedback the open loop of one joint is L(s) = (gain_p + gain_i / s) / s * P(s), P from command to
reported velocity. `loop_margins` measures it as it is sampled, and there is no other definition of a margin:
what is accepted, recorded and tabled comes from it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import ceil, exp, inf, pi

import numpy as np
from numpy.typing import NDArray

from pc_client.arrays import Array

SAMPLING_TIME = 0.008
"""Eq. 10 differences positions over this time [s], the control cycle of the paper's arm, on every arm:
encoders have the same noise in each frame, and over 2 ms it would be four times as large."""

NO_LAG = 1e-6
"""A lag below this [s] is none: no motion of an arm shows it."""

_SETTLED = 12.0
"""Time constants after which a first-order lag has settled to 6e-6."""


@dataclass(frozen=True, slots=True)
class LoopModel:
    """Two parameters and how well they are known.

    Attributes:
        dead_time: from a command to the first effect in a reported position [s].
        lag: time constant of the first-order lag behind it [s].
        spread: largest difference of a single joint's delay from the common one [s]; what the model leaves
            open. None when dead time and lag were not separated: all of the delay is `dead_time` then, and
            `lag` is no measurement.
        residual: rms of what the model does not explain [rad].
    """

    dead_time: float
    lag: float
    spread: float | None
    residual: float

    @classmethod
    def of_delay(cls, delay: float, residual: float) -> LoopModel:
        """The loop of a controller that knows one delay [s] and no lag."""
        return cls(delay, 0.0, None, residual)

    @property
    def delay(self) -> float:
        """Dead time and lag together: by how much slow motion trails [s]."""
        return self.dead_time + self.lag

    def __str__(self) -> str:
        """The loop in one phrase; only what was identified."""
        if self.spread is None:
            return f"delay {1e3 * self.dead_time:.1f} ms"
        return (
            f"dead time {1e3 * self.dead_time:.1f} ms, lag {1e3 * self.lag:.1f} ms, "
            f"joints within {1e3 * self.spread:.1f} ms"
        )

    def corners(self) -> Iterator[LoopModel]:
        """The loops at the edges of what `spread` leaves open: later or earlier, more or less lag.

        None for a loop whose dead time and lag were not separated.
        """
        if self.spread is None:
            return
        for shift in (-self.spread, self.spread):
            for share in (0.0, 0.5, 1.0):  # of the shift that is lag rather than dead time
                yield replace(
                    self,
                    dead_time=max(self.dead_time + (1.0 - share) * shift, 0.0),
                    lag=max(self.lag + share * shift, 0.0),
                )


def velocity_response(loop: LoopModel, period: float) -> Array:
    """Differenced position after a unit velocity that is commanded for one control cycle, the period [s].

    Returns:
        (n,): (q_k - q_(k-1)) / period for k = 0, 1, ...; the command is held from k = 0 to k = 1. Sums to 1.
    """
    n = ceil((loop.dead_time + _SETTLED * loop.lag) / period) + 3
    t: Array = np.arange(-1, n, dtype=np.float64) * period - loop.dead_time
    pulse = _displacement_after_step(t, loop.lag) - _displacement_after_step(t - period, loop.lag)
    return np.diff(pulse) / period


def frequency_response(loop: LoopModel, period: float, hertz: Array) -> NDArray[np.complex128]:
    """Response of the differenced position to the commands at frequencies (m,) [Hz], (m,)."""
    response = velocity_response(loop, period)
    turns = np.outer(hertz, np.arange(len(response)) * period)
    return (np.exp(-2j * np.pi * turns) @ response).astype(np.complex128)


def lagged_displacement(knots: Array, commands: Array, lag: float) -> tuple[Array, Array]:
    """Follow held velocities through the lag alone.

    Args:
        knots: (n + 1,) times; command k holds from knot k to k + 1 [s].
        commands: (n, j) velocities [rad/s].
        lag: time constant [s].

    Returns:
        Position and velocity at the knots, (n + 1, j) each; both begin at 0.
    """
    steps = np.diff(knots)
    velocity = np.zeros((len(knots), commands.shape[1]))
    if lag >= NO_LAG:
        now = velocity[0]
        for k, step in enumerate(steps):
            now = commands[k] + (now - commands[k]) * exp(-step / lag)
            velocity[k + 1] = now
    displacement = np.vstack([np.zeros(commands.shape[1]), np.cumsum(commands * steps[:, None], axis=0)])
    return displacement - lag * velocity, velocity


def _displacement_after_step(t: Array, lag: float) -> Array:
    """Displacement at times t since a velocity step of 1, after the lag: t - lag (1 - exp(-t / lag))."""
    since = np.maximum(t, 0.0)
    if lag < NO_LAG:
        return since
    return since - lag * -np.expm1(-since / lag)


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
    loop: LoopModel, gain_p: float, gain_i: float, period: float, hertz: Array
) -> NDArray[np.complex128]:
    """S = 1 / (1 + L) of the sampled loop at frequencies (m,) [Hz]: what feedback leaves of an error."""
    return 1.0 / (1.0 + _open_loop(loop, gain_p, gain_i, period, hertz))


def loop_margins(loop: LoopModel, gain_p: float, gain_i: float, period: float) -> LoopMargins:
    """Measure the margins of a loop that is sampled once a period [s], with gains [1/s] and [1/s2], >= 0.

    Without feedback all are infinite and the peak is 1.
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
    loop: LoopModel, gain_p: float, gain_i: float, period: float, hertz: Array, values: NDArray[np.complex128]
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
    loop: LoopModel, gain_p: float, gain_i: float, period: float, hertz: Array
) -> NDArray[np.complex128]:
    """L of the sampled loop: the integral takes an error into account one cycle after it was seen."""
    back = np.exp(-2j * np.pi * hertz * period)
    controller = gain_p + gain_i * period * back / (1.0 - back)
    values: NDArray[np.complex128] = (
        controller * period / (1.0 - back) * frequency_response(loop, period, hertz)
    )
    return values
