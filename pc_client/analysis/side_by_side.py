"""Several experiments in one table and on one page: the paper's real arm, the published controller, ours.

A controller whose numbers were changed gets no column of its own where the unchanged one has run on the same
arm: it is a row of the table that shows how the means move with these numbers.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.table import Table as RichTable
from rich.text import Text

from pc_client.analysis.page import data_uri, render, report_libraries
from pc_client.analysis.report import REPORT_HTML, Report, provenance_facts, write_text
from pc_client.analysis.table import KINDS, SHARED, Row, Table
from pc_client.control.controller_fields import FIELDS
from pc_client.errors import RecordingError

_TEMPLATE = "analysis/side_by_side.html.j2"
_PUBLISHED = "paper"
"""Name of the controller with the published law."""


@dataclass(frozen=True, slots=True)
class Line:
    """One movement: the paper's figure and a row of each experiment; None where it has none."""

    name: str
    kind: str
    n_targets: int
    paper_snr_db: float | None
    rows: tuple[Row | None, ...]


@dataclass(frozen=True, slots=True)
class SideBySide:
    """The experiments of one page.

    Attributes:
        columns: what stands beside the paper's figures, in the order given.
        changed: the same controllers with other numbers.
    """

    columns: tuple[Table, ...]
    changed: tuple[Table, ...]

    @property
    def lines(self) -> list[Line]:
        """All movements that any column has, in the order of the tables."""
        found: dict[str, list[Row | None]] = {}
        for kind in dict.fromkeys((*KINDS, *(row.kind for table in self.columns for row in table.rows))):
            for i, table in enumerate(self.columns):
                for row in table.rows_of(kind):
                    found.setdefault(row.name, [None] * len(self.columns))[i] = row
        return [_line(rows) for rows in found.values()]

    @property
    def kinds(self) -> list[str]:
        """The kinds of movement, in the order of the lines."""
        return list(dict.fromkeys(line.kind for line in self.lines))

    def paper_mean_of(self, kind: str) -> float | None:
        """The mean of the paper's figures for the lines of one kind, dB; None without any."""
        return next((mean for table in self.columns if (mean := table.paper_mean_of(kind)) is not None), None)

    @property
    def arms(self) -> list[str]:
        """Which arm moved, one line for each that did."""
        arms: dict[str, list[str]] = {}
        for table in self.columns:
            arms.setdefault(table.provenance.arm, []).append(label_of(table))
        return [f"{', '.join(labels)}: {arm}" for arm, labels in arms.items()]

    def changes_of(self, table: Table) -> list[Table]:
        """A column and the same controller with other numbers; nothing when there is none."""
        changed = [other for other in self.changed if _base(other) == _base(table)]
        return [table, *changed] if changed else []

    def to_rich(self) -> RichTable:
        """Return the table for the terminal."""
        rich = RichTable(
            title="\n".join(["The paper's experiment: SNR of the TCP speed, Eq. 10, in dB", *self.arms]),
            caption=SHARED,
            box=SIMPLE_HEAD,
            padding=(0, 1, 0, 0),
        )
        rich.add_column("movement", no_wrap=True)
        heads = ["paper,\nreal UR3"]
        for table in self.columns:
            heads += [label_of(table).removesuffix(" controller"), "lag\n[ms]", "error\n[mm]"]
        for head in heads:
            rich.add_column(Text(head), justify="right")
        for kind in self.kinds:
            lines = [line for line in self.lines if line.kind == kind]
            for line in lines:
                cells = [cell for row in line.rows for cell in _cells(row)]
                rich.add_row(line.name, _level(line.paper_snr_db), *cells)
            means = [cell for table in self.columns for cell in (_level(table.mean_of(kind)), "", "")]
            rich.add_row(
                f"mean {kind}", _level(self.paper_mean_of(kind)), *means, style="bold", end_section=True
            )
        return rich


