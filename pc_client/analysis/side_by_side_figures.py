"""What a page of several experiments shows. Loads matplotlib."""

from __future__ import annotations

from matplotlib.figure import Figure

from pc_client.analysis.figures import speed_curve
from pc_client.analysis.side_by_side import SideBySide, label_of
from pc_client.results.panels import Panel, Sheet, boxes
from pc_client.results.static import Bars, bars_of_levels
from pc_client.results.theme import PAPER_GREY, REFERENCE_GREY, WIDTH, colour_of

__all__ = ["levels_figure", "speeds_sheet"]

_COLUMNS = 2
_PANEL_HEIGHT = 1.55


def levels_figure(shown: SideBySide) -> Figure:
    """The SNR of each movement: the paper's figure, the mean of each experiment and its single runs."""
    frame = shown.frame
    series = [Bars("paper, real UR3, its own points", PAPER_GREY, frame["paper_snr_db"].to_numpy())]
    for i, table in enumerate(shown.columns):
        runs = [[run.snr.speed_db for run in table.runs.get(name, ())] for name in frame["name"]]
        means = frame[f"mean_snr_db_{i}"].to_numpy()
        series.append(Bars(f"{label_of(table)}, mean of runs", colour_of(i), means, runs))
    return bars_of_levels(
        frame["name"].to_list(), series, _mark(shown), title="SNR of the TCP speed (Eq. 10)"
    )


def speeds_sheet(shown: SideBySide) -> Sheet:
    """TCP speeds over time, one panel a movement: desired, and the first run of each experiment."""
    names = shown.frame["name"].to_list()
    n_rows = -(-len(names) // _COLUMNS)
    height = _PANEL_HEIGHT * n_rows + 0.65
    grid = boxes(
        (WIDTH, height), [1] * _COLUMNS, [1] * n_rows, margins=(0.65, 0.15, 0.55, 0.5), gaps=(0.65, 0.45)
    )
    panels = []
    # Down the first column, then down the second: the kinds stand beside each other.
    for k, name in enumerate(names):
        runs = {i: table.runs[name][0] for i, table in enumerate(shown.columns) if name in table.runs}
        first = next(iter(runs.values()))
        desired = speed_curve(first, REFERENCE_GREY, "desired", desired=True, width=3.6)
        actual = [
            speed_curve(run, colour_of(i), label_of(shown.columns[i]), width=1.0) for i, run in runs.items()
        ]
        last = k % n_rows == n_rows - 1 or k == len(names) - 1
        span = (-0.1, first.track.t_end - first.track.t_start + 0.3)
        panels.append(
            Panel(
                grid[k % n_rows][k // n_rows],
                (desired, *actual),
                name,
                ("time since the movement began [s]" if last else "", "speed [mm/s]"),
                (span, (0.0, None)),
                "" if k else "above",
            )
        )
    return Sheet(height, panels, _mark(shown))


def _mark(shown: SideBySide) -> str:
    """What the data are; every mark that any experiment has."""
    return ", ".join(dict.fromkeys(m for table in shown.columns if (m := table.provenance.origin.mark)))
