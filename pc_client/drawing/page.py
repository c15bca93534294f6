"""The page of drawings: one file that needs no network and holds no date, host or path of this machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pc_client.drawing.figures import FIGURES
from pc_client.drawing.shown import COLOURS
from pc_client.drawing.table import COLUMNS, Entry, facts_of, provenance_facts, table_of
from pc_client.results.pages import render, zoomable
from pc_client.results.panels import Sheet
from pc_client.results.tables import to_html

__all__ = ["render_page"]

_TEMPLATE = "drawing/draw.html.j2"


def render_page(entries: Sequence[Entry], sheets: Mapping[str, Mapping[str, Sheet]]) -> str:
    """Return the text of `report.html`.

    Args:
        entries: the drawings, at least one.
        sheets: `figures.sheets_of` each drawing, by its name.

    Raises:
        ModuleNotFoundError: matplotlib, jinja2 or plotly is not installed (extra `report`).
    """
    sections = [
        {
            "name": entry.name,
            "verdict": entry.verdict,
            "factor": entry.drawing.factor,
            "table": to_html(table_of(entry.verdict), COLUMNS),
            "facts": facts_of(entry),
            "pictures": {name: zoomable(sheet, FIGURES[name]) for name, sheet in sheets[entry.name].items()},
        }
        for entry in entries
    ]
    return render(
        _TEMPLATE,
        scripts=True,
        sections=sections,
        colours=COLOURS,
        facts=provenance_facts(entries),
        origin=entries[0].executions[0].run.provenance.origin,
        seed=entries[0].executions[0].run.provenance.seed,
    )
