"""The plots of several experiments beside each other, as SVG text. Loads matplotlib."""

from __future__ import annotations

import numpy as np

from pc_client.analysis.figures import (
    BLUE,
    GREEN,
    ORANGE,
    PAPER_GREY,
    PURPLE,
    RED,
    REFERENCE_GREY,
    SKY,
    svg_figure,
)
from pc_client.analysis.side_by_side import SideBySide, label_of
from pc_client.analysis.track import speed

# Of the experiments, in their order; the first two differ in lightness as well.
_COLOURS = (ORANGE, BLUE, GREEN, PURPLE, RED, SKY)
_COLUMNS = 2
_PANEL_HEIGHT = 1.55


def draw_levels(shown: SideBySide) -> str:
    """Draw the SNR of each movement: the paper's figure, the mean of each experiment and its single runs."""
    frame = shown.frame
    x = np.arange(len(frame))
    width = 0.84 / (1 + len(shown.columns))
    places = [x + width * (i - len(shown.columns) / 2) for i in range(1 + len(shown.columns))]
    with svg_figure(11.0, 3.4, _mark(shown)) as (figure, page):
        axes = figure.add_axes((0.06, 0.2, 0.925, 0.66))
        axes.bar(
            places[0],
            frame["paper_snr_db"].to_numpy(),
            0.92 * width,
            color=PAPER_GREY,
            label="paper, real UR3, its own points",
        )
        for i, table in enumerate(shown.columns):
            means = frame[f"mean_snr_db_{i}"].to_numpy()
            axes.bar(
                places[i + 1], means, 0.92 * width, color=_colour(i), label=f"{label_of(table)}, mean of runs"
            )
            for place, name in zip(places[i + 1], frame["name"], strict=True):
                levels = [run.snr.speed_db for run in table.runs.get(name, ())]
                axes.plot([place] * len(levels), levels, "o", ms=3.0, mfc="white", mec="black", mew=0.8)
        axes.set_xticks(x, frame["name"].to_list(), rotation=20, ha="right")
        axes.set_ylabel("SNR [dB]")
        axes.set_title("SNR of the TCP speed (Eq. 10)")
        axes.grid(axis="x", visible=False)
        axes.legend(ncols=4, loc="lower right", bbox_to_anchor=(0.88, 0.99), borderaxespad=0.2)
    return page.getvalue()


def draw_speeds(shown: SideBySide) -> str:
    """Draw TCP speeds over time, one panel a movement: desired, and the first run of each experiment."""
    names = shown.frame["name"].to_list()
    n_rows = -(-len(names) // _COLUMNS)
    height = _PANEL_HEIGHT * n_rows + 0.75
    with svg_figure(11.0, height, _mark(shown)) as (figure, page):
        grid = figure.add_gridspec(
            n_rows,
            _COLUMNS,
            left=0.055,
            right=0.985,
            top=1.0 - 0.6 / height,
            bottom=0.5 / height,
            hspace=0.5,
            wspace=0.11,
        )
        # Down the first column, then down the second: the kinds stand beside each other.
        for k, name in enumerate(names):
            axes = figure.add_subplot(grid[k % n_rows, k // n_rows])
            runs = [(i, table.runs[name][0]) for i, table in enumerate(shown.columns) if name in table.runs]
            first = runs[0][1].track
            t = 0.5 * (first.t[1:] + first.t[:-1]) - first.t_start
            axes.plot(t, 1e3 * speed(first.t, first.p_ref), color=REFERENCE_GREY, lw=3.6, label="desired")
            for i, run in runs:
                track = run.track
                t = 0.5 * (track.t[1:] + track.t[:-1]) - track.t_start
                v = 1e3 * speed(track.t, track.p_actual)
                axes.plot(t, v, color=_colour(i), lw=1.0, label=label_of(shown.columns[i]))
            axes.set_xlim(-0.1, first.t_end - first.t_start + 0.3)
            axes.set_ylim(bottom=0.0)
            axes.set_title(name)
            if k % n_rows == n_rows - 1 or k == len(names) - 1:
                axes.set_xlabel("time since the movement began [s]")
            if k < n_rows:
                axes.set_ylabel("speed [mm/s]")
            if k == 0:
                handles, labels = axes.get_legend_handles_labels()
                figure.legend(
                    handles,
                    labels,
                    ncols=len(labels),
                    loc="upper left",
                    bbox_to_anchor=(0.05, 1.0 - 0.04 / height),
                )
    return page.getvalue()


def _mark(shown: SideBySide) -> str:
    """What the data are; every mark that any experiment has."""
    return ", ".join(dict.fromkeys(m for table in shown.columns if (m := table.provenance.origin.mark)))


def _colour(i: int) -> str:
    return _COLOURS[i % len(_COLOURS)]
