"""From irregular samples to the signal that the strokes are compared with.

Three steps, in this order:

    1. interpolation onto a uniform grid of 200 Hz (finer first where the recording itself is finer),
    2. a zero-phase low-pass at 12 Hz: a Butterworth filter of order 4, run forwards and backwards,
    3. the derivative of the cubic spline through the result: the velocity (`signals.velocity`).

The movement of a hand has little above 10 Hz; higher frequencies come from the recorder (quantised positions,
late time stamps). The filter must not shift anything in time, hence forwards and backwards. At its ends a
part is continued by point reflection, so that the first and the last position stay where they are and a part
may start and end in full motion.

Source: docs/extraction.md, section 3; 12 Hz as is usual for signatures.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.signal import find_peaks

from pc_client.arrays import Array, read_only
from pc_client.studies.extraction.pen import PenPart
from pc_client.studies.signals import Trace, low_passed, velocity

#: Uniform rate of the signal, Hz.
RATE_HZ = 200.0
#: Cut-off of the low-pass, Hz. Run forwards and backwards the filter halves the amplitude there (-6 dB).
CUTOFF_HZ = 12.0
#: A local maximum of the speed is a peak when it stands out by this share of the part's top speed.
_PROMINENCE = 0.01
#: A part shorter than this, s, holds no movement that a 12 Hz signal could distinguish from a touch.
_MIN_DURATION_S = 0.02

#: A part smaller than this stands still, even if its unit is the metre.
_MIN_EXTENT = 1e-5

_ORDER = 4
#: The impulse response has decayed (to 1e-6) after this time, s.
_SETTLED_S = 0.5
#: A time step is steady within this factor of the typical one; a clock can be trusted with this share of
#: steady steps, and a curve can be drawn through so many of them.
_STEADY_RATIO = 2.0
_STEADY_SHARE = 0.9
_LEAST_STEPS = 3
#: A curve that leaves the straight lines by more than this share of the run's size is not drawn: it swings
#: between samples that are too few, or too far from even, to show where the pen was.
_MOST_SWING = 0.5
_ROUNDING = 1e-9
_MAX_OVERSAMPLING = 16


def moves(part: PenPart) -> bool:
    """Whether a part holds a movement; a touch, a dot or a single sample does not."""
    return len(part.t) >= 2 and part.duration >= _MIN_DURATION_S and part.extent > _MIN_EXTENT


def smooth_part(part: PenPart) -> Trace:
    """The low-passed signal of a part that moves.

    The grid's step is stretched by the few per mille that let it end at the last sample.
    """
    n_steps = max(4, round(part.duration * RATE_HZ))
    sample_rate = (len(part.t) - 1) / part.duration
    oversampling = min(_MAX_OVERSAMPLING, max(1, math.ceil(sample_rate / RATE_HZ)))
    fine = np.linspace(part.t[0], part.t[-1], n_steps * oversampling + 1)
    filtered = less_noise(_interpolated(part, fine), RATE_HZ * oversampling)
    t, p = fine[::oversampling], filtered[::oversampling]
    return Trace(read_only(t), read_only(p), read_only(velocity(t, p)))


def speed_peaks(part: Trace) -> NDArray[np.intp]:
    """Indices of the local maxima of the speed inside a part, (n_peaks,).

    All of them count that rise by more than `_PROMINENCE` of the part's top speed above the higher of the two
    valleys beside them. The first and the last sample are no maxima, however high.
    """
    peaks: NDArray[np.intp]
    peaks, _ = find_peaks(part.speed, prominence=_PROMINENCE * float(part.speed.max()))
    return peaks


def _interpolated(part: PenPart, t: Array) -> Array:
    """Positions at the times t: cubic splines where the clock is steady, straight lines elsewhere.

    A cubic spline is exact to the fourth order, but swings out where two time stamps lie close together and
    the clock is not to be trusted, or where few samples jump. There only the straight line is known
    between two samples.
    """
    points: Array = make_interp_spline(part.t, part.p, k=1)(t)
    steps = np.diff(part.t)
    typical = float(np.median(steps))
    steady = (steps > typical / _STEADY_RATIO) & (steps < typical * _STEADY_RATIO)
    if np.mean(steady) < _STEADY_SHARE:
        return points
    breaks = np.flatnonzero(~steady)
    for first, last in zip([0, *(breaks + 1)], [*breaks, len(steps)], strict=True):
        if last - first >= _LEAST_STEPS:
            inside = (t >= part.t[first]) & (t <= part.t[last])
            run = slice(first, last + 1)
            curve = CubicSpline(part.t[run], part.p[run])(t[inside])
            most = _MOST_SWING * np.ptp(part.p[run], axis=0) + _ROUNDING
            if np.all(np.abs(curve - points[inside]) <= most):
                points[inside] = curve
    return points


def less_noise(p: Array, rate: float) -> Array:
    """Positions (n, dim) at a uniform rate (Hz), low-passed at 12 Hz."""
    # A straight line passes as it is; without it the filter starts and ends nearly at rest.
    line = np.linspace(p[0], p[-1], len(p))
    # A part may be shorter than the filter takes to settle: then it is reflected again and again.
    padding = math.ceil(_SETTLED_S * rate)
    low: Array = line + low_passed(
        p - line, rate, cutoff=CUTOFF_HZ, order=_ORDER, padding=padding, ends="reflected"
    )
    return low
