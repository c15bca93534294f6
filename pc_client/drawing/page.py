"""The page of drawings: one file that needs no network and holds no date, host or path of this machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pc_client.analysis.page import data_uri, render
from pc_client.drawing.figures import FIGURES
from pc_client.drawing.shown import COLOURS
from pc_client.drawing.table import COLUMNS, Entry, facts_of, provenance_facts, table_of
from pc_client.results.tables import to_html

__all__ = ["render_page"]

_TEMPLATE = "drawing/draw.html.j2"


def render_page(entries: Sequence[Entry], pictures: Mapping[str, Mapping[str, str]]) -> str:
    """Return the text of `report.html`.

    Args:
        entries: the drawings, at least one.
        pictures: SVG texts by the drawing's name and the picture's.

    Raises:
        ModuleNotFoundError: jinja2 is not installed (extra `report`).
    """
    sections = [
        {
            "name": entry.name,
            "verdict": entry.verdict,
            "factor": entry.drawing.factor,
            "table": to_html(table_of(entry.verdict), COLUMNS),
            "facts": facts_of(entry),
            "pictures": [(alt, data_uri(pictures[entry.name][name]), name) for name, _, _, alt in FIGURES],
        }
        for entry in entries
    ]
    return render(
        _TEMPLATE,
        sections=sections,
        colours=COLOURS,
        provenance=provenance_facts(entries),
        origin=entries[0].executions[0].run.provenance.origin,
    )
