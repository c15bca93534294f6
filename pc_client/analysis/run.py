"""What an arm did: signals of a motion, a run with its reference, what is measured on it, their sheets.

`Signals` and `Run` are for programs that import the client: arrays, a table (polars), a figure (matplotlib).
`MeasuredRun` holds all figures of one recording; tables and pages are made of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pc_client.analysis import measures
from pc_client.analysis.noise_floor import noise_power, step_covariance
from pc_client.arrays import Array
from pc_client.driver.velocity_stream import StreamReport
from pc_client.errors import RecordingError
from pc_client.recording.provenance import Provenance, Source, origin_of
from pc_client.recording.recording import Recording, flat_columns, load_recording, split_columns, table_of
from pc_client.results import sheet
from pc_client.results.sheet import Box, Curve, Panel, Sheet, boxes
from protocol.ur_types import JOINT_NAMES

if TYPE_CHECKING:
    import polars
    from matplotlib.figure import Figure

GIVEN_UP = "given up"
"""Kind of the movement of a run that did not come to its end."""


@dataclass(frozen=True, eq=False, repr=False)
class Signals:
    """Signals of one motion, one row a control cycle.

    Attributes:
        t: (n,) time since the motion began [s]; of a run, since its movement began: negative before it.
        q: (n, 6) reported joint positions [rad].
        qd: (n, 6) reported joint velocities [rad/s].
        tcp_pose: (n, 6) reported TCP pose: position [m] and rotation vector [rad], base frame.
        qd_cmd: (n, 6) commanded joint velocities [rad/s].
        source: robot, software, serial and simulated, by name.
        stream: commands sent, late and lost frames, stops of the arm, time for a command. Of a recording in
            lockstep, where time waits for the client, it has no times.
    """

    t: Array
    q: Array
    qd: Array
    tcp_pose: Array
    qd_cmd: Array
    source: Source
    stream: StreamReport

    @property
    def simulated(self) -> bool | None:
        """True, False, or None where the robot does not report it."""
        value = self.source["simulated"]
        return None if value is None else value is True

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {np.ptp(self.t):.2f} s, {len(self.t)} rows>"

    @cached_property
    def tcp_speed(self) -> Array:
        """(n,) speed of the TCP [m/s]: reported positions differenced over the last 8 ms, as in Eq. 10.

        The rows of the first 8 ms are 0.
        """
        moved = measures.speed(self.t, self.tcp_pose[:, :3])
        return np.concatenate((np.zeros(len(self.t) - len(moved)), moved))

    def columns(self) -> Mapping[str, Array]:
        """Every number as a column (n,) of its own, by name; RTDE names where RTDE has the signal."""
        return split_columns(
            {
                "t": self.t,
                "actual_q": self.q,
                "actual_qd": self.qd,
                "actual_TCP_pose": self.tcp_pose,
                "tcp_speed": self.tcp_speed,
                "cmd_qd": self.qd_cmd,
            }
        )

    def to_frame(self) -> polars.DataFrame:
        """A table with the rows of the attributes, in their units, and the columns of `source`."""
        return table_of(self.columns(), self.source)

    def plot(self) -> Figure:
        """A figure: speed of the TCP, joint angles, joint velocities."""
        from pc_client.results.matplotlib_figures import draw

        return draw(_signals_sheet(self))


@dataclass(frozen=True, eq=False, repr=False)
class Run(Signals):
    """A run of a plan: reference, signals of the arm, and the figures of the paper.

    Attributes:
        recording: all that was recorded.
    """

    recording: Recording
    _track: measures.TcpTrack

    @classmethod
    def from_file(cls, path: Path | str) -> Run:
        """The run of a recording; rows that repeat a time stamp are left out.

        Raises:
            RecordingError: it cannot be read, or holds too little.
        """
        recording = load_recording(path)
        track = measures.track_of(recording)
        t, q, qd, pose, command = (
            recording.column(name)[track.rows]
            for name in ("timestamp", "actual_q", "actual_qd", "actual_TCP_pose", "cmd_qd")
        )
        whose, summary = recording.provenance, recording.summary
        known = {name: summary[name] for name in StreamReport.__slots__ if name in summary}
        stream = StreamReport(**{"period": whose.cycle_time_s, **known})
        return cls(t - track.t_begin, q, qd, pose, command, whose.source, stream, recording, track)

    def __repr__(self) -> str:
        whose = self.recording.provenance
        level = self.aborted or f"{self.snr:.1f} dB"
        return (
            f"<Run {whose.repetition} of {whose.movement!r} with {whose.controller}: {level}, "
            f"{len(self.t)} rows, {whose.origin.name}>"
        )

    @property
    def aborted(self) -> str:
        """Why the run did not come to its end; empty for a whole one."""
        return self.recording.aborted

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was not as it should be, one line each."""
        return tuple(self.recording.summary.get("warnings", ()))

    @property
    def expected_snr(self) -> float | None:
        """The SNR that loop and controller allow at best, as predicted before [dB]; None of a law."""
        value: float | None = self.recording.summary.get("expected_snr_db")
        return value

    @cached_property
    def measured(self) -> MeasuredRun:
        """All figures measured on the recording.

        Raises:
            RecordingError: the run was given up.
        """
        return analyse_run(self.recording)

    @property
    def snr(self) -> float:
        """Eq. 10 on the scalar speed of the TCP over the movement [dB]: neither shifted nor smoothed.

        A run that was given up has none: `RecordingError`.
        `measured.snr` has the ratios of other definitions, `measured.errors` the errors in mm and rad.
        """
        return self.measured.snr.speed_db

    @property
    def ref_q(self) -> Array:
        """(n, 6) joint positions of the reference [rad]."""
        return self.recording.column("ref_q")[self._track.rows]

    @property
    def ref_tcp_position(self) -> Array:
        """(n, 3) TCP position of the reference [m]."""
        return self.recording.column("ref_tcp_position")[self._track.rows]

    def columns(self) -> Mapping[str, Array]:
        """Every number of the recording as a column (n,) of its own, with `t` and `tcp_speed`."""
        rows = self._track.rows
        recorded = {name: values[rows] for name, values in flat_columns(self.recording).items()}
        return {"t": self.t, "tcp_speed": self.tcp_speed, **recorded}

    def plot(self) -> Figure:
        """The figure of the report: desired and actual TCP speed, error, path, joints and their errors.

        Of a run that was given up that of `Signals`.
        """
        if self.aborted:
            return super().plot()
        from pc_client.results.matplotlib_figures import draw

        return draw(movement_sheet((self.measured,)))

    def view(self, *others: Run) -> str:
        """Show the arm moving, beside other runs, in a window in the browser; return its address.

        Raises:
            RecordingError: the window did not open.
        """
        from pc_client.results.window import open_window

        return open_window(*(run.recording.path for run in (self, *others)))


