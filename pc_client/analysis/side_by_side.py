"""Several experiments in one table and on one page: the paper's real arm, the published controller, ours.

A controller whose numbers were changed gets no column of its own where the unchanged one has run on the same
arm: it is a row of the table that shows how the means move with these numbers.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import polars as pl

from pc_client.analysis.report import REPORT_HTML, Report, provenance_facts
from pc_client.analysis.table import (
    ERROR,
    KINDS,
    LAG,
    LEVEL,
    MOVEMENT,
    PAPER,
    PAPER_ROWS,
    SHARED,
    Table,
    mean_by_kind,
    with_means,
)
from pc_client.control.controller import FIELDS
from pc_client.errors import RecordingError
from pc_client.results.pages import picture, render, require_report_libraries, write_files, zoomable
from pc_client.results.tables import Column, to_html, to_rich

if TYPE_CHECKING:
    from rich.table import Table as RichTable

PUBLISHED = "paper"
"""Name of the controller with the published control law."""

_TEMPLATE = "analysis/side_by_side.html.j2"
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
        columns = [MOVEMENT]
        if self.has_paper_rows:
            columns.append(replace(PAPER, header="paper, real UR3", unit="dB", narrow="paper,\nreal UR3"))
        for i, table in enumerate(self.columns):
            label = _label_of(table)
            narrow = label.removesuffix(" controller")
            level, *others = (replace(figure, name=f"{figure.name}_{i}") for figure in _FIGURES)
            columns += [replace(level, header=label, unit="dB", narrow=narrow), *others]
        levels = [column.name for column in columns if column.unit == "dB"]
        return with_means(self.frame, *levels), columns

    @property
    def has_paper_rows(self) -> bool:
        """Whether a movement has the name of one in the paper's Table I."""
        return any(table.has_paper_rows for table in self.columns)

    @property
    def labels(self) -> list[str]:
        """What the columns are called."""
        return [_label_of(table) for table in self.columns]

    @property
    def mark(self) -> str:
        """What the data are; every mark that any experiment has."""
        return ", ".join(dict.fromkeys(m for table in self.columns if (m := table.provenance.origin.mark)))

    @property
    def finding(self) -> str:
        """What the experiments show of the paper's finding, in one sentence; empty without both kinds."""
        here = [
            f"{better} ({label})"
            for i, label in enumerate(self.labels)
            if (better := _better(mean_by_kind(self.frame, f"{LEVEL.name}_{i}")))
        ]
        if not here or not self.has_paper_rows:
            return ""
        there = _better(mean_by_kind(PAPER_ROWS, PAPER.name))
        return (
            f"The paper found lognormal movements reproduced {there} than uniform ones (means of the SNR); "
            f"here they are {', '.join(here)}."
        )

    @property
    def arms(self) -> list[str]:
        """Which arm moved, one line for each that did."""
        arms: dict[str, list[str]] = {}
        for table in self.columns:
            arms.setdefault(table.provenance.arm, []).append(_label_of(table))
        return [f"{', '.join(labels)}: {arm}" for arm, labels in arms.items()]

    def changes_of(self, table: Table) -> list[Table]:
        """A column and the same controller with other numbers; nothing when there is none."""
        changed = [other for other in self.changed if _base(other) == _base(table)]
        return [table, *changed] if changed else []

    def to_rich(self) -> RichTable:
        """Return the table for the terminal."""
        title = "\n".join(["Side by side: SNR of the TCP speed, Eq. 10, in dB", *self.arms])
        caption = "\n".join([SHARED, self.finding] if self.has_paper_rows else [])
        return to_rich(*self.shown(), bold="is_mean", section="kind", title=title, caption=caption)


def side_by_side(tables: Sequence[Table]) -> SideBySide:
    """Put experiments beside each other; RecordingError if there is none."""
    if not tables:
        raise RecordingError("there is no experiment to show; give at least one folder")
    unchanged = {_base(table) for table in tables if table.provenance.controller == _base(table)[1]}
    changed = [t for t in tables if t.provenance.controller != _base(t)[1] and _base(t) in unchanged]
    return SideBySide(tuple(t for t in tables if t not in changed), tuple(changed))


def _label_of(table: Table) -> str:
    """What the column of an experiment is called."""
    controller = table.provenance.controller
    return "published controller" if controller == PUBLISHED else controller


