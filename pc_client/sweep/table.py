"""The table of a sweep as a file: Parquet where pyarrow is installed, else CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from typing import Literal, get_args

from pc_client.errors import SweepError
from pc_client.sweep.columns import COLUMNS

TableFormat = Literal["parquet", "csv"]


def table_format(wanted: str | None) -> TableFormat:
    """The format to write.

    Args:
        wanted: "parquet", "csv", or None: Parquet if it can be written here.

    Raises:
        SweepError: no such format, or Parquet without pyarrow.
    """
    if wanted is None:
        return "parquet" if find_spec("pyarrow") else "csv"
    if wanted not in get_args(TableFormat):
        raise SweepError(
            f"no table format is called {wanted!r}; use one of {', '.join(get_args(TableFormat))}"
        )
    if wanted == "parquet" and not find_spec("pyarrow"):
        raise SweepError(
            "a Parquet table needs pyarrow; run `pip install 'ur-hil[export]'` or give --format csv"
        )
    return "csv" if wanted == "csv" else "parquet"


def table_content(rows: Sequence[Mapping[str, object]], format: TableFormat) -> bytes:
    """The table as the content of a file.

    Args:
        rows: values by column; what is not there stays empty.
        format: of the file.

    Returns:
        All of it; the same rows give the same bytes.
    """
    return _parquet(rows) if format == "parquet" else _csv(rows)


def _csv(rows: Sequence[Mapping[str, object]]) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([column.name for column in COLUMNS])
    for row in rows:
        writer.writerow([_cell(row.get(column.name)) for column in COLUMNS])
    return text.getvalue().encode()


def _cell(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return "" if value is None else repr(value) if isinstance(value, float) else str(value)


def _parquet(rows: Sequence[Mapping[str, object]]) -> bytes:
    import pyarrow
    from pyarrow import parquet

    kinds = {
        str: pyarrow.string(),
        int: pyarrow.int64(),
        float: pyarrow.float64(),
        bool: pyarrow.bool_(),
    }
    schema = pyarrow.schema(
        [
            pyarrow.field(column.name, kinds[column.kind], metadata={"description": column.text})
            for column in COLUMNS
        ]
    )
    values = {column.name: [row.get(column.name) for row in rows] for column in COLUMNS}
    page = io.BytesIO()
    parquet.write_table(pyarrow.table(values, schema=schema), page)
    return page.getvalue()