def side_by_side(tables: Sequence[Table]) -> SideBySide:
    """Put experiments beside each other.

    Raises:
        RecordingError: there is none.
    """
    if not tables:
        raise RecordingError("there is no experiment to show; give at least one folder")
    unchanged = {_base(table) for table in tables if table.controller == _base(table)[1]}
    changed = [t for t in tables if t.controller != _base(t)[1] and _base(t) in unchanged]
    return SideBySide(tuple(t for t in tables if t not in changed), tuple(changed))


def label_of(table: Table) -> str:
    """What the column of an experiment is called."""
    return "published controller" if table.controller == _PUBLISHED else table.controller


def build_side_by_side(reports: Sequence[Report], out: Path) -> SideBySide:
    """Write one page of several experiments.

    Args:
        reports: of their folders; the page links to those that have pages.
        out: the page.

    Returns:
        What is on it.

    Raises:
        RecordingError: there is no experiment, matplotlib or jinja2 is missing, or the page cannot be
            written.
    """
    shown = side_by_side([report.table for report in reports])
    with report_libraries():
        from pc_client.analysis import side_by_side_figures as figures
    folder = {id(report.table): report.paths[0].parent for report in reports}
    text = render(
        _TEMPLATE,
        shown=shown,
        heads=[_head(table, folder[id(table)], out) for table in shown.columns],
        levels_figure=data_uri(figures.draw_levels(shown)),
        speeds_figure=data_uri(figures.draw_speeds(shown)),
        published=next((t for t in shown.columns if t.controller == _PUBLISHED), None),
        settings=[_settings(tables) for t in shown.columns if (tables := shown.changes_of(t))],
        provenance=_common([provenance_facts(table) for table in shown.columns]),
        left_out=[f"{report.paths[0].parent.name}/{line}" for report in reports for line in report.left_out],
    )
    write_text(out, text)
    return shown


def _base(table: Table) -> tuple[str, str]:
    """The arm, and the name of the controller that the numbers of this one started from."""
    p = table.provenance
    return f"{p.arm} {p.pace}", str(p.controller_config.get("name", table.controller))


def _line(rows: Sequence[Row | None]) -> Line:
    row = next(row for row in rows if row is not None)
    n_targets = len(row.runs[0].provenance.target_points)
    return Line(row.name, row.kind, n_targets, row.paper_snr_db, tuple(rows))


def _head(table: Table, folder: Path, out: Path) -> Mapping[str, Any]:
    """What the page says of a column."""
    page = folder / REPORT_HTML
    link = Path(os.path.relpath(page, out.parent)).as_posix() if page.exists() else None
    return {"table": table, "label": label_of(table), "origin": table.provenance.origin, "page": link}


def _settings(tables: Sequence[Table]) -> Mapping[str, Any]:
    """One controller with its own and other numbers: the fields that differ, and for each what came of it."""
    configs = [table.provenance.controller_config for table in tables]
    fields = [name for name in FIELDS if len({config.get(name) for config in configs}) > 1]
    return {
        "label": label_of(tables[0]),
        "fields": [(name, getattr(FIELDS.get(name), "unit", "")) for name in fields],
        "rows": [
            {"table": table, "values": [_value(config.get(name)) for name in fields]}
            for table, config in zip(tables, configs, strict=True)
        ],
    }


def _value(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _common(facts: Sequence[Mapping[str, str]]) -> list[tuple[str, list[str]]]:
    """Facts of all columns by name: one text where they agree, else one for each column."""
    names = list(dict.fromkeys(name for one in facts for name in one))
    texts = [(name, [one.get(name, "–") for one in facts]) for name in names]
    return [(name, given[:1] if len(set(given)) == 1 else given) for name, given in texts]


def _cells(row: Row | None) -> list[str]:
    if row is None:
        return ["", "", ""]
    return [_level(row.mean_snr_db), f"{row.lag_ms:.1f}", f"{row.max_position_error_mm:.2f}"]


def _level(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"
