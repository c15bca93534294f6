"""One recording as the figures of one row."""

from __future__ import annotations

from pathlib import Path

from pc_client.analysis.run import analyse_run
from pc_client.driver.velocity_stream import StreamReport
from pc_client.experiment.identification import Identification
from pc_client.recording.recording import load_recording
from pc_client.results.tables import finite
from pc_client.sweep.columns import FIGURES
from pc_client.sweep.outcome import Row


def measure_run(path: Path, stream: StreamReport) -> Row:
    """Measure one finished run.

    Args:
        path: its recording.
        stream: what happened on the wire.

    Returns:
        The figures by the names of `columns.FIGURES`, but for those of the loop.

    Raises:
        RecordingError: the recording cannot be judged.
    """
    run = analyse_run(load_recording(path))
    figures = run.figures | {"late_frames": stream.late_frames, "lost_frames": stream.lost_frames}
    return _finite({column.name: figures[column.name] for column in FIGURES if column.name in figures})


def loop_figures(found: Identification) -> Row:
    """Delay and gain margin of an identified loop."""
    return _finite({"delay_ms": 1e3 * found.delay, "gain_margin": found.margins.gain})


def _finite(figures: Row) -> Row:
    """None for infinity (no error at all, no feedback): tables do not agree on how to write it."""
    row: Row = finite(figures)
    return row
