"""One description of a figure, drawn by two libraries; one frame of a table, in all its forms."""

from __future__ import annotations

import csv
import io
import json
import math
import re
import sys

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rich.console import Console

from pc_client import cli
from pc_client.results.matplotlib_figures import Bars, bars_of_levels, draw, svg_text
from pc_client.results.pages import zoomable
from pc_client.results.plotly_figures import plotly_figure, thinned
from pc_client.results.sheet import BLUE, RED, Curve, Panel, Sheet, boxes, cube_around
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
SPACE = np.column_stack((np.cos(T), np.sin(T), 0.1 * T))


def sheet(label: str = "actual") -> Sheet:
    upper, lower = (
        row[0] for row in boxes((11.0, 6.0), [1], [1, 1], margins=(1, 5, 0.5, 0.5), gaps=(0, 0.5))
    )
    curves = (Curve(np.c_[T, np.sin(T)], BLUE, label), Curve(np.c_[T, np.cos(T)], RED, "other", filled=True))
    span = (0.0, 8.0)
    return Sheet(
        6.0,
        (
            Panel(upper, curves, label, ("", "speed [mm/s]"), (span, (0.0, None)), "above"),
            Panel(lower, curves, "", ("time [s]", "error"), (span, (None, None)), "inside", columns=1),
            Panel(
                (0.6, 0.1, 0.4, 0.8), (Curve(SPACE, RED),), labels=("x", "y", "z"), ranges=cube_around(SPACE)
            ),
        ),
        "SIMULATED",
    )


@given(
    points=arrays(np.float64, st.tuples(st.integers(3, 4000), st.integers(2, 3)), elements=st.floats(-9, 9)),
    most=st.integers(20, 500),
)
def test_thinned_curves_keep_their_ends_and_all_peaks(points: np.ndarray, most: int) -> None:
    kept = thinned(points, most)
    assert len(kept) <= max(most, 8)
    np.testing.assert_array_equal(kept[[0, -1]], points[[0, -1]])
    np.testing.assert_array_equal(kept.min(axis=0), points.min(axis=0))
    np.testing.assert_array_equal(kept.max(axis=0), points.max(axis=0))


def test_thinned_curves_keep_gaps_and_short_ones_all_points() -> None:
    points = np.c_[np.arange(5000.0), np.arange(5000.0)]
    points[2000:3000] = np.nan
    kept = thinned(points, 300)
    assert np.isnan(kept).any()
    assert np.nanmax(kept) == 4999.0
    np.testing.assert_array_equal(thinned(points[:300], 300), points[:300])


def test_a_sheet_for_the_browser() -> None:
    figure = plotly_figure(sheet())
    text = json.dumps(figure, allow_nan=False)
    assert [trace["type"] for trace in figure["data"]] == ["scatter"] * 4 + ["scatter3d"]
    assert (figure["data"][0]["x0"], figure["data"][0]["dx"]) == (0.0, pytest.approx(0.008))
    assert figure["layout"]["xaxis2"]["matches"] == "x"  # the same time: zoomed together
    assert figure["layout"]["yaxis"]["range"] == [0.0, None]
    assert "<b>SIMULATED</b>" in text


def test_names_are_text_whatever_they_are() -> None:
    evil = sheet("<b>$x$</script>")
    element = str(zoomable(evil, 'a "quoted" <name>'))
    assert element.count("</script") == 1
    assert "<b>$x" not in element
    (data,) = re.findall(r'<script type="application/json">(.*)</script>', element)
    assert json.loads(data)["data"][0]["name"] == "&lt;b&gt;$x$&lt;/script&gt;"
    assert 'alt="a &#34;quoted&#34; &lt;name&gt;"' in element


def test_the_same_data_give_the_same_bytes() -> None:
    assert svg_text(draw(sheet())) == svg_text(draw(sheet()))
    assert zoomable(sheet(), "a") == zoomable(sheet(), "a")
    assert not re.search(r"\d{4}-\d\d-\d\dT", svg_text(draw(sheet())))


def test_a_legend_inside_has_room_over_the_curves() -> None:
    panel = sheet().panels[1]
    low, high = panel.upwards
    assert low is not None
    assert high is not None
    assert low < -1.0
    assert high - 1.0 > 0.3 * (1.0 - low)  # two rows
    assert draw(sheet()).axes[1].get_ylim() == pytest.approx((low, high))


def test_boxes_fill_the_sheet_between_the_margins() -> None:
    grid = boxes((10.0, 5.0), (2, 1), (1, 1, 1), margins=(1.0, 0.5, 0.4, 0.6), gaps=(0.5, 0.2))
    assert [len(row) for row in grid] == [2, 2, 2]
    left, right = grid[0]
    assert left[0] == pytest.approx(0.1)
    assert right[0] + right[2] == pytest.approx(0.95)
    assert left[2] == pytest.approx(2 * right[2])
    assert left[1] + left[3] == pytest.approx(1 - 0.08)
    assert grid[2][0][1] == pytest.approx(0.12)


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
