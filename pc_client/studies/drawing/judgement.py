"""What the arm did, mapped back: in the frame, the unit and the time of the recording.

The similarity and the scaling of time are undone exactly; nothing is shifted or fitted. Of each part that
moves there are two signals: the positions at the robot's own time stamps, as they were reported, for
signal-to-noise ratios; and the same on the grid of the recording, low-passed, for everything that is
differentiated. That low-pass removes only the encoders' noise: its cut-off is twice that of the recording's
low-pass, which would flatten the speed profiles a second time.

How well a reconstruction, a plan and its execution agree with the person, in figures.

    SNR_v  10 log10( sum |v|^2 / sum |v - v'|^2 )              velocity vectors
    SNR_t  10 log10( sum |p - mean p|^2 / sum |p - p'|^2 )     positions, mean p of each part by itself

both over all parts that move, while the pen is down. What is compared with the arm is taken at the arm's own
time stamps, all signals through the same first difference, neither shifted nor smoothed. The figures of
fluency are those of `analysis.human_likeness`; the executed signal is low-passed for them, see `execution`.

Source: docs/extraction.md, section 1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from pc_client.analysis.run import MeasuredRun
from pc_client.errors import RecordingError
from pc_client.movements.geometry import read_only
from pc_client.studies.drawing.drawing import Drawing, spatial
from pc_client.studies.extraction.smoothing import CUTOFF_HZ, RATE_HZ, velocity
from pc_client.studies.likeness import fit_power_law, log_dimensionless_jerk, sparc, speed_peaks

__all__ = [
    "Agreement",
    "ExecutedPart",
    "Execution",
    "Fluency",
    "RunVerdict",
    "Signal",
    "Verdict",
    "executed",
    "judge",
    "signals",
]

#: Cut-off of the low-pass, Hz in the time of the hand, and its order; it runs forwards and backwards.
_NOISE_HZ = 2.0 * CUTOFF_HZ
_ORDER = 4
#: This much of the movement (s of the hand) before and after a part goes through the low-pass with it.
_MARGIN_S = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class ExecutedPart:
    """One part as it was executed, in the recording's frame, unit and time.

    Attributes:
        t: the part's own grid, (n,), s.
        p: low-passed positions on it, (n, 3).
        v: their velocities, (n, 3), per second.
        frame_t: the robot's time stamps while the pen was down, (m,), s of the recording.
        frame_p: positions as reported then, (m, 3).
    """

    t: NDArray[np.float64]
    p: NDArray[np.float64]
    v: NDArray[np.float64]
    frame_t: NDArray[np.float64]
    frame_p: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Execution:
    """One run of a drawing.

    Attributes:
        run: the recording and what is measured on every movement.
        parts: those that move, in order.
        t: all of the movement on a uniform grid, (k,), s of the hand since it began.
        p: TCP positions then, through the same low-pass, (k, 3), m, base frame.
        v: their velocities, (k, 3), m per s of the hand.
    """

    run: MeasuredRun
    parts: tuple[ExecutedPart, ...]
    t: NDArray[np.float64]
    p: NDArray[np.float64]
    v: NDArray[np.float64]


def executed(drawing: Drawing, run: MeasuredRun, shift: float = 0.0) -> Execution:
    """Map a run back.

    Args:
        drawing: what the run executed.
        run: the recording.
        shift: take the arm's positions this much later, s of the arm; 0 judges it as it was.

    Raises:
        RecordingError: the run ended before the drawing did.
    """
    track = run.track
    t = track.t - track.t_begin
    if t[-1] < float(drawing.joined.pen_down[-1, 1]) * drawing.factor:
        raise RecordingError(f"{run.recording.path}: ends at {t[-1]:.1f} s, before the drawing was done")
    path = CubicSpline(t - shift, track.p_actual)
    moving = [index for index, mark in enumerate(drawing.marks) if mark.trajectory is not None]
    parts = tuple(
        _part(drawing, index, part.t, path)
        for index, part in zip(moving, drawing.extraction.parts, strict=True)
    )
    whole = np.arange(0.0, drawing.joined.trajectory.duration, 1.0 / RATE_HZ)
    p = _less_noise(path(np.clip(whole * drawing.factor, path.x[0], path.x[-1])), RATE_HZ)
    return Execution(run, parts, read_only(whole), read_only(p), read_only(velocity(whole, p)))


def _less_noise(p: NDArray[np.float64], rate: float) -> NDArray[np.float64]:
    """Positions (n, 3) at a uniform rate, Hz of the hand, without frequencies above those of a hand."""
    sections = butter(_ORDER, _NOISE_HZ, fs=rate, output="sos")
    padding = min(len(p) - 1, round(_MARGIN_S * rate))
    smooth: NDArray[np.float64] = sosfiltfilt(sections, p, axis=0, padtype="odd", padlen=padding)
    return smooth


def _part(drawing: Drawing, mark: int, grid: NDArray[np.float64], path: CubicSpline) -> ExecutedPart:
    def positions(t: NDArray[np.float64]) -> NDArray[np.float64]:
        """Positions of the arm at times of the recording; outside the run it rests."""
        at = np.clip(drawing.arm_time(t, mark), path.x[0], path.x[-1])
        return drawing.points_back(path(at))

    step = (grid[-1] - grid[0]) / (len(grid) - 1)
    margin = round(_MARGIN_S / step)
    wide = grid[0] + step * np.arange(-margin, len(grid) + margin)
    smooth = _less_noise(positions(wide), 1.0 / step)
    inside = slice(margin, margin + len(grid))
    frame_t = drawing.recording_time(path.x, mark)
    frame_t = frame_t[(frame_t >= grid[0]) & (frame_t <= grid[-1])]
    return ExecutedPart(
        grid,
        read_only(smooth[inside]),
        read_only(velocity(wide, smooth)[inside]),
        read_only(frame_t),
        read_only(positions(frame_t)),
    )


#: Fewest samples of a part from which figures of fluency are taken.
_MIN_SAMPLES = 16


@dataclass(frozen=True, slots=True)
class Agreement:
    """How well one signal agrees with another, dB."""

    snr_v_db: float
    snr_t_db: float


@dataclass(frozen=True, slots=True)
class Fluency:
    """How human-like a signal is, while the pen is down.

    Attributes:
        peaks: of the speed, all parts together.
        sparc: spectral arc length, mean over the parts by their durations; nan when all are too short.
        log_jerk: log dimensionless jerk, likewise.
        exponent: beta of speed = k curvature^-beta over all parts; nan for straight lines.
        r_squared: how well that law holds, 0 to 1; nan likewise.
    """

    peaks: int
    sparc: float
    log_jerk: float
    exponent: float
    r_squared: float


@dataclass(frozen=True, slots=True, eq=False)
class Signal:
    """One part of one signal on a uniform grid.

    Attributes:
        t: (n,), s of the recording.
        p: (n, 3), in the recording's frame and unit.
        v: (n, 3), per second.
    """

    t: NDArray[np.float64]
    p: NDArray[np.float64]
    v: NDArray[np.float64]

    @property
    def speed(self) -> NDArray[np.float64]:
        """(n,), per second."""
        speed: NDArray[np.float64] = np.linalg.norm(self.v, axis=1)
        return speed


@dataclass(frozen=True, slots=True)
class RunVerdict:
    """One run.

    Attributes:
        repetition: its number.
        planned: executed against planned.
        human: executed against the recording.
        planned_aligned: executed against planned, after the best time shift and without the constant offset
            between the plan's nominal arm and the calibrated one.
        human_aligned: executed against the recording, after the same.
        lag: that shift, s of the arm; positive: the arm is late.
        offset: length of that offset, m.
        speed_db: Eq. 10 of the paper over the whole movement with its lifts, scalar speed.
        max_error: largest distance from the plan while the pen is down, m, at equal time stamps.
        off_sheet: largest distance from the sheet while the pen is down, m; nan for recordings in space.
        fluency: of the executed signal.
    """

    repetition: int
    planned: Agreement
    human: Agreement
    planned_aligned: Agreement
    human_aligned: Agreement
    lag: float
    offset: float
    speed_db: float
    max_error: float
    off_sheet: float
    fluency: Fluency


@dataclass(frozen=True, slots=True)
class Verdict:
    """All figures of a drawing.

    Attributes:
        reconstruction: strokes against the recording.
        plan: the plan, with tails of neighbours and lifts, against the recording.
        human: fluency of the recording.
        reconstructed: fluency of the strokes.
        runs: what the arm did.
    """

    reconstruction: Agreement
    plan: Agreement
    human: Fluency
    reconstructed: Fluency
    runs: tuple[RunVerdict, ...]

    @property
    def best(self) -> RunVerdict:
        """The last run: with ILC the one that has learned most."""
        return self.runs[-1]


def signals(drawing: Drawing, execution: Execution | None = None) -> dict[str, tuple[Signal, ...]]:
    """The parts that move as "human", "reconstructed", "planned" and, given a run, "executed"."""
    moving = [index for index, mark in enumerate(drawing.marks) if mark.trajectory is not None]
    parts = drawing.extraction.parts
    found: dict[str, tuple[Signal, ...]] = {
        "human": tuple(Signal(part.t, spatial(part.p), spatial(part.v)) for part in parts),
        "reconstructed": tuple(Signal(part.t, *part.trajectory.evaluate(part.t)[:2]) for part in parts),
        "planned": tuple(
            Signal(part.t, *drawing.planned(part.t, index)[:2])
            for index, part in zip(moving, parts, strict=True)
        ),
    }
    if execution is not None:
        found["executed"] = tuple(Signal(part.t, part.p, part.v) for part in execution.parts)
    return found


def judge(drawing: Drawing, executions: Sequence[Execution]) -> Verdict:
    """Compute all figures of a drawing and its runs."""
    own = signals(drawing)
    human, planned = own["human"], own["planned"]
    extraction = drawing.extraction
    assert extraction.snr_v_db is not None  # something moves
    assert extraction.snr_t_db is not None
    metres = drawing.placement.similarity.scale
    return Verdict(
        Agreement(extraction.snr_v_db, extraction.snr_t_db),
        _agreement([(h.t, h.p, p.p) for h, p in zip(human, planned, strict=True)]),
        fluency(human, metres),
        fluency(own["reconstructed"], metres),
        tuple(_judge_run(drawing, execution) for execution in executions),
    )


def fluency(parts: Sequence[Signal], metres: float) -> Fluency:
    """Figures of one signal.

    Args:
        parts: of the signal.
        metres: metres per unit: the power law is fitted where the path bends by less than 1 m radius.
    """
    long = [part for part in parts if len(part.t) >= _MIN_SAMPLES and part.speed.max() > 0.0]
    weights = [float(part.t[-1] - part.t[0]) for part in long]
    rates = [(len(part.t) - 1) / weight for part, weight in zip(long, weights, strict=True)]
    v = np.vstack([metres * part.v for part in parts])
    a = np.vstack([metres * np.gradient(part.v, part.t, axis=0) for part in parts])
    law = fit_power_law(v, a)
    return Fluency(
        sum(speed_peaks(part.speed) for part in parts),
        _mean([sparc(part.speed, rate) for part, rate in zip(long, rates, strict=True)], weights),
        _mean(
            [log_dimensionless_jerk(part.speed, rate) for part, rate in zip(long, rates, strict=True)],
            weights,
        ),
        law.exponent,
        law.r_squared,
    )


def _judge_run(drawing: Drawing, execution: Execution) -> RunVerdict:
    run = execution.run
    lag = run.snr.velocity_lag_s
    shifted = executed(drawing, run, lag)
    rest = np.vstack([actual - reference for _, reference, actual in _against_plan(drawing, shifted)])
    offset = rest.mean(axis=0)
    metres = drawing.placement.similarity.scale
    errors, heights = [], []
    for _, reference, actual in _against_plan(drawing, execution):
        errors.append(np.linalg.norm(actual - reference, axis=1))
        heights.append(np.abs(actual[:, 2]))
    own = tuple(Signal(part.t, part.p, part.v) for part in execution.parts)
    return RunVerdict(
        run.provenance.repetition,
        _agreement(_against_plan(drawing, execution)),
        _agreement(_against_human(drawing, execution)),
        _agreement(_less(_against_plan(drawing, shifted), offset)),
        _agreement(_less(_against_human(drawing, shifted), offset)),
        lag,
        metres * float(np.linalg.norm(offset)),
        run.snr.speed_db,
        metres * float(np.concatenate(errors).max()),
        metres * float(np.concatenate(heights).max()) if drawing.flat else math.nan,
        fluency(own, metres),
    )


_Pair = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


def _against_plan(drawing: Drawing, execution: Execution) -> list[_Pair]:
    """Times, planned and executed positions of each part at the robot's time stamps."""
    moving = [index for index, mark in enumerate(drawing.marks) if mark.trajectory is not None]
    return [
        (part.frame_t, drawing.planned(part.frame_t, index).p, part.frame_p)
        for index, part in zip(moving, execution.parts, strict=True)
    ]