def _better(means: Mapping[str, float]) -> str:
    """By how much lognormal movements came out better than uniform ones; empty where a kind is missing."""
    if not means.keys() >= set(KINDS):
        return ""
    lead = means["lognormal"] - means["uniform"]
    return f"{abs(lead):.1f} dB {'better' if lead > 0.0 else 'worse'}"


def _base(table: Table) -> tuple[str, str]:
    """The arm, and the name of the controller that the numbers of this one started from."""
    p = table.provenance
    return f"{p.arm} {p.pace}", str(p.controller_config.get("name", p.controller))


def build_side_by_side(reports: Sequence[Report], out: Path) -> SideBySide:
    """Write one page of several experiments.

    Args:
        reports: of their folders; the page links to those that have pages.

    Raises:
        RecordingError: there is no experiment, matplotlib or jinja2 is missing, or the page cannot be
            written.
    """
    shown = side_by_side([report.table for report in reports])
    require_report_libraries()
    from pc_client.analysis import figures

    folder = {id(report.table): report.paths[0].parent for report in reports}
    experiments = list(zip(shown.labels, shown.columns, strict=True))
    rows, (name, *columns) = shown.shown()
    levels = [column for column in columns if column.unit == "dB"]
    # What is compared stands together: on a narrow screen it is what is seen.
    others = [
        replace(figure, name=f"{figure.name}_{i}", header=f"{figure.header}, {label}")
        for figure in _FIGURES[1:]
        for i, label in enumerate(shown.labels)
    ]
    text = render(
        _TEMPLATE,
        scripts=True,
        shown=shown,
        n_movements=len(shown.frame),
        cards=[(level.header, mean_by_kind(shown.frame, level.name)) for level in levels],
        links=[_link(table, folder[id(table)], out) for table in shown.columns],
        labels=shown.labels,
        levels=to_html(rows, [name, *levels, Column("n_targets", "targets"), *others], bold="is_mean"),
        levels_figure=picture(
            figures.levels_figure(shown.frame, experiments, shown.mark),
            "Bars of the SNR of each movement: the paper's, and those of each experiment",
        ),
        speeds_figure=zoomable(
            figures.speeds_sheet(shown.frame["name"].to_list(), experiments, shown.mark),
            "TCP speed over time of each movement, desired and actual",
        ),
        mark=shown.mark,
        published=next((t for t in shown.columns if t.provenance.controller == PUBLISHED), None),
        settings=[
            (_label_of(tables[0]), _settings(tables))
            for table in shown.columns
            if (tables := shown.changes_of(table))
        ],
        facts=_common([provenance_facts(table.all_runs) for table in shown.columns]),
        left_out=[f"{report.paths[0].parent.name}/{line}" for report in reports for line in report.left_out],
    )
    write_files(out.parent, {out.name: text})
    return shown


def _link(table: Table, folder: Path, out: Path) -> tuple[str, str] | None:
    """The page of one experiment and its label; None where it has no page."""
    page = folder / REPORT_HTML
    return (Path(os.path.relpath(page, out.parent)).as_posix(), _label_of(table)) if page.exists() else None


def _settings(tables: Sequence[Table]) -> str:
    """One controller with its own and other numbers: the fields that differ, and for each what came of it."""
    configs = [table.provenance.controller_config for table in tables]
    fields = [name for name in FIELDS if len({config.get(name) for config in configs}) > 1]
    kinds = tables[0].kinds
    rows = [
        {name: f"{x:g}" if isinstance(x := config.get(name), float) else str(x) for name in fields}
        | {kind: table.mean_of(kind) for kind in kinds}
        | {"n_runs": len(next(iter(table.runs.values()))), "is_own": table is tables[0]}
        | {LAG.name: table.frame[LAG.name].mean()}
        for table, config in zip(tables, configs, strict=True)
    ]
    columns = [
        *(Column(name, unit=getattr(FIELDS.get(name), "unit", "")) for name in fields),
        Column("n_runs", "runs of each movement"),
        *(Column(kind, f"mean {kind}", "dB", ".2f") for kind in kinds),
        LAG,
    ]
    return to_html(pl.DataFrame(rows, infer_schema_length=None), columns, bold="is_own")


def _common(facts: Sequence[Mapping[str, str]]) -> Mapping[str, str | list[str]]:
    """Facts of all columns by name: one text where they agree, else one for each column."""
    names = list(dict.fromkeys(name for one in facts for name in one))
    texts = {name: [one.get(name, "–") for one in facts] for name in names}
    return {name: given[0] if len(set(given)) == 1 else given for name, given in texts.items()}
