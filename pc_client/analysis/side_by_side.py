"""Several experiments in one table: the paper's real arm, the published controller, ours.

A controller whose numbers were changed gets no column of its own where the unchanged one has run on the same
arm: it is a row of the table that shows how the means move with these numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import polars as pl

from pc_client.analysis.table import ERROR, KINDS, LAG, LEVEL, MOVEMENT, PAPER, SHARED, Table, with_means
from pc_client.errors import RecordingError
from pc_client.results.tables import Column, to_rich

if TYPE_CHECKING:
    from rich.table import Table as RichTable

PUBLISHED = "paper"
"""Name of the controller with the published control law."""

_FIGURES = (LEVEL, LAG, ERROR)
"""What is shown of each experiment; in the frame with the number of the experiment behind the name."""


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
    def frame(self) -> pl.DataFrame:
        """A row for each movement that any experiment has, with figures of all; null where one lacks it."""
        tables = [table.frame.with_columns(experiment=i) for i, table in enumerate(self.columns)]
        together = pl.concat(tables, how="vertical_relaxed")
        kinds = together["kind"].unique(maintain_order=True).to_list()
        kinds = [*(kind for kind in KINDS if kind in kinds), *(kind for kind in kinds if kind not in KINDS)]
        figures = [
            pl.col(figure.name).filter(experiment=i).first().alias(f"{figure.name}_{i}")
            for i in range(len(tables))
            for figure in _FIGURES
        ]
        rows = together.group_by("name", maintain_order=True).agg(
            pl.col("kind", PAPER.name, "n_targets").first(), *figures
        )
        return rows.sort(pl.col("kind").cast(pl.Enum(kinds)), maintain_order=True)

    def shown(self) -> tuple[pl.DataFrame, list[Column]]:
        """The rows with the means of the levels of each kind, as people read them, and their columns."""
        columns = [MOVEMENT, replace(PAPER, header="paper, real UR3", unit="dB", narrow="paper,\nreal UR3")]
        for i, table in enumerate(self.columns):
            label = label_of(table)
            narrow = label.removesuffix(" controller")
            level, *others = (replace(figure, name=f"{figure.name}_{i}") for figure in _FIGURES)
            columns += [replace(level, header=label, unit="dB", narrow=narrow), *others]
        levels = [column.name for column in columns if column.unit == "dB"]
        return with_means(self.frame, *levels), columns

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
        title = "\n".join(["The paper's experiment: SNR of the TCP speed, Eq. 10, in dB", *self.arms])
        return to_rich(*self.shown(), bold="is_mean", section="kind", title=title, caption=SHARED)


def side_by_side(tables: Sequence[Table]) -> SideBySide:
    """Put experiments beside each other.

    Raises:
        RecordingError: there is none.
    """
    if not tables:
        raise RecordingError("there is no experiment to show; give at least one folder")
    unchanged = {_base(table) for table in tables if table.provenance.controller == _base(table)[1]}
    changed = [t for t in tables if t.provenance.controller != _base(t)[1] and _base(t) in unchanged]
    return SideBySide(tuple(t for t in tables if t not in changed), tuple(changed))


def label_of(table: Table) -> str:
    """What the column of an experiment is called."""
    controller = table.provenance.controller
    return "published controller" if controller == PUBLISHED else controller


def _base(table: Table) -> tuple[str, str]:
    """The arm, and the name of the controller that the numbers of this one started from."""
    p = table.provenance
    return f"{p.arm} {p.pace}", str(p.controller_config.get("name", p.controller))
