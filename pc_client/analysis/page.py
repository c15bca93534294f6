"""HTML pages that need nothing else: style and figures are inside, no network, no date, host or path."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import resources
from typing import Any

from pc_client.errors import RecordingError


@contextmanager
def report_libraries() -> Iterator[None]:
    """Say which library is missing before anything is drawn; modules that draw are imported in the block.

    Raises:
        RecordingError: matplotlib or jinja2 is not installed.
    """
    try:
        import jinja2  # noqa: F401

        yield
    except ImportError as error:
        raise RecordingError(
            f"the report needs {error.name}; install it with: pip install 'ur-hil[report]'"
        ) from error


def render(template: str, **values: Any) -> str:
    """Fill a template.

    Args:
        template: its path within `pc_client`, as templates name each other, e.g. "analysis/report.html.j2".
        values: what it uses.

    Raises:
        ModuleNotFoundError: jinja2 is not installed (extra `report`).
    """
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    environment = Environment(
        loader=FunctionLoader(_text_of),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["db"] = _decibels
    return environment.get_template(template).render(values)


def data_uri(svg: str) -> str:
    """Return a figure as the address of an image that is inside the page."""
    return "data:image/svg+xml;base64," + base64.b64encode(svg.encode()).decode()


def _text_of(template: str) -> str:
    return resources.files("pc_client").joinpath(template).read_text(encoding="utf-8")


def _decibels(value: float | None) -> str:
    """Format a level; one that is beyond all measure (no error at all) is a dash."""
    return "–" if value is None or not -200.0 < value < 200.0 else f"{value:.1f}"
