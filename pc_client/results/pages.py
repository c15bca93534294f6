"""Pages of HTML that need nothing else: style, pictures, scripts inside; no network, date, host or path.

They, and the tables beside them, are written by `write_files`.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pc_client.errors import RecordingError

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.figure import Figure


def picture(figure: Figure, alt: str) -> Markup:
    """The element of a figure, as SVG, which the page's script magnifies; `alt` says what it shows."""
    from markupsafe import Markup

    from pc_client.results.figures import svg_text

    address = f"data:image/svg+xml;base64,{base64.b64encode(svg_text(figure).encode()).decode()}"
    return Markup('<div class="wide"><img src="{}" alt="{}"></div>').format(address, alt)


def require_report_libraries() -> None:
    """Say which library is missing, before anything is drawn and before an arm moves for a report.

    Raises:
        RecordingError: matplotlib or jinja2 is not installed.
    """
    for name in ("matplotlib", "jinja2"):
        if find_spec(name) is None:  # importing them would take a second before the arm moves
            raise RecordingError(f"the report needs {name}; install it with: pip install 'ur-hil[report]'")


def render(template: str, **values: Any) -> str:
    """Fill a template that extends `results/base.html.j2`.

    Args:
        template: its path within `pc_client`, as templates name each other, e.g. "analysis/report.html.j2".

    Raises:
        ModuleNotFoundError: jinja2 is not installed (extra `report`).
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
    common: dict[str, Any] = {"labels": (), "left_out": (), "seed": None, "facts": {}}
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
