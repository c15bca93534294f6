"""The documentation site: built without a warning, and nothing on it comes from a network."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOREIGN = re.compile(
    r"""<(?:script|img|iframe|source|video)\b[^>]*\bsrc=["']?(?:https?:)?//"""
    r"""|<link\b(?![^>]*rel=["']?canonical)[^>]*\bhref=["']?(?:https?:)?//|url\(["']?(?:https?:)?//|@import"""
)


def test_every_page_has_its_row_and_its_links_lead_somewhere():
    rows = re.findall(
        r"^ .*?([\w/-]+\.md)\b", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"), re.MULTILINE
    )
    pages = {page.relative_to(ROOT / "docs").as_posix(): page for page in (ROOT / "docs").rglob("*.md")}
    assert pages.keys() == {row for row in rows if row != "index.md" and not row.startswith("source/")}
    targets = [
        (name, target)
        for name, page in pages.items()
        for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    ]
    assert len(targets) > 100
    assert [(name, to) for name, to in targets if not (pages[name].parent / to).exists()] == []


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)],
        capture_output=True, text=True, cwd=ROOT, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.nightly
def test_every_page_is_there_and_asks_no_other_machine(site):
    pages = {
        path.relative_to(site).as_posix(): path.read_text(encoding="utf-8") for path in site.rglob("*.html")
    }
    for source in (ROOT / "docs").rglob("*.md"):
        name = source.relative_to(ROOT / "docs").as_posix().replace("README.md", "index.md")
        assert name.replace(".md", ".html") in pages
    assert {name: found[0] for name, page in pages.items() if (found := FOREIGN.search(page))} == {}
    styles = {path.name: path.read_text(encoding="utf-8") for path in site.rglob("*.css")}
    assert {name: found[0] for name, text in styles.items() if (found := FOREIGN.search(text))} == {}


@pytest.mark.nightly
def test_the_reference_has_every_public_name(site):
    import pc_client
    import ur_emulator
    import urscript

    for page, package in (("client", pc_client), ("emulator", ur_emulator), ("urscript", urscript)):
        text = (site / "api" / f"{page}.html").read_text(encoding="utf-8")
        assert [name for name in package.__all__ if f'id="{package.__name__}.{name}"' not in text] == []


@pytest.mark.nightly
def test_diagrams_are_drawn_and_the_search_knows_the_pages(site):
    states = (site / "states.html").read_text(encoding="utf-8")
    assert states.count('aria-roledescription="stateDiagram"') == 5
    assert "mermaid</code>" not in states
    index = (site / "search" / "search_index.js").read_text(encoding="utf-8")
    assert "lognormal" in index
    assert "api/client.html#pc_client.Arm.repeat" in index
