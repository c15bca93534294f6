"""Several experiments in one table: the paper's real arm, the published controller, ours.

A controller whose numbers were changed gets no column of its own where the unchanged one has run on the same
arm: it is a row of the table that shows how the means move with these numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rich.box import SIMPLE_HEAD
from rich.table import Table as RichTable
from rich.text import Text

from pc_client.analysis.table import KINDS, SHARED, Row, Table
from pc_client.errors import RecordingError

PUBLISHED = "paper"
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
    return "published controller" if table.controller == PUBLISHED else table.controller


def _base(table: Table) -> tuple[str, str]:
    """The arm, and the name of the controller that the numbers of this one started from."""
    p = table.provenance
    return f"{p.arm} {p.pace}", str(p.controller_config.get("name", table.controller))


def _line(rows: Sequence[Row | None]) -> Line:
    row = next(row for row in rows if row is not None)
    n_targets = len(row.runs[0].provenance.target_points)
    return Line(row.name, row.kind, n_targets, row.paper_snr_db, tuple(rows))


def _cells(row: Row | None) -> list[str]:
    if row is None:
        return ["", "", ""]
    return [_level(row.mean_snr_db), f"{row.lag_ms:.1f}", f"{row.max_position_error_mm:.2f}"]


def _level(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"
