"""Pages written by hand whose figures are computed: `docs/generate/*.md.j2`."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import jinja2

HERE = Path(__file__).parent
_TEMPLATES = jinja2.Environment(
    loader=jinja2.FileSystemLoader(HERE), undefined=jinja2.StrictUndefined, keep_trailing_newline=True
)


def rendered(template: str, **values: Any) -> str:
    """A page of a template, with `bare` among its functions."""
    return _TEMPLATES.get_template(template).render(bare=bare, **values)


def bare(value: float, digits: int) -> str:
    """A number with so many digits, without the zero before the point."""
    text = f"{value:.{digits}f}"
    return text.replace("0.", ".", 1) if abs(value) < 1.0 and digits else text


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], n_right: int = 0) -> str:
    """A table of texts; the last columns, `n_right`, are aligned at the right."""
    rule = ["--"] * (len(heads) - n_right) + ["-:"] * n_right
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (heads, rule, *rows))
