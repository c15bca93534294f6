"""Tables: a polars frame holds the values, a record for each column says how people read them.

    COLUMNS = (Column("name", "movement", align="left"), Column("lag_ms", "lag", "ms", ".1f"))
    console.print(to_rich(frame, COLUMNS, title="Table I"))

A missing value (null in the frame) is an empty cell or what its column names; one that is not finite (nothing
to fit, no error at all) is a dash. Both are null in JSON.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any, Literal

from pc_client.errors import printable

if TYPE_CHECKING:
    import polars as pl
    from rich.table import Table as RichTable


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a table.

    Attributes:
        name: of the column in the frame.
        header: its heading; empty: the name.
        unit: stands in brackets behind the heading.
        format: of its values, as Python's `format` takes it; empty: as `str` writes them.
        missing: the cell of a missing value.
        narrow: the heading on a terminal, with line breaks; empty: the unit stands below the heading.
        kind: type of its values; any of them may be missing.
        text: what it is, in one phrase.
    """

    name: str
    header: str = ""
    unit: str = ""
    format: str = ""
    align: Literal["left", "right"] = "right"
    missing: str = ""
    narrow: str = ""
    kind: type = float
    text: str = ""

    @property
    def heading(self) -> str:
        """Header and unit on one line."""
        return f"{self.header or self.name} [{self.unit}]" if self.unit else self.header or self.name

    def cell(self, value: Any) -> str:
        """One value as people read it."""
        if value is None:
            return self.missing
        return "–" if isinstance(value, float) and not math.isfinite(value) else format(value, self.format)


def frame_of(rows: Iterable[Mapping[str, Any]], columns: Sequence[Column]) -> pl.DataFrame:
    """Rows of values by column name as a frame with exactly these columns; what is not there is null."""
    import polars as pl  # here: columns are declared also where no table is made, as in worker processes

    return pl.DataFrame(list(rows), {column.name: column.kind for column in columns})


def cells(frame: pl.DataFrame, columns: Sequence[Column]) -> list[list[str]]:
    """All cells as texts, row by row: for pages, and for the other forms below."""
    rows = frame.select(column.name for column in columns).iter_rows()
    return [[column.cell(value) for column, value in zip(columns, row, strict=True)] for row in rows]


def to_markdown(frame: pl.DataFrame, columns: Sequence[Column]) -> str:
    """A table for a document, without a line break at its end."""
    lines = [[column.heading for column in columns], *cells(frame, columns)]
    texts = ["| " + " | ".join(line) + " |" for line in lines]
    rule = "|".join("---" if column.align == "left" else "---:" for column in columns)
    return "\n".join([texts[0], f"|{rule}|", *texts[1:]])


def to_rich(
    frame: pl.DataFrame,
    columns: Sequence[Column],
    *,
    bold: str = "",
    section: str = "",
    padding: int | tuple[int, int, int, int] = (0, 1, 0, 0),
    title: str = "",
    caption: str = "",
) -> RichTable:
    """A table for a terminal.

    Args:
        bold: a column of truth values: these rows are bold.
        section: a column: where its value changes, an empty line follows.
        padding: of the cells: top, right, bottom, left.
    """
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape as as_it_is
    from rich.table import Table as RichTable
    from rich.text import Text

    # Brackets in a name are no style: texts are escaped, headings and cells are no markup.
    table = RichTable(title=as_it_is(title), caption=as_it_is(caption), box=SIMPLE_HEAD, padding=padding)
    for column in columns:
        heading = column.narrow or column.heading.replace(" [", "\n[")
        is_number = column.align == "right"
        table.add_column(Text(heading), justify=column.align, no_wrap=is_number, overflow="fold")
    n = len(frame)
    is_bold = frame[bold].to_list() if bold else [False] * n
    keys = frame[section].to_list() if section else [None] * n
    for i, row in enumerate(cells(frame, columns)):
        ends = i + 1 < n and keys[i] != keys[i + 1]
        table.add_row(
            *(Text(printable(c)) for c in row), style="bold" if is_bold[i] else None, end_section=ends
        )
    return table


def to_html(frame: pl.DataFrame, columns: Sequence[Column], *, bold: str = "", links: bool = False) -> str:
    """A table for a page, escaped.

    Args:
        bold: a column of truth values: these rows are bold (class `mean`).
        links: the first cell of each row that is not bold is a link to the section that it names.
    """
    heads = "".join(f"<th>{escape(column.heading).replace(' [', '<br>[')}</th>" for column in columns)
    lines = []
    is_bold = frame[bold].to_list() if bold else [False] * len(frame)
    for row, strong in zip(cells(frame, columns), is_bold, strict=True):
        texts = [escape(cell) for cell in row]
        if links and not strong:
            texts[0] = f'<a href="#{texts[0]}" style="color:inherit">{texts[0]}</a>'
        tag = '<tr class="mean">' if strong else "<tr>"
        lines.append(tag + "".join(f"<td>{text}</td>" for text in texts) + "</tr>")
    return f"<table>\n<thead><tr>{heads}</tr></thead>\n<tbody>\n" + "\n".join(lines) + "\n</tbody></table>"


def to_csv(frame: pl.DataFrame) -> str:
    """All values to the last digit, with the columns' names as the first line."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(frame.columns)
    for row in frame.iter_rows():
        writer.writerow([str(value).lower() if isinstance(value, bool) else value for value in row])
    return text.getvalue()


def finite(value: Any, digits: int | None = None) -> Any:
    """The same nested data with numbers rounded, and None for those that JSON does not know."""
    if isinstance(value, dict):
        return {key: finite(item, digits) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item, digits) for item in value]
    if isinstance(value, float):
        value = value if digits is None else round(value, digits)
        return value if math.isfinite(value) else None
    return value


def to_json(value: Any, digits: int | None = None) -> str:
    """The text of a JSON file: nested data, rounded to so many digits; what is not finite is null."""
    return json.dumps(finite(value, digits), indent=2, allow_nan=False) + "\n"
