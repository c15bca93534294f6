"""What mkdocs needs to make a site of these pages without a network: `make docs` writes it into out/site.

The README is the first page. A link to a file outside `docs/` leads in a checkout to the file, on the site to
a page that shows it. Mermaid diagrams are drawn when the site is built.
"""

from __future__ import annotations

import json
import posixpath
import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path, PurePosixPath
from typing import Any
from zlib import crc32

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[2]
HOME = "index.md"
_LINK = re.compile(r"(?<=\]\()([^)#\s:]+)(?=(?:#[^)\s]*)?\))")
_LANGUAGES = {".py": "python", ".script": "urscript", ".toml": "toml", ".yml": "yaml", ".ipynb": "python"}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the README as the first page, and a page for each file outside `docs/` that a page links to."""
    files.append(File.generated(config, HOME, content=(ROOT / "README.md").read_text(encoding="utf-8")))
    waiting = [file.src_uri for file in files.documentation_pages()]
    while waiting:
        for target in _targets(waiting.pop()):
            uri = _page_of(target)
            if files.get_file_from_path(uri) is None and not target.startswith("docs/"):
                files.append(File.generated(config, uri, content=_shown(target)))
                waiting.append(uri)
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Let links lead to the pages of this site."""
    here = page.file.src_uri

    def moved(link: re.Match[str]) -> str:
        target = _target(_origin(here), link[0])
        return link[0] if target is None else posixpath.relpath(_page_of(target), posixpath.dirname(here))

    return _LINK.sub(moved, markdown)


@cache
def _diagram(source: str) -> str:
    import mermaidx  # loads a JavaScript engine

    return str(mermaidx.render(source).svg())


def diagram(source: str, language: str, css_class: str, options: Any, md: Any, **_: Any) -> str:
    """Draw a mermaid diagram; called for each block of that language."""
    name = f"diagram-{crc32(source.encode())}"
    return f'<div class="diagram">{_diagram(source).replace("my-svg", name)}</div>'


def _origin(uri: str) -> str:
    """Path in the checkout of the text of a page."""
    if uri == HOME:
        return "README.md"
    if uri.startswith("source/"):
        path = uri.removeprefix("source/")
        return path if (ROOT / path).is_file() else path.removesuffix(".md")
    return f"docs/{uri}"


def _page_of(path: str) -> str:
    """Source of the page, or the picture, that stands on the site for a path of the checkout."""
    if path == "README.md":
        return HOME
    if path.startswith("docs/"):
        return path.removeprefix("docs/")
    return f"source/{path}" if path.endswith(".md") else f"source/{path}.md"


def _target(origin: str, link: str) -> str | None:
    """Path in the checkout of what a link leads to; None if that is no file of it."""
    path = posixpath.normpath(posixpath.join(posixpath.dirname(origin), link))
    return path if (ROOT / path).exists() and not path.startswith("..") else None


def _targets(uri: str) -> Iterable[str]:
    origin = _origin(uri)
    if not origin.endswith(".md"):
        return
    for link in _LINK.findall((ROOT / origin).read_text(encoding="utf-8")):
        if (target := _target(origin, link)) is not None:
            yield target


def _shown(path: str) -> str:
    """A file outside `docs/` as a page."""
    place = ROOT / path
    if place.suffix == ".md":
        return place.read_text(encoding="utf-8")
    if place.is_dir():
        files = sorted(file for file in place.rglob("*") if file.suffix in _LANGUAGES)
        return f"# `{path}/`\n\n" + "\n\n".join(
            f"## {file.relative_to(place).as_posix()}\n\n{_code(file)}" for file in files
        )
    return f"# `{PurePosixPath(path)}`\n\n{_code(place)}"


def _code(place: Path) -> str:
    text = place.read_text(encoding="utf-8")
    if place.suffix == ".ipynb":
        cells = json.loads(text)["cells"]
        return "\n\n".join(
            "".join(cell["source"]) if cell["cell_type"] == "markdown" else _fenced("".join(cell["source"]))
            for cell in cells
        )
    return _fenced(text, _LANGUAGES.get(place.suffix, "text"))


def _fenced(text: str, language: str = "python") -> str:
    return f"````{language}\n{text.rstrip()}\n````"
