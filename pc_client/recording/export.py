"""The rows of a recording as CSV or Parquet, for tools that do not read MCAP.

Vectors become one column a component, `actual_q_0` .. `actual_q_5`, under the names of RTDE. In CSV the unit
stands behind the name, `actual_q_0 [rad]`; in Parquet, as JSON under the key "units", beside the provenance.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pc_client.errors import RecordingError
from pc_client.recording.loader import Recording

_ExportFormat = Literal["csv", "parquet"]


def export(recording: Recording, path: Path | str, format: _ExportFormat = "csv") -> Path:
    """Write all rows of a recording into one table.

    Args:
        recording: what to export.
        path: file to write; an existing one is replaced.
        format: "csv" (full float precision) or "parquet" (carries the provenance too).

    Returns:
        The path written.

    Raises:
        RecordingError: unknown format, or the file cannot be written.
    """
    import polars

    path = Path(path)
    if format not in get_args(_ExportFormat):
        raise RecordingError(f"cannot export to {format!r}; use one of {', '.join(get_args(_ExportFormat))}")
    table, units, content = polars.DataFrame(flat_columns(recording)), _column_units(recording), BytesIO()
    if format == "csv":
        table.rename({name: f"{name} [{unit}]" for name, unit in units.items()}).write_csv(content)
    else:
        facts = {**recording.provenance.to_metadata(), "units": json.dumps(units)}
        table.write_parquet(content, metadata=facts)
    try:
        path.write_bytes(content.getbuffer())
    except OSError as error:
        raise RecordingError(f"cannot write {path}: {error.strerror or error}") from error
    return path


def flat_columns(recording: Recording) -> dict[str, NDArray[np.float64]]:
    """Return every number of the rows as its own column (n,), in file order."""
    return split_columns({signal.name: recording.column(signal.name) for signal in recording.signals})


def _column_units(recording: Recording) -> dict[str, str]:
    """Return the unit of every column of `flat_columns` that has one."""
    names = iter(flat_columns(recording))
    units = (unit for signal in recording.signals for unit in signal.units)
    return {name: unit for name, unit in zip(names, units, strict=True) if unit}


def split_columns(signals: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
    """Return every component of signals (n,) or (n, count) as its own column (n,), such as `actual_q_0`."""
    columns: dict[str, NDArray[np.float64]] = {}
    for name, values in signals.items():
        if values.ndim == 1:
            columns[name] = values
        else:
            columns.update({f"{name}_{i}": values[:, i] for i in range(values.shape[1])})
    return columns
