"""How well a reconstruction, a plan and what the arm did agree with the person who drew.

A run is mapped into the frame, the unit and the time of the recording. The similarity and the scaling of time
are undone exactly; nothing is shifted or fitted. Of each part that moves there are two signals: the positions
at the robot's own time stamps, as they were reported, for signal-to-noise ratios; and the same on the grid of
the recording, low-passed, for everything that is differentiated. That low-pass removes only the encoders'
noise: its cut-off is twice that of the recording's low-pass, which would flatten the speed profiles a second
time.

SNR_v and SNR_t are those of `extraction.extract`, over all parts that move, while the pen is down. What is
compared with the arm is taken at the arm's own time stamps, all signals through the same first difference,
neither shifted nor smoothed.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from pc_client.analysis import measures
from pc_client.analysis.run import MeasuredRun
from pc_client.arrays import Array, read_only
from pc_client.errors import RecordingError
from pc_client.studies.drawing.drawing import Drawing, spatial
from pc_client.studies.extraction.extract import ratios
from pc_client.studies.extraction.smoothing import CUTOFF_HZ, RATE_HZ
from pc_client.studies.likeness import Likeness, fit_power_law, log_dimensionless_jerk, sparc, speed_peaks
from pc_client.studies.signals import Trace, low_passed, velocity

#: Cut-off of the low-pass of what was executed, Hz in the time of the hand, and its order.
_NOISE_HZ = 2.0 * CUTOFF_HZ
_ORDER = 4
#: This much of the movement (s of the hand) before and after a part goes through the low-pass with it.
_MARGIN_S = 0.25
#: Fewest samples of a part that is smooth or not.
_MIN_SAMPLES = 16


@dataclass(frozen=True, slots=True, eq=False)
class ExecutedPart:
    """One part as it was executed, in the recording's frame, unit and time.

    Attributes:
        trace: low-passed, on the part's own grid.
        frame_t: the robot's time stamps while the pen was down, (m,), s of the recording.
        frame_p: positions as reported then, (m, 3).
    """

    trace: Trace
    frame_t: Array
    frame_p: Array


@dataclass(frozen=True, slots=True, eq=False)
class Execution:
    """One run of a drawing.

    Attributes:
        run: the recording and what is measured on every movement.
        parts: those that move, in order.
        whole: all of the movement through the same low-pass: s of the hand since it began, m, base frame.
    """

    run: MeasuredRun
    parts: tuple[ExecutedPart, ...]
    whole: Trace


def executed(drawing: Drawing, run: MeasuredRun, shift: float = 0.0) -> Execution:
    """Map a run of a drawing back.

    With `shift` the arm's positions are taken this much later, s of the arm; 0 judges the run as it was.

    Raises:
        RecordingError: the run ended before the drawing did.
    """
    t = run.track.t - run.track.t_begin
    if t[-1] < float(drawing.joined.pen_down[-1, 1]) * drawing.factor:
        raise RecordingError(f"{run.recording.path}: ends at {t[-1]:.1f} s, before the drawing was done")
    path = CubicSpline(t - shift, run.track.p_actual)
    parts = tuple(
        _executed_part(drawing, mark, part.t, path)
        for mark, part in zip(drawing.moving, drawing.extraction.parts, strict=True)
    )
    whole = np.arange(0.0, drawing.joined.trajectory.duration, 1.0 / RATE_HZ)
    p = _less_noise(path(np.clip(whole * drawing.factor, path.x[0], path.x[-1])), RATE_HZ)
    return Execution(run, parts, Trace(read_only(whole), read_only(p), read_only(velocity(whole, p))))


def _executed_part(drawing: Drawing, mark: int, grid: Array, path: CubicSpline) -> ExecutedPart:
    """A part on its grid (s of the recording), from the path of the arm over its own time."""

    def positions(t: Array) -> Array:
        """Positions of the arm at times of the recording; outside the run it rests."""
        at = np.clip(drawing.arm_time(t, mark), path.x[0], path.x[-1])
        return drawing.points_back(path(at))

    step = (grid[-1] - grid[0]) / (len(grid) - 1)
    margin = round(_MARGIN_S / step)
    wide = grid[0] + step * np.arange(-margin, len(grid) + margin)
    p = _less_noise(positions(wide), 1.0 / step)
    inside = slice(margin, margin + len(grid))
    frame_t = drawing.recording_time(path.x, mark)
    frame_t = frame_t[(frame_t >= grid[0]) & (frame_t <= grid[-1])]
    trace = Trace(grid, read_only(p[inside]), read_only(velocity(wide, p)[inside]))
    return ExecutedPart(trace, read_only(frame_t), read_only(positions(frame_t)))


def _less_noise(p: Array, rate: float) -> Array:
    """Positions (n, 3) at a uniform rate, Hz of the hand, without frequencies above those of a hand."""
    padding = round(_MARGIN_S * rate)
    return low_passed(p, rate, cutoff=_NOISE_HZ, order=_ORDER, padding=padding, ends="reflected")


def signals(drawing: Drawing, execution: Execution | None = None) -> dict[str, tuple[Trace, ...]]:
    """The parts that move as "human", "reconstructed", "planned" and, given a run, "executed".

    All are in space, in the recording's frame, unit and time.
    """
    parts = drawing.extraction.parts
    planned = [drawing.planned(part.t, mark) for mark, part in zip(drawing.moving, parts, strict=True)]
    found = {
        "human": tuple(Trace(part.t, spatial(part.p), spatial(part.v)) for part in parts),
        "reconstructed": tuple(Trace(part.t, *part.trajectory.evaluate(part.t)[:2]) for part in parts),
        "planned": tuple(Trace(part.t, *plan[:2]) for part, plan in zip(parts, planned, strict=True)),
    }
    if execution is not None:
        found["executed"] = tuple(part.trace for part in execution.parts)
    return found


@dataclass(frozen=True, slots=True)
class Agreement:
    """How well one signal agrees with another, dB."""

    snr_v_db: float
    snr_t_db: float


@dataclass(frozen=True, slots=True)
class RunVerdict:
    """One run; its fields are keys of `draw.json`.

    Attributes:
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
        fluency: how human-like the executed signal is.
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
    fluency: Likeness


