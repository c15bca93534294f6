"""The TCP path of a run, and what is measured on it: signal-to-noise ratios, errors, where the rest is lost.

The path is reference and actual position at the same controller time stamps. Both go through the same
operator, the difference of two samples 8 ms apart, as the paper's were, over the time between them, so that
a perfect arm gives a perfect figure. At 125 Hz these are neighbours. At 500 Hz each sample is set against the
one four before it: all samples count, and the noise of the encoders weighs as much as at 125 Hz.

The signal-to-noise ratio of the TCP velocity is the figure by which the paper judges a robot:

    SNR = 10 log10( P(v_pc) / P(v_ur3 - v_pc) )                                             Eq. 10

`speed_db` is this, exactly: v is the scalar TCP speed, the difference of positions, v_pc of the
reference and v_ur3 of the position that the robot reports, at the same controller time stamps, over the
movement phase, neither shifted nor smoothed. P is the mean square. The other figures stand under their own
names beside it:

    speed_shifted_db     the same after the one time shift that makes it best
    velocity_db          on the velocity vector, which also sees a wrong direction
    velocity_shifted_db  the vector after its own best shift

Errors are in the units people think in: millimetres, milliseconds, milliradians. All of them come from what
the robot reports; a calibration error that the robot does not know of is not in them. A constant offset
between the client's nominal arm and the robot's calibrated one is: it is measured and taken out under its own
name.

The budget cuts the power of the speed error into parts that add up to it:

    delay           what the best time shift takes away
    scale and ramp  what is left of it, as far as it is a constant times the reference speed (too fast, too
                    slow) plus a constant times its second derivative (corners rounded off)
    slow rest       below 6 Hz, less the noise: friction, settling, limits of acceleration, slow gear ripple
    fast rest       above 6 Hz, less the noise: gear ripple (101 cycles a joint turn pass 6 Hz at 0.4 rad/s),
                    jitter of the command stream
    noise           that of the encoders at rest, turned into noise of the speed (`noise_floor`): its variance
                    is taken from the fast rest, what it adds to the mean of the speed near rest from the slow

Each part is the drop in mean square error from one step to the next, so no part is counted twice. What is
measured is the correlation with these shapes, not a cause: a cause that looks like a delay is in `delay`.

Source: A. Wolniakowski et al., "Towards human-like kinematics in industrial robotic arms: a case study on a
UR3 robot", Eq. 10 and section IV.B ("velocities are computed as the TCP position derivative").
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from pc_client.arrays import Array
from pc_client.control.loop import SAMPLING_TIME
from pc_client.errors import RecordingError
from pc_client.recording.recording import Recording
from pc_client.recording.rows import Phase

# Fewer steps of 8 ms than this are no movement.
_MIN_MOVEMENT_STEPS = 10

_SHORTEST_CYCLE, _LONGEST_CYCLE = 0.5e-3, 0.05
"""Median steps of time stamps outside are of no robot [s]: UR's control cycles are 8 and 2 ms."""

_MOST = MappingProxyType(
    {
        "timestamp": 1e9,  # s: 30 years
        "ref_t": 1e9,
        "ref_tcp_position": 100.0,  # m
        "actual_TCP_pose": 100.0,
        "ref_q": 1e3,  # rad
        "actual_q": 1e3,
    }
)
"""What is measured, and the largest value that a robot can report."""