@dataclass(frozen=True, eq=False)
class MeasuredRun:
    """One recording and what was measured on it.

    Attributes:
        covariance: of the encoders' noise, (6, 6) [rad2], as all runs of the experiment show it at rest;
            None: as this one does.
    """

    recording: Recording
    track: measures.TcpTrack
    snr: measures.Snr
    errors: measures.Errors
    covariance: Array | None = None

    @cached_property
    def noise(self) -> tuple[float, float]:
        """What noise adds to the power of the speed error by its mean and its variance; 0 if not known."""
        covariance = step_covariance([self]) if self.covariance is None else self.covariance
        return noise_power(self, covariance) or (0.0, 0.0)

    @property
    def floor_db(self) -> float | None:
        """The SNR [dB] at which noise alone would leave the run; None where the noise is not known."""
        power, signal = sum(self.noise), self.budget.signal_power
        return measures.decibels(signal, power) if power > 0.0 < signal else None

    @cached_property
    def budget(self) -> measures.Budget:
        """The power of the speed error by its parts."""
        return measures.error_budget(self.track, self.snr.speed_lag_s, self.noise)

    @property
    def provenance(self) -> Provenance:
        """Where the recording comes from."""
        return self.recording.provenance

    @property
    def figures(self) -> dict[str, Any]:
        """The run as a row of a table: levels in dB, lags in ms, parts of the error budget as shares."""
        whose, snr, errors, budget = self.provenance, self.snr, self.errors, self.budget
        return {
            "simulated": whose.simulated,
            "name": whose.movement,
            "kind": whose.kind,
            "n_targets": len(whose.target_points),
            "repetition": whose.repetition,
            "snr_db": snr.speed_db,
            "snr_shifted_db": snr.speed_shifted_db,
            "lag_ms": 1e3 * snr.speed_lag_s,
            "vector_snr_db": snr.velocity_db,
            "vector_snr_shifted_db": snr.velocity_shifted_db,
            "vector_lag_ms": 1e3 * snr.velocity_lag_s,
            "max_position_error_mm": errors.max_position_error_mm,
            "rms_position_error_mm": errors.rms_position_error_mm,
            "max_path_error_mm": errors.max_path_error_mm,
            **{budget_column(part): budget.share(part) for part in measures.PARTS},
            **{f"{budget_column(part)}_alone_db": budget.alone_db(part) for part in measures.PARTS},
        }


