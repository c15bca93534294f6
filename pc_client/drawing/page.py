"""The page of drawings: one file that needs no network and holds no date, host or path of this machine."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from importlib import resources

from pc_client.drawing.figures import FIGURES
from pc_client.drawing.shown import COLOURS
from pc_client.drawing.table import COLUMNS, Entry, facts_of, provenance_facts, rows_of

__all__ = ["render_page"]

_TEMPLATE = "draw.html.j2"


def render_page(entries: Sequence[Entry], pictures: Mapping[str, Mapping[str, str]]) -> str:
    """Return the text of `report.html`.

    Args:
        entries: the drawings, at least one.
        pictures: SVG texts by the drawing's name and the picture's.

    Raises:
        ModuleNotFoundError: jinja2 is not installed (extra `report`).
    """
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    template = environment.from_string(
        resources.files("pc_client.drawing").joinpath(_TEMPLATE).read_text(encoding="utf-8")
    )
    sections = [
        {
            "name": entry.name,
            "verdict": entry.verdict,
            "factor": entry.drawing.factor,
            "rows": rows_of(entry.verdict),
            "facts": facts_of(entry),
            "pictures": [(alt, _data_uri(pictures[entry.name][name]), name) for name, _, _, alt in FIGURES],
        }
        for entry in entries
    ]
    return template.render(
        sections=sections,
        columns=COLUMNS,
        colours=COLOURS,
        provenance=provenance_facts(entries),
        origin=entries[0].executions[0].run.provenance.origin,
    )


def _data_uri(svg: str) -> str:
    return "data:image/svg+xml;base64," + base64.b64encode(svg.encode()).decode()
