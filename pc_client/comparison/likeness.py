"""The figures of one signal: what `analysis.human_likeness` says of a movement, in one record."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pc_client.analysis.human_likeness import (
    between_peaks,
    fit_power_law,
    log_dimensionless_jerk,
    sparc,
    speed_peaks,
)
from pc_client.movements.stroke import Motion

__all__ = ["Likeness", "measure_likeness"]


@dataclass(frozen=True, slots=True)
class Likeness:
    """How human-like a signal is.

    Attributes:
        sparc: spectral arc length.
        log_jerk: log dimensionless jerk.
        peaks: peaks of the speed, a mean over movements where there are several.
        exponent: beta of speed = k curvature^-beta between the first and the last peak of the speed; nan for
            a path of straight lines.
        r_squared: how well that law holds, 0 to 1; nan likewise.
        peak_speed: m/s.
        peak_acceleration: m/s^2.
    """

    sparc: float
    log_jerk: float
    peaks: float
    exponent: float
    r_squared: float
    peak_speed: float
    peak_acceleration: float


def measure_likeness(motion: Motion, rate: float) -> Likeness:
    """Measure a movement from start to end.

    Args:
        motion: at equal steps, each (n, 3); filtered if it was measured.
        rate: samples a second, Hz.
    """
    speed = np.linalg.norm(motion.v, axis=1)
    inner = between_peaks(speed)
    law = fit_power_law(motion.v[inner], motion.a[inner])
    return Likeness(
        sparc=sparc(speed, rate),
        log_jerk=log_dimensionless_jerk(speed, rate),
        peaks=float(speed_peaks(speed)),
        exponent=law.exponent,
        r_squared=law.r_squared,
        peak_speed=float(speed.max()),
        peak_acceleration=float(np.linalg.norm(motion.a, axis=1).max()),
    )
