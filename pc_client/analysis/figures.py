"""The figures of experiments: bars of levels and of shares, the speeds of all movements. Loads matplotlib."""

from collections.abc import Sequence

import numpy as np
import polars as pl
from matplotlib.figure import Figure

from pc_client.analysis.measures import PARTS
from pc_client.analysis.run import budget_column
from pc_client.analysis.run_figures import plot_speed
from pc_client.analysis.table import Table
from pc_client.results.figures import (
    BLUE,
    GREEN,
    ORANGE,
    PAPER_GREY,
    RED,
    REFERENCE_GREY,
    SKY,
    Bars,
    bars_of_levels,
    colour_of,
    figure,
    label_axes,
    show_legend,
)

_PARTS_COLOURS = (BLUE, ORANGE, GREEN, RED, "#444444")
_SPEED_COLUMNS = 2
_SPEED_HEIGHT = 1.85
"""Columns of the speeds of all movements, and the height of a row [inches]."""


def levels_figure(
    frame: pl.DataFrame, experiments: Sequence[tuple[str, Table]], mark: str, *, floors: bool = False
) -> Figure:
    """The SNR of each movement: the paper's figure, and of each experiment the mean and the single runs.

    Args:
        frame: a row a movement: its name, the paper's figure, and the noise floor.
        experiments: label and table of each.
    """
    names = frame["name"].to_list()
    series = [Bars("paper, real UR3", PAPER_GREY, frame["paper_snr_db"].to_numpy())]
    for i, (title, table) in enumerate(experiments):
        runs = [[run.snr.speed_db for run in table.runs.get(name, ())] for name in names]
        means = np.array([np.mean(levels) if levels else np.nan for levels in runs])
        series.append(
            Bars(title, colour_of(i), means, [levels if len(levels) > 1 else [] for levels in runs])
        )
    return bars_of_levels(
        names,
        series,
        mark,
        title="SNR of the TCP speed (Eq. 10)",
        floors=frame["noise_floor_db"].to_numpy() if floors else None,
    )


def speeds_figure(names: Sequence[str], experiments: Sequence[tuple[str, Table]], mark: str) -> Figure:
    """TCP speeds over time, one pair of axes a movement: desired, and the first run of each experiment."""
    n_rows = -(-len(names) // _SPEED_COLUMNS)
    with figure(_SPEED_HEIGHT * n_rows + 0.4, mark) as page:
        # Down the first column, then down the second: the kinds stand beside each other.
        grid = page.subplots(n_rows, _SPEED_COLUMNS, squeeze=False).T.ravel()
        for k, axes in enumerate(grid):
            if k >= len(names):
                axes.set_axis_off()
                continue
            runs = {i: t.runs[names[k]][0] for i, (_, t) in enumerate(experiments) if names[k] in t.runs}
            first = next(iter(runs.values()))
            plot_speed(axes, first, REFERENCE_GREY, "desired", desired=True, width=3.6)
            for i, run in runs.items():
                plot_speed(axes, run, colour_of(i), experiments[i][0], width=1.0)
            span = (-0.1, first.track.t_end - first.track.t_start + 0.3)
            label_axes(axes, names[k], "time [s]", "speed [mm/s]", span, 0.0)
            if k == 0:
                show_legend(axes, "above")
    return page


def definitions_figure(table: Table) -> Figure:
    """The four SNR definitions for each movement, means over the repetitions."""
    series = (
        ("speed, as in Eq. 10", BLUE, "snr_db"),
        ("speed, shifted", SKY, "snr_shifted_db"),
        ("velocity vector", RED, "vector_snr_db"),
        ("velocity vector, shifted", ORANGE, "vector_snr_shifted_db"),
    )
    means = table.means
    bars = [Bars(text, colour, means[name].to_numpy()) for text, colour, name in series]
    return bars_of_levels(
        means["name"].to_list(), bars, table.provenance.origin.mark, title="Four definitions"
    )


def budget_figure(table: Table) -> Figure:
    """Where the error power of each movement lies: bars of shares, and the level of the whole."""
    means = table.means
    with figure(0.34 * len(means) + 1.25, table.provenance.origin.mark) as page:
        axes = page.add_subplot()
        y, left = np.arange(len(means)), np.zeros(len(means))
        for i, part in enumerate(PARTS):
            shares = 100.0 * means[budget_column(part)].to_numpy()
            bars = axes.barh(y, shares, 0.72, left=left, color=_PARTS_COLOURS[i], label=part)
            texts = [f"{share:.0f}" if share >= 6.0 else "" for share in shares]
            axes.bar_label(bars, texts, label_type="center", color="white", fontsize=8)
            left += shares
        for i, level in enumerate(means["snr_db"]):
            axes.text(101.0, i, f"{level:.1f} dB", va="center", fontsize=8.5)
        axes.set_yticks(y, means["name"].to_list())
        axes.set(ylim=(len(means) - 0.5, -0.5), xlim=(0.0, 100.0))
        axes.set_xlabel("share of the error power [%]; at the right the SNR that the whole error leaves")
        axes.grid(axis="y", visible=False)
        axes.legend(ncols=len(PARTS), loc="lower left", bbox_to_anchor=(0.0, 1.0))
    return page
