"""A frame in all its forms: terminal, Markdown, cells of pages, CSV, JSON."""

from __future__ import annotations

import csv
import io
import json
import math
import subprocess
import sys

import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from pc_client import cli
from pc_client.results.tables import (
    Column,
    cells,
    finite,
    frame_of,
    to_csv,
    to_html,
    to_json,
    to_markdown,
    to_rich,
)

COLUMNS = (
    Column("name", "movement", align="left", kind=str),
    Column("level", "level", "dB", ".2f"),
    Column("n", kind=int, missing="none"),
)


@pytest.fixture
def frame() -> pl.DataFrame:
    rows = [{"name": "[red]a", "level": 1.005, "n": 3, "other": 1}, {"name": "b", "level": math.inf}]
    return frame_of(rows, COLUMNS)


def shown(table: object, width: int = 80) -> str:
    console = Console(width=width)
    with console.capture() as capture:
        console.print(table)
    return capture.get()


def test_a_frame_has_exactly_its_columns_also_without_rows(frame: pl.DataFrame) -> None:
    assert dict(frame.schema) == {"name": pl.String, "level": pl.Float64, "n": pl.Int64}
    assert frame_of([], COLUMNS).schema == frame.schema
    assert frame["n"].to_list() == [3, None]


def test_missing_values_are_as_the_column_says_and_those_not_finite_a_dash(frame: pl.DataFrame) -> None:
    assert cells(frame, COLUMNS) == [["[red]a", "1.00", "3"], ["b", "–", "none"]]


def test_markdown(frame: pl.DataFrame) -> None:
    assert to_markdown(frame, COLUMNS).splitlines() == [
        "| movement | level [dB] | n |",
        "|---|---:|---:|",
        "| [red]a | 1.00 | 3 |",
        "| b | – | none |",
    ]


def test_brackets_in_texts_are_no_markup_and_units_stand_below_headings(frame: pl.DataFrame) -> None:
    text = shown(to_rich(frame, COLUMNS, title="of [bold] runs", caption="[x]"))
    assert all(word in text for word in ("[red]a", "of [bold] runs", "[x]"))
    assert " level " in text.splitlines()[2]
    assert "[dB]" in text.splitlines()[3]


def test_nothing_that_a_terminal_obeys_is_printed() -> None:
    frame = frame_of([{"name": "a\x1b[31m"}], COLUMNS)
    assert "a\\x1b[31m" in shown(to_rich(frame, COLUMNS))


def test_long_names_are_folded_and_numbers_never_cut(frame: pl.DataFrame) -> None:
    long = frame.with_columns(name=pl.lit("x" * 60), level=pl.lit(123456.0))
    text = shown(to_rich(long, COLUMNS), width=40)
    assert "…" not in text
    assert "123456.00" in text
    assert text.count("x") == 120


def test_sections_end_where_a_column_changes_and_not_behind_the_last_row() -> None:
    frame = pl.DataFrame({"kind": ["a", "a", "b"], "last": [False, True, True]})
    table = to_rich(frame, (Column("kind"),), bold="last", section="kind")
    assert [row.end_section for row in table.rows] == [False, True, False]
    assert [row.style for row in table.rows] == [None, "bold", "bold"]


@given(
    st.lists(
        st.fixed_dictionaries(
            {
                "x": st.none() | st.floats(allow_nan=False),
                "n": st.none() | st.integers(-(2**63), 2**63 - 1),
                "s": st.none() | st.text(st.characters(codec="utf-8", exclude_characters="\r\0")),
                "b": st.none() | st.booleans(),
            }
        )
    )
)
def test_csv_holds_every_digit(rows: list[dict[str, object]]) -> None:
    columns = [Column("x"), Column("n", kind=int), Column("s", kind=str), Column("b", kind=bool)]
    read = list(csv.DictReader(io.StringIO(to_csv(frame_of(rows, columns)), newline="")))
    assert [row["s"] for row in read] == [row["s"] or "" for row in rows]
    assert [row["n"] for row in read] == ["" if row["n"] is None else str(row["n"]) for row in rows]
    assert [row["b"] for row in read] == ["" if row["b"] is None else str(row["b"]).lower() for row in rows]
    assert [float(row["x"]) if row["x"] else None for row in read] == [row["x"] for row in rows]


def test_json_rounds_and_knows_no_infinity() -> None:
    data = {"a": [1.23456789, math.nan, None, "x"], "b": {"c": (math.inf, 2, True)}}
    assert finite(data, 6) == {"a": [1.234568, None, None, "x"], "b": {"c": [None, 2, True]}}
    assert finite(data)["a"][0] == 1.23456789
    assert json.loads(to_json(data, 3)) == finite(data, 3)


def test_polars_is_loaded_only_for_a_table() -> None:
    """Not by what moves an arm, nor by what worker processes run."""
    code = (
        "import sys, pc_client.api.arm, pc_client.api.signals, pc_client.studies.extraction.batch\n"
        "import pc_client.studies.sweep.schedule, pc_client.commands.movements, pc_client.results.tables\n"
        "sys.exit('polars' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_without_polars_one_line_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "polars", None)
    assert cli.run(["movements", "list"]) == 1
    error = capsys.readouterr().err
    assert error == "ur-client: this needs polars: run `pip install 'ur-hil[client]'`\n"


def test_a_page_escapes_names_and_links_to_their_sections() -> None:
    frame = pl.DataFrame({"name": ["<a>", "mean"], "level": [1.0, None], "is_mean": [False, True]})
    page = to_html(frame, COLUMNS[:2], bold="is_mean", links=True)
    assert "<th>level<br>[dB]</th>" in page
    assert '<td><a href="#&lt;a&gt;" style="color:inherit">&lt;a&gt;</a></td><td>1.00</td>' in page
    assert '<tr class="mean"><td>mean</td><td></td></tr>' in page