def _against_human(drawing: Drawing, execution: Execution) -> list[_Pair]:
    """Times, recorded and executed positions of each part at the robot's time stamps."""
    return [
        (part.frame_t, CubicSpline(human.t, spatial(human.p))(part.frame_t), part.frame_p)
        for human, part in zip(drawing.extraction.parts, execution.parts, strict=True)
    ]


def _less(pairs: Sequence[_Pair], offset: NDArray[np.float64]) -> list[_Pair]:
    return [(t, reference, actual - offset) for t, reference, actual in pairs]


def _agreement(pairs: Sequence[_Pair]) -> Agreement:
    """Pool parts: times (n,), reference and actual positions (n, 3)."""
    v_signal = v_noise = p_signal = p_noise = 0.0
    for t, reference, actual in pairs:
        if len(t) < 2:
            continue  # a part between two frames of the robot
        steps = np.diff(t)[:, None]
        v, error = np.diff(reference, axis=0) / steps, np.diff(actual - reference, axis=0) / steps
        v_signal, v_noise = v_signal + float(np.sum(v**2)), v_noise + float(np.sum(error**2))
        p_signal += float(np.sum((reference - reference.mean(axis=0)) ** 2))
        p_noise += float(np.sum((actual - reference) ** 2))
    return Agreement(_decibels(v_signal, v_noise), _decibels(p_signal, p_noise))


def _decibels(signal: float, noise: float) -> float:
    if signal <= 0.0:
        return math.nan
    return 10.0 * math.log10(signal / max(noise, 1e-30 * signal))


def _mean(values: Sequence[float], weights: Sequence[float]) -> float:
    if not values:
        return math.nan
    return math.fsum(v * w for v, w in zip(values, weights, strict=True)) / math.fsum(weights)
