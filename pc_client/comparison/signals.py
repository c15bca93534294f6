"""The signals of one movement: as planned, as planned but sampled and filtered, as executed; their figures.

The last two go through the same steps (sampled at the control cycle with some rest at both ends, filtered,
differentiated), so that they differ by what the robot did and by nothing else.

One filter serves what was planned and what was measured, so that both can be differentiated and compared.
The second derivative of the speed is the third of the position: the encoders' noise, some micrometres at
the TCP, would drown it. A Butterworth filter of second order is run forwards and backwards over the
positions, which shifts nothing in time and halves the amplitude at 5 Hz. Of noise of 5 micrometres it
leaves less than .05 m/s^3, where executed movements have .3 to 6; what is lost are the corners of
trapezoids, and they are lost from the plan, too. 5 Hz is far above the movements themselves: the speed
profiles of a robot's strokes last a second or more.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from pc_client.analysis.human_likeness import (
    between_peaks,
    fit_power_law,
    log_dimensionless_jerk,
    sparc,
    speed_peaks,
)
from pc_client.analysis.run import MeasuredRun
from pc_client.control.loop_model import SAMPLING_TIME
from pc_client.errors import ClientError
from pc_client.movements.movement import Movement
from pc_client.movements.sigma_lognormal import Motion

__all__ = [
    "CUTOFF_HZ",
    "FILTER_TEXT",
    "PLAN_RATE",
    "Likeness",
    "Signal",
    "executed_signal",
    "filtered_motion",
    "filtered_signal",
    "measure_likeness",
    "planned_signal",
]

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


#: Samples a second (Hz) of the plan: the rate of the reference figures.
PLAN_RATE = 1000.0
#: Rest (s) before and after a movement that is filtered with it.
_REST = 0.2


@dataclass(frozen=True, slots=True)
class Signal:
    """A movement as samples, from start to end.

    Attributes:
        t: (n,), s since its start.
        motion: each (n, 3).
        rate: samples a second, Hz.
    """

    t: NDArray[np.float64]
    motion: Motion
    rate: float

    @property
    def speed(self) -> NDArray[np.float64]:
        """(n,), m/s."""
        speed: NDArray[np.float64] = np.linalg.norm(self.motion.v, axis=1)
        return speed


def planned_signal(movement: Movement) -> Signal:
    """The movement's own closed form, at 1 kHz, unfiltered."""
    t = np.arange(math.floor(movement.duration * PLAN_RATE + 1e-6) + 1) / PLAN_RATE
    return Signal(t, movement.motion(t), PLAN_RATE)


def filtered_signal(movement: Movement, rate: float) -> Signal:
    """The plan as a perfect robot would report it, through the filter.

    Args:
        movement: what was planned.
        rate: of the control cycle, Hz.
    """
    t = _grid(movement.duration, rate)
    return _inner(t, filtered_motion(movement.sample(t).p, rate), movement.duration, rate)


def sampling_rate(run: MeasuredRun) -> float:
    """Samples a second of the track of a run, Hz."""
    return 1.0 / max(run.provenance.cycle_time_s, SAMPLING_TIME)


def executed_signal(run: MeasuredRun, duration: float) -> Signal:
    """What the robot did, through the filter.

    The window is that of the plan, later by the robot's lag, so that a late robot is not cut off.

    Args:
        run: a recording and what was measured on it.
        duration: of the movement, s.
    """
    rate = sampling_rate(run)
    t = _grid(duration, rate)
    at = t + run.track.t_begin + run.snr.speed_lag_s
    # Frames come on the same grid but for the lag, which is no whole number of cycles.
    p = CubicSpline(run.track.t, run.track.p_actual)(np.clip(at, run.track.t[0], run.track.t[-1]))
    return _inner(t, filtered_motion(p, rate), duration, rate)


def _grid(duration: float, rate: float) -> NDArray[np.float64]:
    before, after = round(_REST * rate), round((duration + _REST) * rate)
    return np.arange(-before, after + 1) / rate


def _inner(t: NDArray[np.float64], motion: Motion, duration: float, rate: float) -> Signal:
    moving = (t >= -1e-9) & (t <= duration + 1e-9)
    return Signal(t[moving], Motion(*(values[moving] for values in motion)), rate)


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
