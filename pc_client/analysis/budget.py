"""Where the signal-to-noise ratio is lost: the power of the speed error, cut into parts that add up to it.

    delay           what the best time shift takes away
    scale and ramp  what is left of it, as far as it is a constant times the reference speed (too fast, too
                    slow) plus a constant times its second derivative (corners rounded off)
    slow rest       below 6 Hz, less the noise: friction, settling, limits of acceleration, slow gear ripple
    fast rest       above 6 Hz, less the noise: gear ripple (101 cycles a joint turn pass 6 Hz at 0.4 rad/s),
                    jitter of the command stream
    noise           what the differenced position shows at rest, turned into noise of the speed: its variance
                    is taken from the fast rest, what it adds to the mean of the speed near rest from the slow

Each part is the drop in mean square error from one step to the next, so no part is counted twice. What is
measured is the correlation with these shapes, not a cause: a cause that looks like a delay is in `delay`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pc_client.analysis.metrics import rest_noise
from pc_client.analysis.snr import shifted_pair
from pc_client.analysis.speed_noise import speed_noise
from pc_client.analysis.track import ShiftedReference, TcpTrack, speed, velocity
from pc_client.recording.recording import Recording

SPLIT_HZ = 6.0
PARTS = ("delay", "scale and ramp", "slow rest", "fast rest", "noise")


@dataclass(frozen=True, slots=True)
class Budget:
    """Error power of one run by part.

    Attributes:
        signal_power: mean square of the reference speed, (m/s)^2.
        error_power: mean square of the speed error, (m/s)^2; the sum of the parts.
        parts: (m/s)^2 by name, in the order of `PARTS`.
    """

    signal_power: float
    error_power: float
    parts: Mapping[str, float]

    def share(self, part: str) -> float:
        """Return the part's share of the error power, 0..1."""
        return self.parts[part] / self.error_power if self.error_power > 0.0 else 0.0

    def alone_db(self, part: str) -> float:
        """Return the SNR in dB that would be reached if this part were the only error."""
        power = self.parts[part]
        return 10.0 * math.log10(self.signal_power / power) if power > 0.0 < self.signal_power else math.inf


def error_budget(recording: Recording, track: TcpTrack, lag_s: float) -> Budget:
    """Cut the power of the speed error of one run into its parts.

    Args:
        recording: the run.
        track: its TCP path.
        lag_s: best time shift of the scalar speed.
    """
    steps = track.movement_steps
    ref_speed = speed(track.t, track.p_ref)[steps]
    error_power = _power(speed(track.t, track.p_actual)[steps] - ref_speed)

    reference, actual = shifted_pair(track, ShiftedReference(track), lag_s, speed)
    cycle = float(np.median(np.diff(track.t)))
    error = actual - reference
    after_shift = min(_power(error), error_power)
    shapes = np.column_stack([reference, np.gradient(np.gradient(reference, cycle), cycle)])
    scales = np.linalg.norm(shapes, axis=0)
    scales[scales == 0.0] = 1.0
    weights = np.linalg.lstsq(shapes / scales, error, rcond=None)[0]
    rest = error - shapes / scales @ weights
    after_shape = min(_power(rest), after_shift)

    fast = min(_power_above(rest, SPLIT_HZ * cycle), after_shape)
    slow = after_shape - fast
    noise_slow, noise_fast = _noise_of_speed(recording, track)
    noise_slow, noise_fast = min(noise_slow, slow), min(noise_fast, fast)
    parts = (
        error_power - after_shift,
        after_shift - after_shape,
        slow - noise_slow,
        fast - noise_fast,
        noise_slow + noise_fast,
    )
    return Budget(_power(ref_speed), error_power, dict(zip(PARTS, parts, strict=True)))


def _power(signal: NDArray[np.float64]) -> float:
    return float(np.mean(np.square(signal)))


def _power_above(signal: NDArray[np.float64], cycles_per_sample: float) -> float:
    """Return the mean square of the part of a signal above a frequency (Parseval)."""
    n = len(signal)
    power = np.square(np.abs(np.fft.rfft(signal))) / n**2
    power[1 : (n + 1) // 2] *= 2.0  # all but 0 and Nyquist stand for two conjugate lines
    return float(power[np.fft.rfftfreq(n) > cycles_per_sample].sum())


def _noise_of_speed(recording: Recording, track: TcpTrack) -> tuple[float, float]:
    """Return what noise at rest adds to the power of the speed error: by its mean, slow, and its variance."""
    covariance = rest_noise(recording, track)
    if covariance is None:
        return 0.0, 0.0
    v = velocity(track.t, track.p_ref)[track.movement_steps]
    mean, variance = speed_noise(v, covariance)
    return _power(mean), float(np.mean(variance))
