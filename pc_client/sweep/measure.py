"""One recording as the figures of one row."""

from __future__ import annotations

import math
from pathlib import Path

from pc_client.analysis.budget import PARTS
from pc_client.analysis.run import analyse_run
from pc_client.driver.velocity_stream import StreamReport
from pc_client.experiment.identification import Identification
from pc_client.recording.loader import load_recording
from pc_client.sweep.columns import budget_column
from pc_client.sweep.outcome import Row, Value


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
    figures: dict[str, Value] = {
        "simulated": run.provenance.simulated,
        "kind": run.provenance.kind,
        "repetition": run.provenance.repetition,
        "snr_db": run.snr.speed_db,
        "snr_shifted_db": run.snr.speed_shifted_db,
        "lag_ms": 1e3 * run.snr.speed_lag_s,
        "vector_snr_db": run.snr.velocity_db,
        "vector_snr_shifted_db": run.snr.velocity_shifted_db,
        "max_position_error_mm": run.errors.max_position_error_mm,
        "rms_position_error_mm": run.errors.rms_position_error_mm,
        "max_path_error_mm": run.errors.max_path_error_mm,
        "late_frames": stream.late_frames,
        "lost_frames": stream.lost_frames,
    }
    figures.update({budget_column(part): run.budget.share(part) for part in PARTS})
    return {name: _finite(value) for name, value in figures.items()}


def loop_figures(found: Identification) -> Row:
    """Delay and gain margin of an identified loop."""
    return {"delay_ms": 1e3 * found.delay, "gain_margin": _finite(found.margins.gain)}


def _finite(value: Value) -> Value:
    """None for infinity (no error at all, no feedback): tables do not agree on how to write it."""
    return None if isinstance(value, float) and not math.isfinite(value) else value
