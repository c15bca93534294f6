"""The figures of a movement: how long, how fast, how large, and what a delayed arm would make of it."""

import math
from typing import Any

import numpy as np
from scipy.integrate import trapezoid

from pc_client.arrays import Array
from pc_client.errors import MovementError
from pc_client.movements.movement import Movement
from pc_client.movements.sigma_lognormal import SigmaLognormal

#: Loop delays (s) for which the expected SNR is given: command to motion alone, and the whole loop, of an
#: emulated CB3 arm.
_DELAYS = (0.020, 0.028)
_N_SAMPLES = 8001


def describe(movement: Movement) -> dict[str, Any]:
    """Figures of a movement, in SI units named by their keys: plain numbers and lists, ready for JSON."""
    figures = outline(movement) | {
        "speed_rms_frequency_rad_s": speed_rms_frequency(movement),
        "expected_snr_db": {f"{1e3 * delay:.0f} ms": snr_of_delay(movement, delay) for delay in _DELAYS},
        "expected_vector_snr_db": {
            f"{1e3 * delay:.0f} ms": snr_of_delay(movement, delay, vector=True) for delay in _DELAYS
        },
        "provenance": dict(movement.provenance),
    }
    if isinstance(movement.trajectory, SigmaLognormal):
        figures["strokes"] = _describe_strokes(movement.trajectory)
    return figures


def outline(movement: Movement) -> dict[str, Any]:
    """The first figures of `describe`: kind, size, duration and speed."""
    t = np.linspace(0.0, movement.duration, _N_SAMPLES)
    motion = movement.motion(t)
    speed = movement.speed(t)
    return {
        "name": movement.name,
        "kind": movement.kind,
        "duration_s": movement.duration,
        "n_target_points": len(movement.target_points),
        "stroke_durations_s": movement.stroke_durations.tolist(),
        "path_length_m": float(trapezoid(speed, t)),
        "peak_speed_m_s": float(speed.max()),
        "peak_acceleration_m_s2": float(np.linalg.norm(motion.a, axis=1).max()),
        "begin_speed_m_s": float(speed[0]),
        "end_speed_m_s": float(speed[-1]),
        "box_low_m": motion.p.min(axis=0).tolist(),
        "box_high_m": motion.p.max(axis=0).tolist(),
    }


def speed_rms_frequency(movement: Movement) -> float:
    """The rms angular frequency w (rad/s) of the speed: w^2 = integral of (dv/dt)^2 / integral of v^2.

    A delay tau that is short against 1 / w costs SNR = -20 log10(tau w).
    """
    t = np.linspace(0.0, movement.duration, _N_SAMPLES)
    speed = movement.speed(t)
    change = np.gradient(speed, t)
    return math.sqrt(float(change @ change) / float(speed @ speed))


def snr_of_delay(movement: Movement, delay: float, *, vector: bool = False) -> float:
    """SNR (dB, Eq. 10) of the movement against itself `delay` s later: a perfect arm with that delay.

    Args:
        movement: begins and ends at rest.
        delay: s, > 0.
        vector: on the velocity vector instead of the scalar speed.
    """
    if not (math.isfinite(delay) and delay > 0.0):
        raise MovementError(f"delay of {delay} s: give a number greater than 0")
    t = np.linspace(0.0, movement.duration + delay, _N_SAMPLES)

    def signal(times: Array) -> Array:
        return movement.sample(times).v.ravel() if vector else movement.speed(times)

    desired = signal(t)
    error = signal(t - delay) - desired
    return 10.0 * math.log10(float(desired @ desired) / float(error @ error))


def _describe_strokes(trajectory: SigmaLognormal) -> list[dict[str, float]]:
    described = []
    for stroke, length in zip(trajectory.strokes, trajectory.lengths.tolist(), strict=True):
        lognormal = stroke.timing.lognormal
        described.append(
            {
                "t0_s": lognormal.t0,
                "mu": lognormal.mu,
                "sigma": lognormal.sigma,
                "length_m": length,
                "arc_angle_rad": stroke.arc_angle,
                "tilt_rad": stroke.tilt,
                "mode_s": lognormal.mode,
                "skewness": lognormal.skewness,
                "kurtosis": lognormal.kurtosis,
                "peak_speed_m_s": length * lognormal.peak,
            }
        )
    return described
