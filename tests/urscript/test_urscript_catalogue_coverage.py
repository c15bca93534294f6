"""The generated page says something about every function."""

from __future__ import annotations

from docs.generate.coverage_page import render
from urscript.catalogue import ALL_ROWS, CB3_3_15, Support, catalogue_for
from urscript.catalogue.methods import METHODS


def test_page_shows_every_form_of_every_function() -> None:
    page = render()
    assert [row.signature for row in ALL_ROWS if f"`{row.signature}`" not in page] == []


def test_totals_add_up() -> None:
    line = next(line for line in render().splitlines() if line.startswith("| **total**"))
    cells = [int(cell) for cell in line.split("|")[2:6]]
    assert cells == [*(sum(row.support is kind for row in CB3_3_15) for kind in Support), len(CB3_3_15)]


def test_page_shows_every_method() -> None:
    page = render()
    assert [row.form for row in METHODS if f"`{row.form}`" not in page] == []


def test_every_version_has_its_totals() -> None:
    for version in ("3.15", "5.12", "10.11"):
        line = next(
            line for line in render().splitlines() if line.startswith("| ") and f" {version} |" in line
        )
        rows = catalogue_for(version)
        counts = [*(sum(row.support is kind for row in rows) for kind in Support), len(rows)]
        assert [int(cell) for cell in line.split("|")[2:6]] == counts


def test_tables_are_rectangular() -> None:
    width = 0
    for line in render().splitlines():
        if not line.startswith("|"):
            width = 0
            continue
        cells = line.replace("\\|", "").count("|")
        width = width or cells
        assert cells == width, line