@dataclass(frozen=True, slots=True)
class TcpTrack:
    """Positions of the tool centre point in the base frame.

    Attributes:
        t: (n,) controller time in s, strictly rising.
        p_ref: (n, 3) reference position at these times, m.
        p_actual: (n, 3) position that the robot reported at these times, m.
        rows: index of each sample's row in the recording, (n,): of every row with a time stamp of its own.
        movement: samples first..last of the movement phase, as a slice.
        t_begin: controller time at which the movement began, s: up to a cycle before its first sample.
    """

    t: Array
    p_ref: Array
    p_actual: Array
    rows: NDArray[np.intp]
    movement: slice
    t_begin: float

    @property
    def movement_steps(self) -> slice:
        """The steps of `velocity` that lie wholly inside the movement."""
        begins, ends = steps_of(self.t)
        first = np.searchsorted(begins, self.movement.start)
        return slice(int(first), int(np.searchsorted(ends, self.movement.stop)))

    @property
    def t_start(self) -> float:
        """Time of the first sample of the movement, s."""
        return float(self.t[self.movement.start])

    @property
    def t_end(self) -> float:
        """Time of the last sample of the movement, s."""
        return float(self.t[self.movement.stop - 1])


def track_of(recording: Recording) -> TcpTrack:
    """Take the TCP path out of a recording.

    Rows that repeat a time stamp (a heartbeat of a standing controller) are left out.

    Raises:
        RecordingError: signals are missing, or the movement phase is too short to be judged.
    """
    t = recording.t
    with np.errstate(invalid="ignore"):  # endless times are refused below
        rows = np.flatnonzero(np.diff(t, prepend=-np.inf) > 0.0)
    moving = np.flatnonzero(recording.rows_of(Phase.MOVEMENT)[rows])
    least = _MIN_MOVEMENT_STEPS * _rows_per_step(t[rows])
    if len(moving) < least:
        raise RecordingError(
            f"{recording.path} has {len(moving)} samples of movement; at least {least} are needed"
        )
    for name, most in _MOST.items():
        if not np.all(np.abs(recording.column(name)) <= most):  # NaN is not
            raise RecordingError(f"{recording.path} has {name} with values beyond {most:g}, or not a number")
    if not np.all(np.diff(t[rows]) > 0.0):
        raise RecordingError(f"{recording.path} has time stamps that go back; those of a robot do not")
    cycle = _cycle(t[rows])
    if not _SHORTEST_CYCLE <= cycle <= _LONGEST_CYCLE:
        raise RecordingError(
            f"{recording.path} has time stamps {cycle:g} s apart; {_SHORTEST_CYCLE:g} to "
            f"{_LONGEST_CYCLE:g} s are a robot's"
        )
    return TcpTrack(
        t=t[rows],
        p_ref=recording.column("ref_tcp_position")[rows],
        p_actual=recording.column("actual_TCP_pose")[rows, :3],
        rows=rows,
        movement=slice(int(moving[0]), int(moving[-1]) + 1),
        t_begin=float((t - recording.column("ref_t"))[rows[moving[0]]]),
    )


def _cycle(t: Array) -> float:
    return float(np.median(np.diff(t))) if len(t) > 1 else SAMPLING_TIME


def _rows_per_step(t: Array) -> int:
    """How many samples at times (n,) [s] make 8 ms: 1 at 125 Hz, 4 at 500 Hz."""
    return max(round(SAMPLING_TIME / _cycle(t)), 1)