def analyse_run(recording: Recording, *, include_aborted: bool = False) -> MeasuredRun:
    """Measure one recording.

    Args:
        recording: of a whole run: the SNR of half a movement cannot stand beside others.
        include_aborted: measure also a run that was given up; name and kind of its movement then say so.

    Raises:
        RecordingError: the run was given up or the file is cut off, signals are missing, or the movement
            phase is too short to be judged.
    """
    if recording.aborted:
        if not include_aborted:
            raise RecordingError(f"{recording.path}: {recording.aborted}: it has no SNR")
        whose = recording.provenance
        name = f"{whose.movement}_r{whose.repetition}_given_up"
        recording = replace(recording, provenance=replace(whose, movement=name, kind=GIVEN_UP))
    track = measures.track_of(recording)
    snr = measures.measure_snr(track)
    return MeasuredRun(
        recording=recording,
        track=track,
        snr=snr,
        errors=measures.measure_errors(recording, track, snr.velocity_lag_s),
    )


def budget_column(part: str) -> str:
    """Name of the column with the share of one part of the error budget."""
    return f"budget_{part.replace(' ', '_')}"


def _signals_sheet(signals: Signals) -> Sheet:
    """A motion without a reference: speed of the TCP, joint angles, joint velocities."""
    t, free = signals.t, (None, None)
    size = (sheet.WIDTH, 7.2)
    (upper,), (middle,), (lower,) = boxes(
        size, (1,), (1, 1, 1), margins=(0.7, 0.15, 0.4, 0.5), gaps=(0.0, 0.5)
    )
    span = (float(t[0]), float(t[-1]))
    commanded = [Curve(np.c_[t, v], sheet.REFERENCE_GREY, width=2.0, stepped=True) for v in signals.qd_cmd.T]
    panels = (
        Panel(
            upper,
            [Curve(np.c_[t, 1e3 * signals.tcp_speed], sheet.BLUE)],
            "",
            ("", "TCP speed [mm/s]"),
            (span, (0.0, None)),
        ),
        Panel(middle, _joint_curves(t, signals.q), "", ("", "joint angle [rad]"), (span, free), "above"),
        Panel(
            lower,
            [*commanded, *_joint_curves(t, signals.qd)],
            "Commanded (grey) and reported",
            ("time [s]", "joint velocity [rad/s]"),
            (span, free),
        ),
    )
    return Sheet(size[1], panels, origin_of(signals.simulated).mark)


def movement_sheet(runs: Sequence[MeasuredRun]) -> Sheet:
    """Everything about the runs of one movement: the paper's figures 4 and 5 and what explains them."""
    first, coloured = runs[0], {sheet.colour_of(i): run for i, run in enumerate(runs)}
    t, track = _step_times(first), first.track
    span = (max(t[0], -0.15), min(t[-1], track.t_end - track.t_start + 0.35))
    size = (sheet.WIDTH, 8.4)
    ((upper, _), (lower, right)) = boxes(
        size, (6.3, 3.7), (2.6, 1.4), margins=(0.72, 0.4, 0.45, 3.4), gaps=(0.2, 0.45)
    )
    below = boxes(size, (1, 1, 1), (1,), margins=(0.72, 0.15, 5.75, 0.5), gaps=(0.8, 0.0))[0]
    desired = speed_curve(first, sheet.REFERENCE_GREY, "desired", desired=True, width=4.0)
    actual = [
        speed_curve(run, colour, f"actual r{run.provenance.repetition}, {run.snr.speed_db:.1f} dB")
        for colour, run in coloured.items()
    ]
    errors = [
        Curve(
            np.c_[_step_times(run), 1e3 * (_speed(run) - _speed(run, desired=True))],
            colour,
            f"r{run.provenance.repetition}",
            0.8,
        )
        for colour, run in coloured.items()
    ]
    panels = (
        Panel(upper, (desired, *actual), "TCP speed", ("", "TCP speed [mm/s]"), (span, (0.0, None)), "above"),
        Panel(
            lower,
            errors,
            "Speed error, actual − desired",
            ("time since the movement began [s]", "error [mm/s]"),
            (span, (None, None)),
        ),
        _path_panel((right[0], right[1] - 0.01, right[2], 0.53), coloured),
        *_joint_panels(below, first),
        _spread_panel(below[2], coloured),
    )
    return Sheet(size[1], panels, first.provenance.origin.mark)


