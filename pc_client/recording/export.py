"""The rows of a recording as CSV or Parquet, for tools that do not read MCAP.

Vectors become one column a component, `actual_q_0` .. `actual_q_5`; names and units stay RTDE's.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pc_client.errors import RecordingError
from pc_client.recording.loader import Recording

ExportFormat = Literal["csv", "parquet"]


def export(recording: Recording, path: Path | str, format: ExportFormat = "csv") -> Path:
    """Write all rows of a recording into one table.

    Args:
        recording: what to export.
        path: file to write; an existing one is replaced.
        format: "csv" (full float precision) or "parquet" (needs pyarrow; carries the provenance too).

    Returns:
        The path written.

    Raises:
        RecordingError: unknown format, pyarrow missing, or the file cannot be written.
    """
    path = Path(path)
    if format not in get_args(ExportFormat):
        raise RecordingError(f"cannot export to {format!r}; use one of {', '.join(get_args(ExportFormat))}")
    columns = flat_columns(recording)
    try:
        if format == "csv":
            _write_csv(columns, path)
        else:
            _write_parquet(columns, recording.provenance.to_metadata(), path)
    except OSError as error:
        raise RecordingError(f"cannot write {path}: {error.strerror or error}") from error
    return path


def flat_columns(recording: Recording) -> dict[str, NDArray[np.float64]]:
    """Return every number of the rows as its own column (n,), in file order."""
    return split_columns({signal.name: recording.column(signal.name) for signal in recording.signals})


def split_columns(signals: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
    """Return every component of signals (n,) or (n, count) as its own column (n,), such as `actual_q_0`."""
    columns: dict[str, NDArray[np.float64]] = {}
    for name, values in signals.items():
        if values.ndim == 1:
            columns[name] = values
        else:
            columns.update({f"{name}_{i}": values[:, i] for i in range(values.shape[1])})
    return columns


def _write_csv(columns: dict[str, NDArray[np.float64]], path: Path) -> None:
    text = io.StringIO()
    text.write(",".join(columns) + "\n")
    for row in np.column_stack(list(columns.values())).tolist():
        text.write(",".join(map(repr, row)) + "\n")  # repr: the shortest text that gives the same number
    path.write_text(text.getvalue(), encoding="utf-8", newline="\n")


def _write_parquet(columns: dict[str, NDArray[np.float64]], provenance: dict[str, str], path: Path) -> None:
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise RecordingError(
            "export to parquet needs pyarrow; install it with: pip install 'ur-hil[export]'"
        ) from error
    table = pyarrow.table({name: np.ascontiguousarray(values) for name, values in columns.items()})
    parquet.write_table(table.replace_schema_metadata(provenance), path)
