"""What reports show: curves of runs, bars of levels and of shares. Loads matplotlib for the bars."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import polars as pl
from matplotlib.figure import Figure

from pc_client.analysis.measures import PARTS, joint_errors, position_errors
from pc_client.analysis.run import MeasuredRun, budget_column
from pc_client.analysis.table import Table
from pc_client.analysis.track import speed
from pc_client.recording.provenance import origin_of
from pc_client.results.matplotlib_figures import Bars, bars_of_levels, figure
from pc_client.results.sheet import (
    BLUE,
    GREEN,
    ORANGE,
    PAPER_GREY,
    RED,
    REFERENCE_GREY,
    SKY,
    WIDTH,
    Box,
    Curve,
    Panel,
    Sheet,
    boxes,
    colour_of,
    cube_around,
)
from protocol.ur_types import JOINT_NAMES

Array = np.ndarray

_PARTS_COLOURS = (BLUE, ORANGE, GREEN, RED, "#444444")
_SPEED_COLUMNS = 2
_SPEED_HEIGHT = 1.85
"""Columns of the speeds of all movements, and the height of a row [inches]."""

__all__ = [
    "budget_figure",
    "definitions_figure",
    "levels_figure",
    "movement_sheet",
    "signals_sheet",
    "speed_curve",
    "speeds_sheet",
]


def speed_curve(
    run: MeasuredRun, colour: str, label: str = "", *, desired: bool = False, width: float = 0.9
) -> Curve:
    """TCP speed [mm/s] over the time since the movement began [s]; not smoothed."""
    track = run.track
    v = speed(track.t, track.p_ref if desired else track.p_actual)
    return Curve(np.c_[_step_times(run), 1e3 * v], colour, label, width)


def _path_curve(run: MeasuredRun, colour: str, *, desired: bool = False, width: float = 0.9) -> Curve:
    """Path of the TCP over the movement, base frame [mm]."""
    p = run.track.p_ref if desired else run.track.p_actual
    return Curve(1e3 * p[run.track.movement], colour, width=width, opacity=0.6 if desired else 1.0)


def movement_sheet(runs: Sequence[MeasuredRun]) -> Sheet:
    """Everything about the runs of one movement: the paper's figures 4 and 5 and what explains them."""
    first, coloured = runs[0], {colour_of(i): run for i, run in enumerate(runs)}
    t, track = _step_times(first), first.track
    span = (max(t[0], -0.15), min(t[-1], track.t_end - track.t_start + 0.35))
    size = (WIDTH, 8.4)
    ((upper, _), (lower, right)) = boxes(
        size, (6.3, 3.7), (2.6, 1.4), margins=(0.72, 0.4, 0.45, 3.4), gaps=(0.2, 0.45)
    )
    below = boxes(size, (1, 1, 1), (1,), margins=(0.72, 0.15, 5.75, 0.5), gaps=(0.8, 0.0))[0]
    desired = speed_curve(first, REFERENCE_GREY, "desired", desired=True, width=4.0)
    actual = [
        speed_curve(run, colour, f"actual r{run.provenance.repetition}, {run.snr.speed_db:.1f} dB")
        for colour, run in coloured.items()
    ]
    errors = [
        Curve(np.c_[_step_times(run), 1e3 * _speed_error(run)], colour, f"r{run.provenance.repetition}", 0.8)
        for colour, run in coloured.items()
    ]
    panels = (
        Panel(
            upper,
            (desired, *actual),
            "TCP speed",
            ("", "TCP speed [mm/s]"),
            (span, (0.0, None)),
            "above",
        ),
        Panel(
            lower,
            errors,
            "Speed error, actual − desired",
            ("time since the movement began [s]", "error [mm/s]"),
            (span, (None, None)),
        ),
        _path_panel((right[0], right[1] - 0.01, right[2], 0.53), coloured),
        *_joint_panels(below, first),
        _spread_panel(below[2], coloured),
    )
    return Sheet(size[1], panels, first.provenance.origin.mark)


