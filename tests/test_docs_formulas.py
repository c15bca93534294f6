"""Every formula of the pages renders: it stands in code, as Markdown leaves it whole, and mathtext takes it."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import markdown
import pytest
from matplotlib.mathtext import MathTextParser

DOCS = Path(__file__).parents[1] / "docs"
PAGES = ("theory.md", "extraction.md", "tracking.md", "movements.md", "drawing.md")
_GREEK = ["alpha", "beta", "gamma", "kappa", "Lambda", "mu", "phi", "Phi", "sigma", "tau", "theta", "zeta"]
_NO_FORMULA = re.compile(
    r"--|\.(py|toml|mcap|csv|md|json)\b|\"|`|[a-z]/[a-z]|^\w+$|[a-z]_[a-z]+\(|^[\w./ -]+$"
)


class _Parts(HTMLParser):
    """Text outside of code; spans of code; blocks of language `text`."""

    def __init__(self) -> None:
        super().__init__()
        self.prose, self.spans, self.blocks, self._in = [""], [""], [""], ""

    def handle_starttag(self, tag, attrs):
        if tag == "code":
            language = dict(attrs).get("class", "span")
            self._in = {"span": "span", "language-text": "block"}.get(language, "other")
            {"span": self.spans, "block": self.blocks}.get(self._in, []).append("")

    def handle_endtag(self, tag):
        self._in = "" if tag == "code" else self._in

    def handle_data(self, data):
        where = {"": self.prose, "span": self.spans, "block": self.blocks}.get(self._in, [""])
        where[-1] += data


def parts(page: str) -> _Parts:
    found = _Parts()
    text = (DOCS / page).read_text(encoding="utf-8")
    found.feed(markdown.markdown(text, extensions=["tables", "fenced_code"]))
    return found


def formulas(page: str) -> list[str]:
    found = parts(page)
    lines = [line for block in found.blocks for line in block.splitlines()]
    return [one for one in lines if "=" in one or "^" in one] + [
        span for span in found.spans if re.search(r"[=^]|sqrt|exp\(", span) and not _NO_FORMULA.search(span)
    ]


def as_mathtext(formula: str) -> str:
    text = re.sub(r"([A-Za-z\d)])_(\w+)", r"\1_{\2}", formula)
    text = re.sub(rf"\b({'|'.join(_GREEK)})(?![a-z])", r"\\\1 ", text)
    for name in ("sqrt", "exp", "ln", "cos", "sin", "log10"):
        text = re.sub(rf"\b{name}\b", rf"\\mathrm{{{name}}} ", text)
    text = re.sub(r"\^(\w+|-\d+)", r"^{\1}", text)
    while (braced := re.sub(r"\^\(([^()]*)\)", r"^{\1}", text)) != text:
        text = braced
    return text.replace("+-", r"\pm ").replace("->", r"\to ").replace("%", r"\%")


@pytest.mark.parametrize("page", PAGES)
def test_no_formula_is_broken_into_prose(page):
    prose = " ".join("".join(parts(page).prose).split())
    assert re.findall(r".{0,30}(?:\w\^\d|\^\(|\bsqrt\b|\bexp\(|\bPhi\().{0,30}", prose) == []


@pytest.mark.parametrize("page", PAGES)
def test_every_formula_renders(page):
    parser, found = MathTextParser("path"), formulas(page)
    assert found
    for formula in found:
        for opening, closing in ("()", "[]", "{}"):
            assert formula.count(opening) == formula.count(closing), formula
        parser.parse(f"${as_mathtext(formula)}$")
