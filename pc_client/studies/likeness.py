"""How human-like a movement is: four figures that need no model of the movement.

    sparc                    smoothness, from the spectrum of the speed: about -1.4 for one speed peak,
                             lower for a less smooth speed
    log_dimensionless_jerk   smoothness, from the second derivative of the speed: -5.3 for minimum jerk,
                             lower for a less smooth speed
    speed_peaks              number of speed peaks: one a stroke in human movements
    fit_power_law            beta in speed = k curvature^-beta: one third for drawing hands

Pure functions on samples at equal steps of time. None of them filters. Differentiation amplifies noise, so
measured signals are low-passed before (`signals.low_passed`).

Source: S. Balasubramanian et al., "On the analysis of movement smoothness", JNER 12:112 (2015), for the
first two; P. Viviani and F. Lacquaniti et al. for the two-thirds power law.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import find_peaks

from pc_client.arrays import Array
from pc_client.errors import ClientError

#: Fewest samples that a figure is computed from.
_MIN_SAMPLES = 8
#: A peak of the speed stands out by this share of the highest.
_PROMINENCE = 0.05


@dataclass(frozen=True, slots=True)
class Likeness:
    """How human-like a movement is.

    Attributes:
        peaks: of the speed.
        sparc: spectral arc length.
        log_jerk: log dimensionless jerk.
        exponent: beta of speed = k curvature^-beta; nan for a path of straight lines.
        r_squared: how well that law holds, 0 to 1; nan likewise.
    """

    peaks: float
    sparc: float
    log_jerk: float
    exponent: float
    r_squared: float


def sparc(speed: ArrayLike, rate: float, *, cutoff: float = 10.0) -> float:
    """The spectral arc length: minus the length of the speed's spectrum, drawn in a unit square.

    The amplitude spectrum is divided by its maximum; it counts from the first to the last frequency below
    the cutoff at which it reaches 5 %, and this range of frequencies is scaled to 1.

    Args:
        speed: (n,), any unit, n >= 8, not all zero.
        rate: samples a second, Hz.
        cutoff: highest frequency that is looked at, Hz.

    Returns:
        Below -1; the nearer to 0, the smoother. Figures compare only among movements of the same number of
        strokes.

    Raises:
        ClientError: the speed or the rate is not as above, or the spectrum has only one line.
    """
    values = _checked(speed, rate)
    size = 2 ** (math.ceil(math.log2(len(values))) + 4)  # longer than the signal, for a smooth curve
    frequency = np.fft.rfftfreq(size, 1.0 / rate)
    amplitude = np.abs(np.fft.rfft(values, size))
    amplitude /= amplitude.max()
    low = frequency <= cutoff
    frequency, amplitude = frequency[low], amplitude[low]
    reached = np.flatnonzero(amplitude >= 0.05)
    kept = slice(int(reached[0]), int(reached[-1]) + 1)
    frequency, amplitude = frequency[kept], amplitude[kept]
    if len(frequency) < 2:
        raise ClientError("a spectrum of one line has no arc length: give a longer signal or a higher cutoff")
    steps = np.hypot(np.diff(frequency) / (frequency[-1] - frequency[0]), np.diff(amplitude))
    return -float(steps.sum())


def log_dimensionless_jerk(speed: ArrayLike, rate: float) -> float:
    """LDJ = -ln(T^3 / v_peak^2 * integral of (d2v/dt2)^2 dt), T = n / rate, by second differences.

    A speed profile with corners has infinite jerk there. Its figure falls with the rate, so compare at equal
    rates only.

    Args:
        speed: (n,), any unit, n >= 8, not all zero: the movement from rest to rest. Rest before and after
            it counts in T.
        rate: samples a second, Hz.

    Returns:
        -ln 204.8 = -5.322 for one minimum-jerk stroke; inf for a constant speed.

    Raises:
        ClientError: the speed or the rate is not as above.
    """
    values = _checked(speed, rate)
    jerk = np.diff(values, 2) * rate**2
    duration = len(values) / rate
    cost = duration**3 / float(values.max()) ** 2 * float(jerk @ jerk) / rate
    return -math.log(cost) if cost > 0.0 else math.inf


def peaks_of(speed: ArrayLike) -> list[int]:
    """Samples, in order, at which the speed (n,) has a peak; of a plateau the first of its highest samples.

    A peak counts when the speed has risen by 5 % of the highest from the dip before it and falls by as much
    after it.
    """
    values = np.asarray(speed, dtype=np.float64)
    step = _PROMINENCE * float(values.max(initial=0.0))
    if step <= 0.0:
        return []
    # The signal comes from rest and goes to rest, so a movement cut off at its top speed has a peak there.
    # The slope makes the first of equal samples the highest, and is more than their rounding.
    slope = np.linspace(0.0, 1e-9 * step, len(values))
    found, _ = find_peaks(np.concatenate(([0.0], values - slope, [0.0])), prominence=step)
    return [int(peak) - 1 for peak in found]


def speed_peaks(speed: ArrayLike) -> int:
    """How many peaks the speed has, as `peaks_of` counts them."""
    return len(peaks_of(speed))


def between_peaks(speed: ArrayLike) -> slice:
    """The samples from the first to the last peak of the speed."""
    peaks = peaks_of(speed)
    return slice(peaks[0], peaks[-1] + 1) if peaks else slice(0, 0)


class PowerLawFit(NamedTuple):
    """speed = gain curvature^-exponent through the logarithms, and how well it holds.

    Attributes:
        exponent: beta; nan when the path has no bend to fit.
        r_squared: share of the variance of ln speed that the power law explains, 0 to 1; nan likewise.
    """

    exponent: float
    r_squared: float


def fit_power_law(v: ArrayLike, a: ArrayLike, *, max_radius: float = 1.0) -> PowerLawFit:
    """Fit ln speed = ln k - beta ln curvature by least squares over the samples.

    Noise alone makes the curvature high where the speed is low, which looks like a power law. So look at
    r_squared too, and low-pass measured signals first. Samples slower than a tenth of the top speed are left
    out: starts and stops do not follow the power law.

    Args:
        v: velocities, (n, 3), m/s, at equal steps of time.
        a: accelerations, (n, 3), m/s^2.
        max_radius: samples on a path straighter than this radius (m) are left out: the curvature of a line
            is nearly zero.
    """
    velocity, acceleration = np.asarray(v, dtype=np.float64), np.asarray(a, dtype=np.float64)
    speed = np.linalg.norm(velocity, axis=1)
    moving = speed > 0.1 * speed.max(initial=0.0)
    across = np.linalg.norm(np.cross(velocity, acceleration), axis=1)
    curvature = np.divide(across, speed**3, out=np.zeros_like(speed), where=moving)
    used = curvature > 1.0 / max_radius
    n_used = int(np.count_nonzero(used))
    if n_used < _MIN_SAMPLES:
        return PowerLawFit(math.nan, math.nan)
    x, y = np.log(curvature[used]), np.log(speed[used])
    x, y = x - x.mean(), y - y.mean()
    spread, total = float(x @ x), float(y @ y)
    if spread < 1e-12 * n_used:  # one radius everywhere: any exponent would do
        return PowerLawFit(math.nan, math.nan)
    slope = float(x @ y) / spread
    return PowerLawFit(-slope, slope**2 * spread / total if total > 0.0 else math.nan)


def _checked(speed: ArrayLike, rate: float) -> Array:
    values = np.asarray(speed, dtype=np.float64)
    if not (math.isfinite(rate) and rate > 0.0):
        raise ClientError(f"rate of {rate} Hz: give a number greater than 0")
    if values.ndim != 1 or len(values) < _MIN_SAMPLES or not np.all(np.isfinite(values)):
        raise ClientError(
            f"speed of shape {values.shape}: give at least {_MIN_SAMPLES} finite samples in a row"
        )
    if not values.max() > 0.0:
        raise ClientError("a speed that is zero everywhere has no smoothness: give a movement")
    return values