def signals_sheet(
    t: Array, tcp_speed: Array, q: Array, qd: Array, qd_cmd: Array, simulated: bool | None
) -> Sheet:
    """A motion without a reference.

    Args:
        t: (n,) [s].
        tcp_speed: (n,) [m/s].
        q: (n, 6) reported joint positions [rad].
        qd: (n, 6) reported joint velocities [rad/s].
        qd_cmd: (n, 6) commanded ones [rad/s].
        simulated: True, False, or None where it is not known.
    """
    size = (WIDTH, 7.2)
    (upper,), (middle,), (lower,) = boxes(
        size, (1,), (1, 1, 1), margins=(0.7, 0.15, 0.4, 0.5), gaps=(0.0, 0.5)
    )
    span = (float(t[0]), float(t[-1]))
    commanded = [Curve(np.c_[t, v], REFERENCE_GREY, width=2.0, stepped=True) for v in qd_cmd.T]
    free = (None, None)
    panels = (
        Panel(
            upper, [Curve(np.c_[t, 1e3 * tcp_speed], BLUE)], "", ("", "TCP speed [mm/s]"), (span, (0.0, None))
        ),
        Panel(middle, _joint_curves(t, q), "", ("", "joint angle [rad]"), (span, free), "above"),
        Panel(
            lower,
            [*commanded, *_joint_curves(t, qd)],
            "Commanded (grey) and reported",
            ("time [s]", "joint velocity [rad/s]"),
            (span, free),
        ),
    )
    return Sheet(size[1], panels, origin_of(simulated).mark)


def levels_figure(
    frame: pl.DataFrame, experiments: Sequence[tuple[str, Table]], mark: str, *, floors: bool = False
) -> Figure:
    """The SNR of each movement: the paper's figure, and of each experiment the mean and the single runs.

    Args:
        frame: a row a movement: its name, the paper's figure, and the noise floor.
        experiments: label and table of each.
        mark: as of `Sheet`.
        floors: whether the noise floors are shown.
    """
    names = frame["name"].to_list()
    series = [Bars("paper, real UR3", PAPER_GREY, frame["paper_snr_db"].to_numpy())]
    for i, (label, table) in enumerate(experiments):
        runs = [[run.snr.speed_db for run in table.runs.get(name, ())] for name in names]
        means = np.array([np.mean(levels) if levels else np.nan for levels in runs])
        series.append(
            Bars(label, colour_of(i), means, [levels if len(levels) > 1 else [] for levels in runs])
        )
    return bars_of_levels(
        names,
        series,
        mark,
        title="SNR of the TCP speed (Eq. 10)",
        floors=frame["noise_floor_db"].to_numpy() if floors else None,
    )


