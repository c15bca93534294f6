"""The page of several experiments beside each other."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pc_client.analysis.page import data_uri, render, report_libraries
from pc_client.analysis.report import REPORT_HTML, Report, provenance_facts, write_text
from pc_client.analysis.side_by_side import PUBLISHED, SideBySide, label_of, side_by_side
from pc_client.analysis.table import Table
from pc_client.control.controller_fields import FIELDS

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
    text = render(
        _TEMPLATE,
        shown=shown,
        heads=[_head(table, folder[id(table)], out) for table in shown.columns],
        levels_figure=data_uri(figures.draw_levels(shown)),
        speeds_figure=data_uri(figures.draw_speeds(shown)),
        published=next((t for t in shown.columns if t.controller == PUBLISHED), None),
        settings=[_settings(tables) for t in shown.columns if (tables := shown.changes_of(t))],
        provenance=_common([provenance_facts(table) for table in shown.columns]),
        left_out=[f"{report.paths[0].parent.name}/{line}" for report in reports for line in report.left_out],
    )
    write_text(out, text)
    return shown


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
