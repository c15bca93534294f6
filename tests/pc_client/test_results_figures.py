"""One description of a figure, drawn by two libraries."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pc_client.results.matplotlib_figures import Bars, bars_of_levels, draw, svg_text
from pc_client.results.pages import zoomable
from pc_client.results.plotly_figures import plotly_figure, thinned
from pc_client.results.sheet import BLUE, RED, Curve, Panel, Sheet, boxes, cube_around

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
