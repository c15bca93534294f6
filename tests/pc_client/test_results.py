"""Figures that are the same every time, and one frame of a table in all its forms."""

from __future__ import annotations

import base64
import csv
import io
import json
import math
import re
import sys
import xml.etree.ElementTree as ET

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from pc_client import cli
from pc_client.results.figures import (
    BLUE,
    RED,
    Bars,
    bars_of_levels,
    figure,
    image_bytes,
    label_axes,
    show_legend,
    space_axes,
    svg_text,
)
from pc_client.results.pages import picture
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

T = np.linspace(0.0, 8.0, 1001)


def page_of(label: str = "actual"):
    with figure(6.0, "SIMULATED", title="a title") as page:
        plane, space = page.add_subplot(1, 2, 1), page.add_subplot(1, 2, 2, projection="3d")
        plane.plot(T, np.sin(T), color=BLUE, label=label)
        plane.plot(T, np.cos(T), color=RED, label="other")
        label_axes(plane, label, "time [s]", "speed [mm/s]", (0.0, 8.0), -1.0, 1.0)
        show_legend(plane, "inside", columns=1)
        space.plot(np.cos(T), np.sin(T), 0.1 * T)
        space_axes(space, np.column_stack((np.cos(T), np.sin(T), 0.1 * T)), ("x", "y", "z"))
    return page


def test_the_same_data_give_the_same_bytes_without_a_date():
    text = svg_text(page_of())
    assert svg_text(page_of()) == text
    assert not re.search(r"\d{4}-\d\d-\d\dT", text)
    assert "<!-- SIMULATED -->" in text
    assert image_bytes(page_of()) == image_bytes(page_of())


def test_names_are_text_whatever_they_are():
    element = str(picture(page_of("<b>$x$--></script>"), 'a "quoted" <name>'))
    assert 'alt="a &#34;quoted&#34; &lt;name&gt;"' in element
    svg = base64.b64decode(re.findall(r'base64,([^"]+)"', element)[0]).decode()
    assert ET.fromstring(svg).tag.endswith("}svg")
    assert "<b>" not in re.sub(r"<!--.*?-->", "", svg)


def test_a_legend_inside_has_room_over_the_curves():
    assert page_of().axes[0].get_ylim() == pytest.approx((-1.0, 1.0 + 2 * 0.16 * 2.0))


def test_axes_in_space_have_one_scale():
    axes = page_of().axes[1]
    edges = [np.ptp(limits) for limits in (axes.get_xlim(), axes.get_ylim(), axes.get_zlim())]
    assert edges == pytest.approx([edges[0]] * 3)
    assert edges[0] >= 1.99


def test_bars_without_a_level_are_left_out() -> None:
    series = [
        Bars("paper", BLUE, np.array([20.0, np.nan])),
        Bars("ours", RED, np.array([30.0, 31.0]), [[29.0], []]),
    ]
    text = svg_text(bars_of_levels(["a", "b"], series, "", title="SNR", floors=np.array([np.nan, np.nan])))
    assert "<!-- paper -->" in text
    assert "noise floor" not in text


def test_a_single_bar_is_no_wider_than_one_of_several() -> None:
    for names in (["a"], ["a", "b", "c"], list("abcdefgh")):
        series = [
            Bars("none", BLUE, np.full(len(names), np.nan)),
            Bars("ours", RED, np.full(len(names), 30.0)),
        ]
        (axes,) = bars_of_levels(names, series, "", title="SNR").axes
        low, high = axes.get_xlim()
        assert max(bar.get_width() for bar in axes.patches) / (high - low) < 1.0 / 6.0
        assert axes.get_legend_handles_labels()[1] == ["ours"]  # a series without a level has no name either


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
