"""Errors of one run in the units people think in: millimetres, milliseconds, milliradians.

All of them come from what the robot reports; a calibration error that the robot does not know of is not in
them. A constant offset between the client's nominal arm and the robot's calibrated one is: it is measured and
taken out under its own name, never silently.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pc_client.analysis.track import ShiftedReference, TcpTrack, velocity
from pc_client.recording.recording import Recording
from pc_client.recording.rows import Phase


@dataclass(frozen=True, slots=True)
class Errors:
    """Errors over the movement phase.

    Attributes:
        max_position_error_mm: largest distance between reference and reported TCP position at one time.
        rms_position_error_mm: its root mean square.
        max_path_error_mm: the same after the best time shift and without the constant offset: how far the
            arm leaves the path, whatever the clock says and wherever the calibration puts it.
        rms_path_error_mm: its root mean square.
        offset_mm: (3,) the constant offset in the base frame: mean error after the best time shift.
        max_joint_error_mrad: (6,) largest |reference - actual| of each joint.
        rms_joint_error_mrad: (6,) its root mean square.
        peak_speed_mm_s: top TCP speed of the reference.
        duration_s: length of the movement phase.
        noise_floor_mm_s: root mean square of the differenced position at rest, one axis; None without rest.
    """

    max_position_error_mm: float
    rms_position_error_mm: float
    max_path_error_mm: float
    rms_path_error_mm: float
    offset_mm: tuple[float, float, float]
    max_joint_error_mrad: tuple[float, ...]
    rms_joint_error_mrad: tuple[float, ...]
    peak_speed_mm_s: float
    duration_s: float
    noise_floor_mm_s: float | None


def measure_errors(recording: Recording, track: TcpTrack, lag_s: float) -> Errors:
    """Measure position and joint errors over the movement.

    Args:
        recording: the run.
        track: its TCP path.
        lag_s: best time shift of the run, from the velocity.
    """
    moving = track.movement
    error = track.p_actual[moving] - track.p_ref[moving]
    path_error = track.p_actual[moving] - ShiftedReference(track).at(lag_s, moving)
    offset = path_error.mean(axis=0)
    distance = 1e3 * np.linalg.norm(error, axis=1)
    path_distance = 1e3 * np.linalg.norm(path_error - offset, axis=1)
    joint_error = 1e3 * joint_errors(recording, track)[moving]
    ref_speed = np.linalg.norm(velocity(track.t, track.p_ref), axis=1)[track.movement_steps]
    noise = rest_noise(recording, track)
    x, y, z = (float(v) for v in 1e3 * offset)
    return Errors(
        max_position_error_mm=float(distance.max()),
        rms_position_error_mm=_rms(distance),
        max_path_error_mm=float(path_distance.max()),
        rms_path_error_mm=_rms(path_distance),
        offset_mm=(x, y, z),
        max_joint_error_mrad=tuple(float(v) for v in np.abs(joint_error).max(axis=0)),
        rms_joint_error_mrad=tuple(_rms(column) for column in joint_error.T),
        peak_speed_mm_s=float(1e3 * ref_speed.max()),
        duration_s=track.t_end - track.t_start,
        noise_floor_mm_s=None if noise is None else float(1e3 * np.sqrt(np.trace(noise) / 3.0)),
    )


def joint_errors(recording: Recording, track: TcpTrack) -> NDArray[np.float64]:
    """Return reference minus actual joint position at the samples of the track, (n, 6) rad."""
    error: NDArray[np.float64] = (
        recording.column("ref_q")[track.rows] - recording.column("actual_q")[track.rows]
    )
    return error


def position_errors(track: TcpTrack) -> NDArray[np.float64]:
    """Return the distance between reference and reported position over the movement, (n,) m."""
    moving = track.movement
    distance: NDArray[np.float64] = np.linalg.norm(track.p_actual[moving] - track.p_ref[moving], axis=1)
    return distance


def rest_noise(recording: Recording, track: TcpTrack) -> NDArray[np.float64] | None:
    """Return the covariance (3, 3) of the differenced position at rest, (m/s)^2: the noise floor of velocity.

    Only the half of each settling phase farther from the movement counts, and a slow drift (the mean
    velocity of that half) is taken out. None when no phase of rest is long enough.
    """
    phase = recording.column("phase")[track.rows]
    before = np.flatnonzero(phase == Phase.SETTLE_BEFORE)
    after = np.flatnonzero(phase == Phase.SETTLE_AFTER)
    pieces = []
    for samples in (before[: len(before) // 2], after[len(after) // 2 :]):
        if len(samples) >= 8:
            v = velocity(track.t[samples], track.p_actual[samples])
            pieces.append(v - v.mean(axis=0))
    if not pieces:
        return None
    v = np.concatenate(pieces)
    return v.T @ v / (len(v) - len(pieces))


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
