"""One filter for what was planned and what was measured, so that both can be differentiated and compared.

The second derivative of the speed is the third of the position: the encoders' noise, some micrometres at
the TCP, would drown it. A Butterworth filter of second order is run forwards and backwards over the
positions, which shifts nothing in time and halves the amplitude at 5 Hz. Of noise of 5 micrometres it
leaves less than .05 m/s^3, where executed movements have .3 to 6; what is lost are the corners of
trapezoids, and they are lost from the plan, too. 5 Hz is far above the movements themselves: the speed
profiles of a robot's strokes last a second or more.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from pc_client.errors import ClientError
from pc_client.movements.stroke import Motion

__all__ = ["CUTOFF_HZ", "FILTER_TEXT", "filtered_motion"]

#: Frequency (Hz) at which the filter halves an amplitude. One number for all movements and robots.
CUTOFF_HZ = 5.0
_ORDER = 2
#: What the filter is, for tables.
FILTER_TEXT = f"Butterworth order {_ORDER}, forwards and backwards, half amplitude at {CUTOFF_HZ:g} Hz"


def filtered_motion(p: NDArray[np.float64], rate: float) -> Motion:
    """Smoothed positions and their first two central differences.

    Args:
        p: positions, (n, 3), m, at equal steps, at rest for the first and the last few tenths of a second.
        rate: samples a second, Hz, more than twice the cutoff.

    Returns:
        Position, velocity and acceleration, each (n, 3).
    """
    if not (math.isfinite(rate) and rate > 2.0 * CUTOFF_HZ):
        raise ClientError(
            f"rate of {rate} Hz: a filter at {CUTOFF_HZ:g} Hz needs more than "
            f"{2.0 * CUTOFF_HZ:g} samples a second"
        )
    sections = butter(_ORDER, CUTOFF_HZ, fs=rate, output="sos")
    # The rests at both ends are long enough to be continued as they are.
    smooth = sosfiltfilt(sections, p, axis=0, padtype="constant", padlen=min(len(p) - 1, round(rate)))
    v = np.gradient(smooth, 1.0 / rate, axis=0)
    return Motion(smooth, v, np.gradient(v, 1.0 / rate, axis=0))
