"""What one run teaches the next: iterative learning control of one movement, joint by joint.

The last run was driven by its whole command u = feed-forward + learned + feedback, and left the error e. The
next run begins with what the feedback had to add, and with the command that would have made e zero:

    c_next = Q [ (u - feed-forward) + gain P_model^-1 (differenced e) ]

The inverse of the loop takes back its delay and its lag; run backwards and forwards in time as one product of
spectra it is not causal, which a run that has ended allows. Only differences of e count: where the arm stood
when the run began is left to the feedback.

Source: D. A. Bristow, M. Tharayil, A. G. Alleyne, "A survey of iterative learning control", IEEE Control
Systems 26(3), 2006: the Q-filter and model inversion; differencing and bounds are ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from pc_client.control.learning_filter import LearningFilter
from pc_client.control.loop_model import LoopModel, frequency_response

Array = NDArray[np.float64]

_FADE = 0.05
"""Time over which what is learned fades in and out beside the stretches that stay quiet [s]."""


@dataclass(frozen=True, slots=True)
class RunSignals:
    """A finished run on the grid of control cycles, its first frame at index 0.

    Attributes:
        error: (n, 6) reference less reported position at each frame [rad].
        added: (n, 6) what was commanded beside the reference's own feed-forward: what was learned before, and
            the feedback [rad/s].
    """

    error: Array
    added: Array


@dataclass(frozen=True, slots=True)
class LearningBounds:
    """What a learned command may reach, whatever was measured.

    Attributes:
        speed: [rad/s].
        acceleration: change a second [rad/s2].
    """

    speed: float
    acceleration: float


def learn(
    run: RunSignals,
    loop: LoopModel,
    weight: LearningFilter,
    gain: float,
    bounds: LearningBounds,
    quiet: tuple[float, float],
    period: float,
) -> Array:
    """Compute what to add to the feed-forward of the next run.

    Args:
        run: the last run, complete and without gaps.
        loop: the identified loop.
        weight: Q.
        gain: of learning, 0..1.
        bounds: cut off what is beyond.
        quiet: stretches at the beginning and at the end of the run in which nothing is added, since the arm
            rests there [s].
        period: control cycle [s].

    Returns:
        (n, 6) velocities [rad/s], for the same frames of the next run.
    """
    n = len(run.error)
    slope = np.diff(run.error, axis=0, prepend=run.error[:1]) / period
    # Room for the loop's response, so that the end of the run does not come round to its beginning.
    n_padded = 1 << (n + 128).bit_length()
    hertz: Array = np.asarray(np.fft.rfftfreq(n_padded, period), dtype=np.float64)
    # Beyond the cut-off Q is zero; the inverse is not asked for there.
    used = weight.weight(hertz)
    inverse = np.zeros(len(hertz), dtype=np.complex128)
    passes = used > 0.0
    inverse[passes] = gain / frequency_response(loop, period, hertz[passes])
    spectrum = np.fft.rfft(run.added, n_padded, axis=0)
    spectrum += inverse[:, None] * np.fft.rfft(slope, n_padded, axis=0)
    learned = np.fft.irfft(used[:, None] * spectrum, n_padded, axis=0)[:n]
    return bounded(learned * _fade(n, quiet, period)[:, None], bounds, period)


def learnable_power(run: RunSignals, weight: LearningFilter, period: float) -> float:
    """Mean square of the differenced error [(rad/s)2], a joint, in the frequencies that are learned.

    Args:
        run: complete and without gaps.
        weight: Q.
        period: control cycle [s].
    """
    slope = np.diff(run.error, axis=0) / period
    hertz: Array = np.asarray(np.fft.rfftfreq(len(slope), period), dtype=np.float64)
    kept = np.fft.irfft(weight.weight(hertz)[:, None] * np.fft.rfft(slope, axis=0), len(slope), axis=0)
    return float(np.mean(np.square(kept)))


def bounded(learned: Array, bounds: LearningBounds, period: float) -> Array:
    """Keep a learned command (n, 6) within its bounds; it begins at 0."""
    step = bounds.acceleration * period
    wanted = np.clip(learned, -bounds.speed, bounds.speed)
    kept = np.zeros_like(wanted)
    last = np.zeros(wanted.shape[1])
    for k, row in enumerate(wanted):
        last = np.clip(row, last - step, last + step)
        kept[k] = last
    return kept


def _fade(n: int, quiet: tuple[float, float], period: float) -> Array:
    """Weights (n,): 0 in the quiet stretches at both ends, 1 between them."""
    since_first, until_last = np.arange(n) * period, np.arange(n)[::-1] * period
    inside = np.minimum(since_first - quiet[0], until_last - quiet[1])
    fade: Array = 0.5 * (1.0 - np.cos(pi * np.clip(inside / _FADE, 0.0, 1.0)))
    return fade
