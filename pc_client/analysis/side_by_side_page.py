"""The page of several experiments beside each other."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import polars as pl

from pc_client.analysis.report import REPORT_HTML, Report, provenance_facts
from pc_client.analysis.side_by_side import PUBLISHED, SideBySide, label_of, side_by_side
from pc_client.analysis.table import LAG, Table
from pc_client.control.controller import FIELDS
from pc_client.results.files import write_files
from pc_client.results.pages import picture, render, report_libraries, zoomable
from pc_client.results.tables import Column, to_html

_TEMPLATE = "analysis/side_by_side.html.j2"


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
    rows, columns = shown.shown()
    text = render(
        _TEMPLATE,
        scripts=True,
        shown=shown,
        n_movements=len(shown.frame),
        cards=[
            (column.header, rows.filter("is_mean").select("kind", column.name).drop_nulls().rows())
            for column in columns
            if column.unit == "dB"
        ],
        links=[_link(table, folder[id(table)], out) for table in shown.columns],
        labels=[label_of(table) for table in shown.columns],
        levels=to_html(rows, [columns[0], Column("n_targets", "targets"), *columns[1:]], bold="is_mean"),
        levels_figure=picture(
            figures.levels_figure(shown),
            "Bars of the SNR of each movement: the paper's, and those of each experiment",
        ),
        speeds_figure=zoomable(
            figures.speeds_sheet(shown), "TCP speed over time of each movement, desired and actual"
        ),
        published=next((t for t in shown.columns if t.provenance.controller == PUBLISHED), None),
        settings=[
            (label_of(tables[0]), _settings(tables))
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
    return (Path(os.path.relpath(page, out.parent)).as_posix(), label_of(table)) if page.exists() else None


def _settings(tables: Sequence[Table]) -> str:
    """One controller with its own and other numbers: the fields that differ, and for each what came of it."""
    configs = [table.provenance.controller_config for table in tables]
    fields = [name for name in FIELDS if len({config.get(name) for config in configs}) > 1]
    kinds = tables[0].kinds
    rows = [
        {name: _value(config.get(name)) for name in fields}
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


def _value(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _common(facts: Sequence[Mapping[str, str]]) -> Mapping[str, str | list[str]]:
    """Facts of all columns by name: one text where they agree, else one for each column."""
    names = list(dict.fromkeys(name for one in facts for name in one))
    texts = {name: [one.get(name, "–") for one in facts] for name in names}
    return {name: given[0] if len(set(given)) == 1 else given for name, given in texts.items()}
