"""The rows of a recording as tables: CSV, Parquet or MATLAB's MAT.

Vectors become one column a component, `actual_q_0` .. `actual_q_5`, under the names of RTDE; the last columns
say in every row whose data these are: robot, software, serial, simulated. In CSV the unit stands behind the
name, `actual_q_0 [rad]`; in Parquet, as JSON under the key "units", beside the provenance. MAT has matrices,
one row a cycle, under the names of `_MAT_VARIABLES`, and the provenance as a struct.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from scipy.io import savemat

from pc_client.arrays import Array
from pc_client.errors import RecordingError
from pc_client.recording.provenance import Source
from pc_client.recording.recording import Recording

if TYPE_CHECKING:
    import polars

_ExportFormat = Literal["csv", "parquet", "mat"]

_MAT_VARIABLES = {
    "t": "timestamp",
    "q": "actual_q",
    "qd": "actual_qd",
    "tcp_pose": "actual_TCP_pose",
    "qd_cmd": "cmd_qd",
    **{name: name for name in ("phase", "ref_t", "ref_q", "ref_qd", "ref_tcp_position", "ref_tcp_velocity")},
}
"""Variables of a MAT file, and the signals that they hold."""


def export(recording: Recording, path: Path | str, format: _ExportFormat = "csv") -> Path:
    """Write all rows of a recording into one table; an existing file is replaced.

    Args:
        format: "csv" (full float precision), "parquet" or "mat" (carry the provenance too).

    Raises:
        RecordingError: unknown format, or the file cannot be written.
    """
    path = Path(path)
    if format not in get_args(_ExportFormat):
        raise RecordingError(f"cannot export to {format!r}; use one of {', '.join(get_args(_ExportFormat))}")
    content = BytesIO()
    if format == "mat":
        recorded = {signal.name for signal in recording.signals}
        kept = {name: recording.column(of) for name, of in _MAT_VARIABLES.items() if of in recorded}
        whose = _mat_struct(asdict(recording.provenance))
        savemat(content, {**kept, "provenance": whose}, long_field_names=True, oned_as="column")
    else:
        columns = flat_columns(recording)
        table = table_of(columns, recording.provenance.source)
        all_units = (unit for signal in recording.signals for unit in signal.units)
        units = {name: unit for name, unit in zip(columns, all_units, strict=True) if unit}
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


def _mat_struct(facts: Mapping[str, object]) -> dict[str, object]:
    """Facts as fields of a struct: what is not known is the empty matrix."""
    return {
        name: [] if fact is None else _mat_struct(fact) if isinstance(fact, Mapping) else fact
        for name, fact in facts.items()
    }


def table_of(columns: Mapping[str, Array], source: Source) -> polars.DataFrame:
    """A table of columns (n,), with the columns of their source behind them."""
    import polars

    kinds = {"simulated": polars.Boolean}
    constants = {name: polars.lit(value, kinds.get(name, polars.String)) for name, value in source.items()}
    return polars.DataFrame(dict(columns)).with_columns(**constants)


def flat_columns(recording: Recording) -> dict[str, Array]:
    """Return every number of the rows as its own column (n,), in file order."""
    return split_columns({signal.name: recording.column(signal.name) for signal in recording.signals})


def split_columns(signals: Mapping[str, Array]) -> dict[str, Array]:
    """Return every component of signals (n,) or (n, count) as its own column (n,), such as `actual_q_0`."""
    columns: dict[str, Array] = {}
    for name, values in signals.items():
        columns |= {name: values} if values.ndim == 1 else {f"{name}_{i}": v for i, v in enumerate(values.T)}
    return columns