def steps_of(t: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Samples at which steps over times (n,) [s] begin and end: each sample ends one that began 8 ms before.

    Where that frame is lost the step begins at the last one before, and is longer; no other is moved by it.
    """
    each = _rows_per_step(t)
    ends = np.arange(each, len(t))
    begins = np.searchsorted(t, t[ends] - (each - 0.5) * _cycle(t)) - 1
    return np.maximum(begins, 0), ends


def velocity(t: Array, p: Array) -> Array:
    """Differences of positions (n, 3) [m] over the steps of the times (n,) [s]: (m, 3) m/s."""
    begins, ends = steps_of(t)
    return (p[ends] - p[begins]) / (t[ends] - t[begins])[:, None]


def speed(t: Array, p: Array) -> Array:
    """Length of `velocity`, (m,) m/s: the scalar TCP speed."""
    length: Array = np.linalg.norm(velocity(t, p), axis=1)
    return length


def _shifted_reference(track: TcpTrack) -> Callable[[float, slice], Array]:
    """The reference path, delayed by any time: what an arm would do whose only fault is a lag.

    The reference is shifted rather than the measurement, because it is smooth: interpolating it changes
    nothing, while interpolating noisy positions would smooth them.

    Returns:
        A function of the lag [s] and of samples: positions (n, 3) [m] at their times less the lag; at rest
        before and after the recording.
    """
    spline = CubicSpline(track.t, track.p_ref)
    return lambda lag_s, samples: spline(np.clip(track.t[samples] - lag_s, track.t[0], track.t[-1]))


# Where the best shift is looked for; loops on a UR arm lag 10-100 ms, a good preview can be slightly early.
_MIN_LAG_S, _MAX_LAG_S = -0.1, 0.4

SPLIT_HZ = 6.0
"""Between the slow and the fast rest of the budget."""

PARTS = ("delay", "scale and ramp", "slow rest", "fast rest", "noise")
"""Of the budget."""

_SHORTEST_REST = 8

_VelocityOf = Callable[[Array, Array], Array]


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


def snr_db(reference: Array, actual: Array) -> float:
    """Eq. 10 on two signals of the same shape, (n,) or (n, 3): dB.

    It is inf when they are equal, -inf when the reference is all zero and the actual is not.
    """
    return decibels(float(np.sum(np.square(reference))), float(np.sum(np.square(actual - reference))))


def decibels(signal: float, noise: float) -> float:
    """Ratio of two powers in dB; inf without noise, -inf of noise alone."""
    if noise == 0.0:
        return math.inf
    return 10.0 * math.log10(signal / noise) if signal > 0.0 else -math.inf


def measure_snr(track: TcpTrack) -> Snr:
    """Compute all signal-to-noise ratios of one run."""
    steps, figures = track.movement_steps, []
    for velocity_of in (speed, velocity):
        raw = (velocity_of(track.t, p)[steps] for p in (track.p_ref, track.p_actual))
        lag = _best_lag(track, velocity_of)
        figures += [snr_db(*raw), snr_db(*_shifted_pair(track, lag, velocity_of)), lag]
    return Snr(*figures)


def _best_lag(track: TcpTrack, velocity_of: _VelocityOf) -> float:
    """Return the delay in s of the reference that leaves the least square error.

    A scan in steps of 8 ms finds the valley, a bounded search its bottom, far below one cycle. The error is
    summed over one window for all lags, the movement and as much after it as the longest lag needs, so that
    the sum is a smooth function of the lag.
    """
    cycle = _cycle(track.t)
    start = max(0, track.movement.start + math.floor(_MIN_LAG_S / cycle))
    stop = min(len(track.t), track.movement.stop + math.ceil(_MAX_LAG_S / cycle))
    window = slice(start, stop)
    t = track.t[window]
    actual, reference = velocity_of(t, track.p_actual[window]), _shifted_reference(track)

    def error(lag: float) -> float:
        return float(np.sum(np.square(actual - velocity_of(t, reference(lag, window)))))

    scan = max(cycle, SAMPLING_TIME)
    lags = np.arange(_MIN_LAG_S, _MAX_LAG_S + scan / 2, scan)
    coarse = float(lags[np.argmin([error(lag) for lag in lags])])
    fine = minimize_scalar(
        error, bounds=(coarse - scan, coarse + scan), method="bounded", options={"xatol": 1e-7}
    )
    return float(fine.x)


def _shifted_pair(track: TcpTrack, lag_s: float, velocity_of: _VelocityOf) -> tuple[Array, Array]:
    """Return reference and actual over the movement, both taken `lag_s` later at the robot.

    The window moves with the lag, so that the same piece of the reference is judged as without a shift.

    Raises:
        RecordingError: too little of the movement is left.
    """
    half_cycle = 0.5 * _cycle(track.t)
    shifted_t = track.t - lag_s
    inside = np.flatnonzero((shifted_t > track.t_start - half_cycle) & (shifted_t < track.t_end + half_cycle))
    least = _MIN_MOVEMENT_STEPS * _rows_per_step(track.t)
    if len(inside) < least:
        raise RecordingError(
            f"{len(inside)} samples of movement are left after the best shift of {lag_s:.3f} s; "
            f"at least {least} are needed"
        )
    window = slice(int(inside[0]), int(inside[-1]) + 1)
    positions = _shifted_reference(track)(lag_s, window), track.p_actual[window]
    reference, actual = (velocity_of(track.t[window], p) for p in positions)
    return reference, actual


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


def measure_errors(recording: Recording, track: TcpTrack, lag_s: float) -> Errors:
    """Measure position and joint errors over the movement; the best shift is that of the velocity [s]."""
    moving = track.movement
    path_error = track.p_actual[moving] - _shifted_reference(track)(lag_s, moving)
    offset = path_error.mean(axis=0)
    distance = 1e3 * position_errors(track)
    path_distance = 1e3 * np.linalg.norm(path_error - offset, axis=1)
    joint_error = 1e3 * joint_errors(recording, track)[moving]
    ref_speed = speed(track.t, track.p_ref)[track.movement_steps]
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
    )


def joint_errors(recording: Recording, track: TcpTrack) -> Array:
    """Return reference minus actual joint position at the samples of the track, (n, 6) rad."""
    return recording.column("ref_q")[track.rows] - recording.column("actual_q")[track.rows]


def position_errors(track: TcpTrack) -> Array:
    """Return the distance between reference and reported position over the movement, (n,) m."""
    moving = track.movement
    distance: Array = np.linalg.norm(track.p_actual[moving] - track.p_ref[moving], axis=1)
    return distance


def rest_samples(recording: Recording, track: TcpTrack) -> list[NDArray[np.intp]]:
    """Samples of the track at rest, for each settling phase: the half that is farther from the movement."""
    phase = recording.column("phase")[track.rows]
    before = np.flatnonzero(phase == Phase.SETTLE_BEFORE)
    after = np.flatnonzero(phase == Phase.SETTLE_AFTER)
    halves = (before[: len(before) // 2], after[len(after) // 2 :])
    return [samples for samples in halves if len(samples) >= _SHORTEST_REST]


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


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
        return decibels(self.signal_power, self.parts[part]) if self.signal_power > 0.0 else math.inf


def error_budget(track: TcpTrack, lag_s: float, noise: tuple[float, float]) -> Budget:
    """Cut the power of the speed error of one run into its parts.

    Args:
        lag_s: the best shift of the speed [s].
        noise: what noise adds to the power of the speed error by its mean and by its variance [(m/s)2].
    """
    steps = track.movement_steps
    ref_speed = speed(track.t, track.p_ref)[steps]
    error_power = _power(speed(track.t, track.p_actual)[steps] - ref_speed)

    reference, actual = _shifted_pair(track, lag_s, speed)
    cycle = _cycle(track.t)
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
    noise_slow, noise_fast = min(noise[0], slow), min(noise[1], fast)
    parts = (
        error_power - after_shift,
        after_shift - after_shape,
        slow - noise_slow,
        fast - noise_fast,
        noise_slow + noise_fast,
    )
    return Budget(_power(ref_speed), error_power, dict(zip(PARTS, parts, strict=True)))


def _power(signal: Array) -> float:
    return float(np.mean(np.square(signal)))


def _power_above(signal: Array, cycles_per_sample: float) -> float:
    """Return the mean square of the part of a signal above a frequency (Parseval)."""
    n = len(signal)
    power = np.square(np.abs(np.fft.rfft(signal))) / n**2
    power[1 : (n + 1) // 2] *= 2.0  # all but 0 and Nyquist stand for two conjugate lines
    return float(power[np.fft.rfftfreq(n) > cycles_per_sample].sum())
