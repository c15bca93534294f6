"""Tables of numbers as text: samples of movements, target points.

One row a line; columns are separated by commas, semicolons, tabs or blanks. A first line of their names may
give another order. Empty lines and lines that begin with # are skipped.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pc_client.arrays import Array
from pc_client.errors import MovementError

_SEPARATOR = re.compile(r"\s*[,;\t]\s*|\s+")


class Rows(NamedTuple):
    """A table: values (n, m) in the order of `columns`, and the line (n,) of each row."""

    columns: tuple[str, ...]
    values: Array
    lines: tuple[int, ...]


def parse_rows(text: str, source: str, forms: Sequence[tuple[str, ...]], wanted: str) -> Rows:
    """Rows of finite numbers; a column t must increase.

    Args:
        text: the file's content.
        source: the file's name, for messages.
        forms: the columns that the table may have; without a first line of names, the only one with as many
            columns.
        wanted: what the columns are, for messages.

    Raises:
        MovementError: naming the line.
    """
    columns: tuple[str, ...] = ()
    order: list[int] = []
    rows: list[list[float]] = []
    lines: list[int] = []
    for number, line in enumerate(text.splitlines(), start=1):
        cells = line.strip().lstrip("\ufeff")
        if not cells or cells.startswith("#"):
            continue
        fields = _SEPARATOR.split(cells)
        if not columns:
            names = [name.strip('"').lower() for name in fields]
            header = next((form for form in forms if sorted(names) == sorted(form)), None)
            fitting = [form for form in forms if len(form) == len(fields)]
            if not header and len(fitting) > 1:
                raise MovementError(
                    f"{source}, line {number}: {len(fields)} columns without names may be "
                    f"{' or '.join(', '.join(form) for form in fitting)}; name them in the first line"
                )
            columns = header or next(iter(fitting), ())
            order = [names.index(name) for name in columns] if header else list(range(len(columns)))
            if header:
                continue
        if not columns or len(fields) != len(columns):
            raise MovementError(f"{source}, line {number}: {len(fields)} columns; give {wanted}")
        row = [
            _parse_number(fields[place], source, number, name)
            for place, name in zip(order, columns, strict=True)
        ]
        if "t" in columns and rows and row[columns.index("t")] <= rows[-1][columns.index("t")]:
            now, before = (values[columns.index("t")] for values in (row, rows[-1]))
            raise MovementError(
                f"{source}, line {number}: t = {now:g} s after t = {before:g} s in line {lines[-1]}; "
                "times must increase"
            )
        rows.append(row)
        lines.append(number)
    return Rows(columns, np.array(rows, dtype=np.float64).reshape(len(rows), len(columns)), tuple(lines))


def _parse_number(text: str, source: str, line: int, column: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise MovementError(f'{source}, line {line}: {column} is "{text}"; give a finite number')
    return value
