"""Pages of HTML that need nothing else: style, pictures, scripts inside; no network, date, host or path.

They, and the tables beside them, are written by `write_files`.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pc_client.errors import RecordingError

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.figure import Figure

    from pc_client.results.sheet import Sheet


def picture(figure: Figure, alt: str) -> Markup:
    """The element of a figure that does not move, as SVG; `alt` says what it shows."""
    from pc_client.results.matplotlib_figures import svg_text

    return _element("svg+xml", svg_text(figure).encode(), alt)


def zoomable(sheet: Sheet, alt: str) -> Markup:
    """The element of a figure that can be zoomed, over an image for paper and where scripts do not run."""
    from pc_client.results.matplotlib_figures import draw, image_bytes
    from pc_client.results.plotly_figures import plotly_figure

    data = json.dumps(plotly_figure(sheet), separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return _element("webp", image_bytes(draw(sheet), "webp"), alt, data)


def require_report_libraries() -> None:
    """Say which library is missing, before anything is drawn and before an arm moves for a report.

    Raises:
        RecordingError: matplotlib, jinja2 or plotly is not installed.
    """
    for name in ("matplotlib", "jinja2", "plotly"):
        if find_spec(name) is None:  # importing them would take a second before the arm moves
            raise RecordingError(f"the report needs {name}; install it with: pip install 'ur-hil[report]'")


def render(template: str, *, scripts: bool = False, **values: Any) -> str:
    """Fill a template that extends `results/base.html.j2`.

    Args:
        template: its path within `pc_client`, as templates name each other, e.g. "analysis/report.html.j2".
        scripts: whether the page has figures that can be zoomed.

    Raises:
        ModuleNotFoundError: jinja2 or plotly is not installed (extra `report`).
    """
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    folder = resources.files("pc_client")
    environment = Environment(
        loader=FunctionLoader(lambda name: folder.joinpath(name).read_text(encoding="utf-8")),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    plotly = ""
    if scripts:
        from plotly.offline import get_plotlyjs

        plotly = str(get_plotlyjs())
    common: dict[str, Any] = {"plotly": plotly, "labels": (), "left_out": (), "seed": None, "facts": {}}
    return environment.get_template(template).render(common | values)


def write_files(folder: Path, contents: Mapping[str, str | bytes]) -> tuple[Path, ...]:
    """Write texts (UTF-8) and bytes into files of a folder; folders that are missing are made.

    Raises:
        RecordingError: a file cannot be written.
    """
    paths = tuple(folder / name for name in contents)
    for path, content in zip(paths, contents.values(), strict=True):
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content.encode() if isinstance(content, str) else content)
        except OSError as error:
            raise RecordingError(f"cannot write {path}: {error.strerror or error}") from error
    return paths


def _element(kind: str, image: bytes, alt: str, data: str = "") -> Markup:
    from markupsafe import Markup

    address = f"data:image/{kind};base64,{base64.b64encode(image).decode()}"
    element = Markup('<img src="{}" alt="{}">').format(address, alt)
    if data:
        script = Markup('<script type="application/json">{}</script>').format(Markup(data))
        element = Markup('<div class="zoom">{}{}</div>').format(element, script)
    return Markup('<div class="wide">{}</div>').format(element)
