"""What one run teaches the next: iterative learning control of one movement, joint by joint.

The last run was driven by its whole command u = feed-forward + learned + feedback, and left the error e. The
next run begins with what the feedback had to add, and with the command that would have made e zero:

    c_next = Q [ (u - feed-forward) + gain P_model^-1 (differenced e) ]

The inverse of the loop takes back its delay and its lag; run backwards and forwards in time as one product of
spectra it is not causal, which a run that has ended allows. Only differences of e count: where the arm stood
when the run began is left to the feedback.

From one run to the next what is learned comes nearer to where it settles, at each frequency, by the factor

    |Q (1 - gain P / P_model) S|  <  1

where P is the real loop, P_model the identified one, and S = 1 / (1 + P C) what the feedback C leaves of an
error. Q is real, so it shifts nothing. It is 1 below a cut-off that two facts set, neither of which knows the
movement: how well the loop is known, and how much sensor noise would be learned with the error.

Source: D. A. Bristow, M. Tharayil, A. G. Alleyne, "A survey of iterative learning control", IEEE Control
Systems 26(3), 2006: the Q-filter and model inversion; differencing and bounds are ours.
"""

from dataclasses import dataclass, replace
from math import pi, sin

import numpy as np

from pc_client.arrays import Array
from pc_client.control.controller import Controller
from pc_client.control.loop import SAMPLING_TIME, frequency_response, sensitivity
from pc_client.control.reference import LEAD, SETTLE, RunRecipe

_WORST_MISMATCH = 0.5
"""Largest |1 - P / P_model| at the cut-off: at least half of what repeats is gone after each run."""

_NOISE_SHARE = 0.10
"""Share of the noise of the differenced position that may be learned: costs 10 log10(1.1) = 0.4 dB."""

_ROLL_OFF = 0.25
"""Q falls from 1 to 0 between (1 - this) and (1 + this) times the cut-off."""


@dataclass(frozen=True, slots=True)
class LearningFilter:
    """The weight Q, and what it promises.

    Attributes:
        cut_off: middle of the roll-off [Hz].
        limited_by: what set it, "loop" or "noise".
        contraction: the largest of these factors, over all frequencies and all loops within the model's
            spread; below 1 learning converges without ever growing.
        noise_share: share of the differenced position's white noise that passes Q.
    """

    cut_off: float
    limited_by: str
    contraction: float
    noise_share: float

    def weight(self, hertz: Array) -> Array:
        """Q at frequencies (m,) [Hz], (m,)."""
        low, high = (1.0 - _ROLL_OFF) * self.cut_off, (1.0 + _ROLL_OFF) * self.cut_off
        x = np.clip((hertz - low) / (high - low), 0.0, 1.0)
        return 0.5 * (1.0 + np.cos(pi * x))


def design_filter(recipe: RunRecipe) -> LearningFilter:
    """Choose Q for the identified loop and the controller of a recipe.

    Returns:
        The filter; `contraction` of 1 or more means that this loop must not learn.
    """
    loop, period, own = recipe.loop, recipe.period, recipe.controller
    hertz = np.linspace(0.0, 0.5 / period, 501)[1:-1]
    model = frequency_response(loop, period, hertz)
    ratios = [frequency_response(real, period, hertz) / model for real in loop.corners()]
    mismatch = np.max([np.abs(1.0 - ratio) for ratio in ratios], axis=0)
    beyond = np.flatnonzero(mismatch > _WORST_MISMATCH)
    by_loop = float(hertz[beyond[0]]) if len(beyond) else float(hertz[-1])
    shares = np.array([noise_share_below(x, period) for x in hertz])
    by_noise = float(np.interp(_NOISE_SHARE, shares, hertz))
    cut_off = min(by_loop, by_noise)
    unchecked = LearningFilter(cut_off, "loop" if by_loop < by_noise else "noise", 1.0, 1.0)
    weight = unchecked.weight(hertz)
    factors = [
        np.abs(
            weight
            * (1.0 - own.learning_gain * ratio)
            * sensitivity(real, own.gain_p, own.gain_i, period, hertz)
        )
        for real, ratio in zip(loop.corners(), ratios, strict=True)
    ]
    density = 1.0 - np.cos(2.0 * pi * hertz * max(SAMPLING_TIME, period))
    return replace(
        unchecked,
        contraction=float(np.max(factors)),
        noise_share=float((np.square(weight) * density).sum() / density.sum()),
    )