def speed_curve(
    run: MeasuredRun, colour: str, label: str = "", *, desired: bool = False, width: float = 0.9
) -> Curve:
    """TCP speed [mm/s] over the time since the movement began [s]; not smoothed."""
    return Curve(np.c_[_step_times(run), 1e3 * _speed(run, desired=desired)], colour, label, width)


def _path_panel(box: Box, coloured: Mapping[str, MeasuredRun]) -> Panel:
    first = next(iter(coloured.values()))
    targets = 1e3 * np.array(first.provenance.target_points, dtype=np.float64).reshape(-1, 3)
    desired = Curve(
        1e3 * first.track.p_ref[first.track.movement], sheet.REFERENCE_GREY, width=3.0, opacity=0.6
    )
    actual = [
        Curve(1e3 * run.track.p_actual[run.track.movement], colour, width=0.9)
        for colour, run in coloured.items()
    ]
    circles = Curve(targets, "#000000", width=0.0, marker="o", hollow=True)
    return Panel(
        box,
        (desired, *actual, circles),
        "TCP path and target points, base frame",
        ("x [mm]", "y [mm]", "z [mm]"),
        sheet.cube_around(np.vstack([desired.points, targets])),
        texts=[(target, str(i)) for i, target in enumerate(targets, start=1)],
    )


def _joint_panels(places: Sequence[Box], run: MeasuredRun) -> tuple[Panel, Panel]:
    rows, moving, number = run.track.rows, run.track.movement, f"r{run.provenance.repetition}"
    t = run.track.t[moving] - run.track.t_start
    ref, actual = (run.recording.column(name)[rows][moving] for name in ("ref_q", "actual_q"))
    wanted = [Curve(np.c_[t, q], sheet.REFERENCE_GREY, width=2.6) for q in (ref - ref[0]).T]
    errors = 1e3 * measures.joint_errors(run.recording, run.track)[moving]
    return (
        Panel(
            places[0],
            [*wanted, *_joint_curves(t, actual - ref[0])],
            f"Joints, reference (grey) and actual, {number}",
            ("time [s]", "angle since start [rad]"),
            ((float(t[0]), float(t[-1])), (None, None)),
        ),
        Panel(
            places[1],
            _joint_curves(t, errors),
            f"Joint tracking error, {number}",
            ("time [s]", "reference − actual [mrad]"),
            ((float(t[0]), float(t[-1])), (None, None)),
            "inside",
            columns=3,
        ),
    )


def _spread_panel(box: Box, coloured: Mapping[str, MeasuredRun]) -> Panel:
    errors = [1e3 * measures.position_errors(run.track) for run in coloured.values()]
    edges = np.linspace(0.0, max(1e-3, *(float(e.max()) for e in errors)), 31)
    curves = []
    for (colour, run), error in zip(coloured.items(), errors, strict=True):
        shares = 100.0 * np.histogram(error, edges)[0] / len(error)
        label = f"r{run.provenance.repetition}: rms {run.errors.rms_position_error_mm:.2f} mm"
        curves.append(Curve(np.c_[edges, np.append(shares, 0.0)], colour, label, 1.2, stepped=True))
    return Panel(
        box,
        curves,
        "Position error over the movement",
        ("TCP position error [mm]", "share of time [%]"),
        ((0.0, float(edges[-1])), (0.0, None)),
        "inside",
        columns=1,
    )


def _joint_curves(t: Array, values: Array) -> list[Curve]:
    return [
        Curve(np.c_[t, v], sheet.colour_of(i), name)
        for i, (v, name) in enumerate(zip(values.T, JOINT_NAMES, strict=True))
    ]


def _speed(run: MeasuredRun, *, desired: bool = False) -> Array:
    """TCP speed at each step [m/s]."""
    return measures.speed(run.track.t, run.track.p_ref if desired else run.track.p_actual)


def _step_times(run: MeasuredRun) -> Array:
    """The middle of each step, s since the movement began."""
    t = run.track.t
    begins, ends = measures.steps_of(t)
    middle: Array = 0.5 * (t[begins] + t[ends]) - run.track.t_start
    return middle
