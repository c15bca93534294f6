"""Which part of an error is learned: the weight Q over frequency, and the proof that learning converges.

From one run to the next what is learned comes nearer to where it settles, at each frequency, by the factor

    |Q (1 - gain P / P_model) S|  <  1

where P is the real loop, P_model the identified one, and S = 1 / (1 + P C) what the feedback C leaves of an
error. Q is real, so the filter shifts nothing. It is 1 below a cut-off that two facts set, neither of which
knows the movement: how well the loop is known, and how much sensor noise would be learned with the error.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi, sin

import numpy as np
from numpy.typing import NDArray

from pc_client.control.loop_model import SAMPLING_TIME, LoopModel, frequency_response
from pc_client.control.stability import sensitivity

Array = NDArray[np.float64]

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
        weight: Array = 0.5 * (1.0 + np.cos(pi * x))
        return weight


def design_filter(
    loop: LoopModel, period: float, *, learning_gain: float, gain_p: float, gain_i: float
) -> LearningFilter:
    """Choose Q for an identified loop.

    Args:
        loop: with its spread.
        period: control cycle [s].
        learning_gain: 0..1.
        gain_p: of the feedback [1/s].
        gain_i: of the feedback [1/s2].

    Returns:
        The filter; `contraction` of 1 or more means that this loop must not learn.
    """
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
        np.abs(weight * (1.0 - learning_gain * ratio) * sensitivity(real, gain_p, gain_i, period, hertz))
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
