"""What programs that import the client get of a motion: arrays, a table (polars), a figure (matplotlib)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pc_client.analysis import measures
from pc_client.analysis.run import MeasuredRun, analyse_run
from pc_client.arrays import Array
from pc_client.driver.velocity_stream import StreamReport
from pc_client.recording.export import flat_columns, split_columns, table_of
from pc_client.recording.provenance import Source, origin_of
from pc_client.recording.recording import Recording, load_recording

if TYPE_CHECKING:
    import polars
    from matplotlib.figure import Figure


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
        from pc_client.analysis.run_figures import signals_figure

        mark = origin_of(self.simulated).mark
        return signals_figure(self.t, self.tcp_speed, self.q, self.qd, self.qd_cmd, mark)


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
        from pc_client.analysis.run_figures import movement_figure

        return movement_figure((self.measured,))

    def view(self, *others: Run) -> str:
        """Show the arm moving, beside other runs, in a window in the browser; return its address.

        Raises:
            RecordingError: the window did not open.
        """
        from pc_client.results.window import open_window

        return open_window(*(run.recording.path for run in (self, *others)))