def speeds_sheet(names: Sequence[str], experiments: Sequence[tuple[str, Table]], mark: str) -> Sheet:
    """TCP speeds over time, one panel a movement: desired, and the first run of each experiment."""
    n_rows = -(-len(names) // _SPEED_COLUMNS)
    height = _SPEED_HEIGHT * n_rows + 0.4
    grid = boxes(
        (WIDTH, height),
        [1] * _SPEED_COLUMNS,
        [1] * n_rows,
        margins=(0.65, 0.15, 0.55, 0.5),
        gaps=(0.65, 0.75),
    )
    panels = []
    # Down the first column, then down the second: the kinds stand beside each other.
    for k, name in enumerate(names):
        runs = {i: table.runs[name][0] for i, (_, table) in enumerate(experiments) if name in table.runs}
        first = next(iter(runs.values()))
        desired = speed_curve(first, REFERENCE_GREY, "desired", desired=True, width=3.6)
        actual = [speed_curve(run, colour_of(i), experiments[i][0], width=1.0) for i, run in runs.items()]
        span = (-0.1, first.track.t_end - first.track.t_start + 0.3)
        panels.append(
            Panel(
                grid[k % n_rows][k // n_rows],
                (desired, *actual),
                name,
                ("time [s]", "speed [mm/s]"),
                (span, (0.0, None)),
                "" if k else "above",
            )
        )
    return Sheet(height, panels, mark)


def definitions_figure(table: Table) -> Figure:
    """The four SNR definitions for each movement, means over the repetitions."""
    series = (
        ("speed, as in Eq. 10", BLUE, "snr_db"),
        ("speed, shifted", SKY, "snr_shifted_db"),
        ("velocity vector", RED, "vector_snr_db"),
        ("velocity vector, shifted", ORANGE, "vector_snr_shifted_db"),
    )
    means = table.means
    bars = [Bars(label, colour, means[name].to_numpy()) for label, colour, name in series]
    return bars_of_levels(
        means["name"].to_list(), bars, table.provenance.origin.mark, title="Four definitions"
    )


def budget_figure(table: Table) -> Figure:
    """Where the error power of each movement lies: bars of shares, and the level of the whole."""
    means = table.means
    height = 0.34 * len(means) + 1.25
    with figure(height, table.provenance.origin.mark) as page:
        axes = page.add_axes((0.115, 0.55 / height, 0.755, 1.0 - 1.15 / height))
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


def _path_panel(box: Box, coloured: Mapping[str, MeasuredRun]) -> Panel:
    first = next(iter(coloured.values()))
    targets = 1e3 * np.array(first.provenance.target_points, dtype=np.float64).reshape(-1, 3)
    desired = _path_curve(first, REFERENCE_GREY, desired=True, width=3.0)
    circles = Curve(targets, "#000000", width=0.0, marker="o", hollow=True)
    return Panel(
        box,
        (desired, *(_path_curve(run, colour) for colour, run in coloured.items()), circles),
        "TCP path and target points, base frame",
        ("x [mm]", "y [mm]", "z [mm]"),
        cube_around(np.vstack([desired.points, targets])),
        texts=[(target, str(i)) for i, target in enumerate(targets, start=1)],
    )


def _joint_panels(places: Sequence[Box], run: MeasuredRun) -> tuple[Panel, Panel]:
    rows, moving, number = run.track.rows, run.track.movement, f"r{run.provenance.repetition}"
    t = run.track.t[moving] - run.track.t_start
    ref, actual = (run.recording.column(name)[rows][moving] for name in ("ref_q", "actual_q"))
    wanted = [Curve(np.c_[t, q], REFERENCE_GREY, width=2.6) for q in (ref - ref[0]).T]
    errors = 1e3 * joint_errors(run.recording, run.track)[moving]
    return (
        Panel(
            places[0],
            [*wanted, *_joint_curves(t, actual - ref[0])],
            f"Joints, reference (grey) and actual, {number}",
            ("time [s]", "angle since start [rad]"),
            ((float(t[0]), float(t[-1])), (None, None)),
        ),
        Panel(
            places[1],
            _joint_curves(t, errors),
            f"Joint tracking error, {number}",
            ("time [s]", "reference − actual [mrad]"),
            ((float(t[0]), float(t[-1])), (None, None)),
            "inside",
            columns=3,
        ),
    )


def _spread_panel(box: Box, coloured: Mapping[str, MeasuredRun]) -> Panel:
    errors = [1e3 * position_errors(run.track) for run in coloured.values()]
    edges = np.linspace(0.0, max(1e-3, *(float(e.max()) for e in errors)), 31)
    curves = []
    for (colour, run), error in zip(coloured.items(), errors, strict=True):
        shares = 100.0 * np.histogram(error, edges)[0] / len(error)
        label = f"r{run.provenance.repetition}: rms {run.errors.rms_position_error_mm:.2f} mm"
        curves.append(Curve(np.c_[edges, np.append(shares, 0.0)], colour, label, 1.2, stepped=True))
    return Panel(
        box,
        curves,
        "Position error over the movement",
        ("TCP position error [mm]", "share of time [%]"),
        ((0.0, float(edges[-1])), (0.0, None)),
        "inside",
        columns=1,
    )


def _joint_curves(t: Array, values: Array) -> list[Curve]:
    return [
        Curve(np.c_[t, v], colour_of(i), name)
        for i, (v, name) in enumerate(zip(values.T, JOINT_NAMES, strict=True))
    ]


def _speed_error(run: MeasuredRun) -> Array:
    track = run.track
    return speed(track.t, track.p_actual) - speed(track.t, track.p_ref)


def _step_times(run: MeasuredRun) -> Array:
    """The middle of each first difference, s since the movement began."""
    t = run.track.t
    return 0.5 * (t[1:] + t[:-1]) - run.track.t_start