@dataclass(frozen=True, slots=True)
class Verdict:
    """All figures of a drawing; its fields are keys of `draw.json`.

    Attributes:
        reconstruction: strokes against the recording.
        plan: the plan, with tails of neighbours and lifts, against the recording.
        human: how human-like the recording is.
        reconstructed: how human-like the strokes are.
    """

    reconstruction: Agreement
    plan: Agreement
    human: Likeness
    reconstructed: Likeness
    runs: tuple[RunVerdict, ...]

    @property
    def best(self) -> RunVerdict:
        """The last run: with ILC the one that has learned most."""
        return self.runs[-1]


def judge(drawing: Drawing, executions: Sequence[Execution]) -> Verdict:
    """Compute all figures of a drawing and its runs."""
    own = signals(drawing)
    extraction = drawing.extraction
    assert extraction.snr_v_db is not None  # something moves
    assert extraction.snr_t_db is not None
    metres = drawing.placement.similarity.scale
    pairs = zip(own["human"], own["planned"], strict=True)
    return Verdict(
        reconstruction=Agreement(extraction.snr_v_db, extraction.snr_t_db),
        plan=_agreement(_Pair(human.t, human.p, planned.p) for human, planned in pairs),
        human=_likeness(own["human"], metres),
        reconstructed=_likeness(own["reconstructed"], metres),
        runs=tuple(_judge_run(drawing, execution) for execution in executions),
    )


def _judge_run(drawing: Drawing, execution: Execution) -> RunVerdict:
    run, metres = execution.run, drawing.placement.similarity.scale
    plan, human = _pairs(drawing, execution)
    errors = np.concatenate([np.linalg.norm(pair.actual - pair.reference, axis=1) for pair in plan])
    heights = np.concatenate([np.abs(pair.actual[:, 2]) for pair in plan])
    # What is left of the error when the delay is undone is, in its mean, the offset of the nominal arm.
    lag = run.snr.velocity_lag_s
    aligned_plan, aligned_human = _pairs(drawing, executed(drawing, run, lag))
    offset = np.vstack([pair.actual - pair.reference for pair in aligned_plan]).mean(axis=0)
    return RunVerdict(
        repetition=run.provenance.repetition,
        planned=_agreement(plan),
        human=_agreement(human),
        planned_aligned=_agreement(aligned_plan, offset),
        human_aligned=_agreement(aligned_human, offset),
        lag=lag,
        offset=metres * float(np.linalg.norm(offset)),
        speed_db=run.snr.speed_db,
        max_error=metres * float(errors.max()),
        off_sheet=metres * float(heights.max()) if drawing.flat else math.nan,
        fluency=_likeness([part.trace for part in execution.parts], metres),
    )


class _Pair(NamedTuple):
    """Two signals of one part: times (n,), s, and positions (n, 3), in the recording's frame and unit."""

    t: Array
    reference: Array
    actual: Array


def _pairs(drawing: Drawing, execution: Execution) -> tuple[list[_Pair], list[_Pair]]:
    """Positions as planned and as recorded, each with those that the robot reported, at its time stamps."""
    plan, human = [], []
    for mark, own, part in zip(drawing.moving, drawing.extraction.parts, execution.parts, strict=True):
        t, p = part.frame_t, part.frame_p
        plan.append(_Pair(t, drawing.planned(t, mark).p, p))
        human.append(_Pair(t, CubicSpline(own.t, spatial(own.p))(t), p))
    return plan, human


def _agreement(pairs: Iterable[_Pair], offset: Array | float = 0.0) -> Agreement:
    """SNR_v and SNR_t over all parts, after an offset of the actual positions, (3,), is taken off."""
    powers = np.zeros(4)
    for t, reference, reported in pairs:
        if len(t) < 2:
            continue  # a part between two frames of the robot
        error, moved = reported - offset - reference, reference - reference.mean(axis=0)
        signals = (measures.velocity(t, reference), measures.velocity(t, error), moved, error)
        powers += [np.sum(values**2) for values in signals]
    return Agreement(*ratios(powers))


def _likeness(parts: Sequence[Trace], metres: float) -> Likeness:
    """How human-like a signal is while the pen is down.

    Peaks are those of all parts, smoothness is the mean over the parts by their durations (nan when all are
    too short). One power law is fitted to all parts, where the path bends by less than 1 m radius; a unit has
    so many metres.
    """
    long = [part for part in parts if len(part.t) >= _MIN_SAMPLES and part.speed.max() > 0.0]

    def mean(figure: Callable[[Array, float], float]) -> float:
        values = [figure(part.speed, (len(part.t) - 1) / part.duration) for part in long]
        durations = [part.duration for part in long]
        return float(np.average(values, weights=durations)) if long else math.nan

    law = fit_power_law(
        np.vstack([metres * part.v for part in parts]),
        np.vstack([metres * np.gradient(part.v, part.t, axis=0) for part in parts]),
    )
    return Likeness(
        peaks=sum(speed_peaks(part.speed) for part in parts),
        sparc=mean(sparc),
        log_jerk=mean(log_dimensionless_jerk),
        exponent=law.exponent,
        r_squared=law.r_squared,
    )
