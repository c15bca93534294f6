"""The signal-to-noise ratio of the TCP velocity: the figure by which the paper judges a robot.

    SNR = 10 log10( P(v_pc) / P(v_ur3 - v_pc) )                                             Eq. 10

`speed_db` is this, exactly: v is the scalar TCP speed, the first difference of positions, v_pc of the
reference and v_ur3 of the position that the robot reports, at the same controller time stamps, over the
movement phase, neither shifted nor smoothed. P is the mean square. The other figures stand under their own
names beside it:

    speed_shifted_db     the same after the one time shift that makes it best
    velocity_db          on the velocity vector, which also sees a wrong direction
    velocity_shifted_db  the vector after its own best shift

Source: A. Wolniakowski et al., "Towards human-like kinematics in industrial robotic arms: a case study on a
UR3 robot", Eq. 10 and section IV.B ("velocities are computed as the TCP position derivative").
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from pc_client.analysis.track import MIN_MOVEMENT_ROWS, ShiftedReference, TcpTrack, speed, velocity
from pc_client.errors import RecordingError

# Where the best shift is looked for; loops on a UR arm lag 10-100 ms, a good preview can be slightly early.
MIN_LAG_S, MAX_LAG_S = -0.1, 0.4

_VelocityOf = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]


@dataclass(frozen=True, slots=True)
class Snr:
    """The four signal-to-noise ratios of one run, in dB, and the lags in s that belong to the shifted ones.

    A lag is positive when the arm is behind its reference.
    """

    speed_db: float
    speed_shifted_db: float
    speed_lag_s: float
    velocity_db: float
    velocity_shifted_db: float
    velocity_lag_s: float


def snr_db(reference: NDArray[np.float64], actual: NDArray[np.float64]) -> float:
    """Eq. 10 on two signals of the same shape, (n,) or (n, 3).

    Returns:
        dB; inf when they are equal, -inf when the reference is all zero and the actual is not.
    """
    signal = float(np.sum(np.square(reference)))
    noise = float(np.sum(np.square(actual - reference)))
    if noise == 0.0:
        return math.inf
    return 10.0 * math.log10(signal / noise) if signal > 0.0 else -math.inf


def measure_snr(track: TcpTrack) -> Snr:
    """Compute all signal-to-noise ratios of one run."""
    steps = track.movement_steps
    raw = [
        snr_db(f(track.t, track.p_ref)[steps], f(track.t, track.p_actual)[steps]) for f in (speed, velocity)
    ]
    reference = ShiftedReference(track)
    speed_lag = _best_lag(track, reference, speed)
    velocity_lag = _best_lag(track, reference, velocity)
    return Snr(
        speed_db=raw[0],
        speed_shifted_db=snr_db(*shifted_pair(track, reference, speed_lag, speed)),
        speed_lag_s=speed_lag,
        velocity_db=raw[1],
        velocity_shifted_db=snr_db(*shifted_pair(track, reference, velocity_lag, velocity)),
        velocity_lag_s=velocity_lag,
    )


def _best_lag(track: TcpTrack, reference: ShiftedReference, velocity_of: _VelocityOf) -> float:
    """Return the delay in s of the reference that leaves the least square error.

    A scan in steps of one control cycle finds the valley, a bounded search its bottom, far below one cycle.
    The error is summed over one window for all lags, the movement and as much after it as the longest lag
    needs, so that the sum is a smooth function of the lag.
    """
    cycle = float(np.median(np.diff(track.t)))
    start = max(0, track.movement.start + math.floor(MIN_LAG_S / cycle))
    stop = min(len(track.t), track.movement.stop + math.ceil(MAX_LAG_S / cycle))
    window = slice(start, stop)
    t = track.t[window]
    actual = velocity_of(t, track.p_actual[window])

    def error(lag: float) -> float:
        return float(np.sum(np.square(actual - velocity_of(t, reference.at(lag, window)))))

    lags = np.arange(MIN_LAG_S, MAX_LAG_S + cycle / 2, cycle)
    coarse = float(lags[np.argmin([error(lag) for lag in lags])])
    fine = minimize_scalar(
        error, bounds=(coarse - cycle, coarse + cycle), method="bounded", options={"xatol": 1e-7}
    )
    return float(fine.x)


def shifted_pair(
    track: TcpTrack, reference: ShiftedReference, lag_s: float, velocity_of: _VelocityOf
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return reference and actual over the movement, both taken `lag_s` later at the robot.

    The window moves with the lag, so that the same piece of the reference is judged as without a shift.

    Raises:
        RecordingError: too little of the movement is left.
    """
    half_cycle = 0.5 * float(np.median(np.diff(track.t)))
    shifted_t = track.t - lag_s
    inside = np.flatnonzero((shifted_t > track.t_start - half_cycle) & (shifted_t < track.t_end + half_cycle))
    if len(inside) < MIN_MOVEMENT_ROWS:
        raise RecordingError(
            f"{len(inside)} samples of movement are left after the best shift of {lag_s:.3f} s; "
            f"at least {MIN_MOVEMENT_ROWS} are needed"
        )
    window = slice(int(inside[0]), int(inside[-1]) + 1)
    t = track.t[window]
    return velocity_of(t, reference.at(lag_s, window)), velocity_of(t, track.p_actual[window])
