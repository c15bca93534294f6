"""The loop as the client knows it: a dead time, a first-order lag, and an integrator behind them.

    q(s) = qd_cmd(s) exp(-s dead_time) / (1 + s lag) / s

A command is held from its frame to the next one. What this does to the positions that are reported once a
cycle is exact here: `velocity_response` is the sampled response of the differenced position, the very signal
that Eq. 10 judges, to one held command.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import ceil, exp

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

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
    """Differenced position after a unit velocity that is commanded for one cycle.

    Args:
        loop: dead time and lag.
        period: control cycle [s].

    Returns:
        (n,): (q_k - q_(k-1)) / period for k = 0, 1, ...; the command is held from k = 0 to k = 1. Sums to 1.
    """
    n = ceil((loop.dead_time + _SETTLED * loop.lag) / period) + 3
    t: Array = np.arange(-1, n, dtype=np.float64) * period - loop.dead_time
    pulse = _displacement_after_step(t, loop.lag) - _displacement_after_step(t - period, loop.lag)
    response: Array = np.diff(pulse) / period
    return response


def frequency_response(loop: LoopModel, period: float, hertz: Array) -> NDArray[np.complex128]:
    """Response of the differenced position to the commands at frequencies (m,) [Hz], (m,)."""
    response = velocity_response(loop, period)
    turns = np.outer(hertz, np.arange(len(response)) * period)
    values: NDArray[np.complex128] = (np.exp(-2j * np.pi * turns) @ response).astype(np.complex128)
    return values


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
    displacement: Array = since - lag * -np.expm1(-since / lag)
    return displacement
