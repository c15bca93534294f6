"""The signals of a motion, as named numpy arrays, as a table (polars), and as a figure (matplotlib)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pc_client.analysis.run import MeasuredRun, analyse_run
from pc_client.analysis.track import speed
from pc_client.recording.export import flat_columns, split_columns
from pc_client.recording.loader import load_recording

if TYPE_CHECKING:
    import polars
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

__all__ = ["Run", "Signals"]


@dataclass(frozen=True, eq=False, repr=False)
class Signals:
    """Signals of one motion, one row a control cycle; of a run one every 8 ms, as Eq. 10 has them.

    Attributes:
        t: (n,) time since the motion began [s]; of a run, since its movement began: negative before it.
        q: (n, 6) reported joint positions [rad].
        qd: (n, 6) reported joint velocities [rad/s].
        tcp_pose: (n, 6) reported TCP pose: position [m] and rotation vector [rad], base frame.
        qd_cmd: (n, 6) commanded joint velocities [rad/s].
        simulated: True, False, or None where the robot does not report it.
    """

    t: Array
    q: Array
    qd: Array
    tcp_pose: Array
    qd_cmd: Array
    simulated: bool | None

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {np.ptp(self.t):.2f} s, {len(self.t)} rows>"

    @cached_property
    def tcp_speed(self) -> Array:
        """(n,) speed of the TCP [m/s]: the first difference of reported positions, as in Eq. 10; first 0."""
        return np.concatenate(([0.0], speed(self.t, self.tcp_pose[:, :3])))

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
        """A table with the rows of the attributes, in their units."""
        import polars

        return polars.DataFrame(dict(self.columns()))

    def plot(self) -> Figure:
        """A figure: speed of the TCP, joint angles, joint velocities."""
        from pc_client.analysis.figures import signals_sheet
        from pc_client.results.static import draw

        return draw(signals_sheet(self.t, self.tcp_speed, self.q, self.qd, self.qd_cmd, self.simulated))


@dataclass(frozen=True, eq=False, repr=False)
class Run(Signals):
    """A run of a plan: reference, signals of the arm, and the figures of the paper.

    Attributes:
        measured: the recording with all figures measured on it.
    """

    measured: MeasuredRun

    @classmethod
    def from_file(cls, path: Path | str) -> Run:
        """The run of a recording; rows that repeat a time stamp are left out.

        Raises:
            RecordingError: it cannot be read, or holds too little.
        """
        measured = analyse_run(load_recording(path))
        recording, track = measured.recording, measured.track
        q, qd, pose, command = (
            recording.column(name)[track.rows]
            for name in ("actual_q", "actual_qd", "actual_TCP_pose", "cmd_qd")
        )
        simulated = recording.provenance.simulated
        return cls(track.t - track.t_begin, q, qd, pose, command, simulated, measured)

    def __repr__(self) -> str:
        whose = self.measured.provenance
        return (
            f"<Run {whose.repetition} of {whose.movement!r} with {whose.controller}: {self.snr:.1f} dB, "
            f"{len(self.t)} rows, {whose.origin.name}>"
        )

    @property
    def snr(self) -> float:
        """Eq. 10 on the scalar speed of the TCP over the movement [dB]: neither shifted nor smoothed.

        `measured.snr` has the ratios of other definitions, `measured.errors` the errors in mm and rad.
        """
        return self.measured.snr.speed_db

    @property
    def ref_q(self) -> Array:
        """(n, 6) joint positions of the reference [rad]."""
        return self.measured.recording.column("ref_q")[self.measured.track.rows]

    @property
    def ref_tcp_position(self) -> Array:
        """(n, 3) TCP position of the reference [m]."""
        return self.measured.track.p_ref

    def columns(self) -> Mapping[str, Array]:
        """Every number of the recording as a column (n,) of its own, with `t` and `tcp_speed`."""
        rows = self.measured.track.rows
        recorded = {name: values[rows] for name, values in flat_columns(self.measured.recording).items()}
        return {"t": self.t, "tcp_speed": self.tcp_speed, **recorded}

    def plot(self) -> Figure:
        """The figure of the report: desired and actual TCP speed, error, path, joints and their errors."""
        from pc_client.analysis.figures import movement_sheet
        from pc_client.results.static import draw

        return draw(movement_sheet((self.measured,)))
