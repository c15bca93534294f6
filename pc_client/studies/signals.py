"""What all studies use: a movement as samples, its velocity, the low-pass, and the decibel."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from pc_client.arrays import Array


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """A movement, or a part of it, as samples at equal steps of time.

    Attributes:
        t: times, (n,), s.
        p: positions, (n, 2) or (n, 3).
        v: velocities, the same shape, per second.
    """

    t: Array
    p: Array
    v: Array

    @property
    def step(self) -> float:
        """Distance of the times, s."""
        return float(self.t[1] - self.t[0])

    @property
    def duration(self) -> float:
        """From the first sample to the last, s."""
        return float(self.t[-1] - self.t[0])

    @property
    def speed(self) -> Array:
        """Length of the velocity, (n,)."""
        length: Array = np.sqrt(np.einsum("ij,ij->i", self.v, self.v))
        return length


def decibels(signal: float, noise: float) -> float:
    """10 log10 of a signal's power over that of the noise, dB; nan where there is no signal.

    The noise has a floor at the rounding of the signal: 300 dB is the most.
    """
    return 10.0 * math.log10(signal / max(noise, 1e-30 * signal)) if signal > 0.0 else math.nan


def velocity(t: Array, p: Array) -> Array:
    """The derivative of the cubic spline through positions p (n, dim) at the times t (n,), (n, dim) per s."""
    derivative: Array = CubicSpline(t, p)(t, 1)
    return derivative


def low_passed(
    p: Array, rate: float, *, cutoff: float, order: int, padding: int, ends: Literal["rest", "reflected"]
) -> Array:
    """Low-pass positions by a Butterworth filter, run forwards and backwards so that nothing shifts in time.

    Args:
        p: positions at equal steps of time, (n, dim).
        cutoff: frequency that keeps half of its amplitude (-6 dB), Hz.
        order: of the filter, before it is doubled by the way back.
        padding: samples by which the positions are continued at both ends, so that the filter has settled.
        ends: how they are continued: "rest" at the first and the last position, or "reflected" in these
            points, as if the movement went on.
    """
    widths = ((padding, padding), (0, 0))
    if ends == "rest":
        continued = np.pad(p, widths, mode="edge")
    else:
        continued = np.pad(p, widths, mode="reflect", reflect_type="odd")
    filtered = sosfiltfilt(_sections(order, cutoff, rate), continued, axis=0, padtype=None, padlen=0)
    low: Array = filtered[padding : padding + len(p)]
    return low


@lru_cache(maxsize=32)
def _sections(order: int, cutoff: float, rate: float) -> Array:
    sections: Array = butter(order, cutoff, fs=rate, output="sos")
    return sections