def noise_share_below(hertz: float, period: float) -> float:
    """Share of the power of a differenced white noise that lies below a frequency [Hz].

    The difference of a white noise over T has the density 1 - cos(w T), up to half the frame rate; integrated
    from 0 to w.
    """
    over = max(SAMPLING_TIME, period)
    angle = 2.0 * pi * hertz * over
    return (angle - sin(angle)) / (pi * (over / period))


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


_QUIET = 0.5 * LEAD, 0.5 * SETTLE


def learn(
    run: RunSignals, recipe: RunRecipe, weight: LearningFilter, quiet: tuple[float, float] = _QUIET
) -> Array:
    """Compute what to add to the feed-forward of the next run.

    Args:
        run: the last run, complete and without gaps.
        recipe: of that run: its loop, and how much its controller may learn.
        weight: Q.
        quiet: stretches at the beginning and at the end of the run in which nothing is added, since the arm
            rests there [s].

    Returns:
        (n, 6) velocities [rad/s], for the same frames of the next run.
    """
    n, period = len(run.error), recipe.period
    slope = np.diff(run.error, axis=0, prepend=run.error[:1]) / period
    # Room for the loop's response, so that the end of the run does not come round to its beginning.
    n_padded = 1 << (n + 128).bit_length()
    hertz: Array = np.asarray(np.fft.rfftfreq(n_padded, period), dtype=np.float64)
    # Beyond the cut-off Q is zero; the inverse is not asked for there.
    used = weight.weight(hertz)
    inverse = np.zeros(len(hertz), dtype=np.complex128)
    passes = used > 0.0
    inverse[passes] = recipe.controller.learning_gain / frequency_response(recipe.loop, period, hertz[passes])
    spectrum = np.fft.rfft(run.added, n_padded, axis=0)
    spectrum += inverse[:, None] * np.fft.rfft(slope, n_padded, axis=0)
    learned = np.fft.irfft(used[:, None] * spectrum, n_padded, axis=0)[:n]
    # 0 in the quiet stretches at both ends, 1 between them.
    t = np.arange(n) * period
    inside = np.minimum(t - quiet[0], t[::-1] - quiet[1])
    fade = 0.5 * (1.0 - np.cos(pi * np.clip(inside / _FADE, 0.0, 1.0)))
    return bounded(learned * fade[:, None], recipe.controller, period)


def learnable_power(run: RunSignals, weight: LearningFilter, period: float) -> float:
    """Mean square of the differenced error [(rad/s)2], a joint, in the frequencies that are learned."""
    slope = np.diff(run.error, axis=0) / period
    hertz: Array = np.asarray(np.fft.rfftfreq(len(slope), period), dtype=np.float64)
    kept = np.fft.irfft(weight.weight(hertz)[:, None] * np.fft.rfft(slope, axis=0), len(slope), axis=0)
    return float(np.mean(np.square(kept)))


def bounded(learned: Array, config: Controller, period: float) -> Array:
    """Keep a learned command (n, 6) within the bounds of a controller, whatever was measured; from 0 on."""
    step = config.learning_acceleration * period
    wanted = np.clip(learned, -config.learning_speed, config.learning_speed)
    kept = np.zeros_like(wanted)
    last = np.zeros(wanted.shape[1])
    for k, row in enumerate(wanted):
        last = np.clip(row, last - step, last + step)
        kept[k] = last
    return kept
