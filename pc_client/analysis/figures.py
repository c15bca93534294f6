"""The figures of runs and experiments: one run, the runs of a movement, bars of levels and of shares, speeds.

Loads matplotlib.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import polars as pl
from matplotlib.figure import Figure

from pc_client.analysis.measures import PARTS, joint_errors, position_errors, speed, steps_of
from pc_client.analysis.run import MeasuredRun, budget_column
from pc_client.analysis.table import Table
from pc_client.arrays import Array
from pc_client.results.figures import (
    BLUE,
    GREEN,
    HOLLOW,
    ORANGE,
    OUTLINE,
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
    space_axes,
)
from protocol.ur_types import JOINT_NAMES

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


def signals_figure(t: Array, tcp_speed: Array, q: Array, qd: Array, qd_cmd: Array, mark: str) -> Figure:
    """A motion without a reference: speed of the TCP, joint angles, joint velocities; arrays of `Signals`."""
    span = (float(t[0]), float(t[-1]))
    with figure(7.2, mark) as page:
        speed, angles, velocities = page.subplots(3, 1)
        speed.plot(t, 1e3 * tcp_speed, color=BLUE)
        label_axes(speed, "", "", "TCP speed [mm/s]", span, 0.0)
        _plot_joints(angles, t, q)
        label_axes(angles, "", "", "joint angle [rad]", span)
        show_legend(angles, "above")
        velocities.plot(t, qd_cmd, color=REFERENCE_GREY, lw=2.0, drawstyle="steps-post")
        _plot_joints(velocities, t, qd)
        label_axes(velocities, "Commanded (grey) and reported", "time [s]", "joint velocity [rad/s]", span)
    return page


def movement_figure(runs: Sequence[MeasuredRun]) -> Figure:
    """Everything about the runs of one movement: the paper's figures 4 and 5 and what explains them."""
    first, coloured = runs[0], {colour_of(i): run for i, run in enumerate(runs)}
    track, t = first.track, _step_times(first)
    span = (max(t[0], -0.15), min(t[-1], track.t_end - track.t_start + 0.35))
    with figure(8.4, first.provenance.origin.mark) as page:
        above, below = page.subfigures(2, 1, squeeze=False, height_ratios=(1.6, 1.0))[:, 0]
        grid = above.add_gridspec(2, 2, width_ratios=(6.3, 3.7), height_ratios=(2.6, 1.4))
        speeds, errors = above.add_subplot(grid[0, 0]), above.add_subplot(grid[1, 0])
        plot_speed(speeds, first, REFERENCE_GREY, "desired", desired=True, width=4.0)
        for colour, run in coloured.items():
            number = f"r{run.provenance.repetition}"
            plot_speed(speeds, run, colour, f"actual {number}, {run.snr.speed_db:.1f} dB")
            errors.plot(
                _step_times(run), 1e3 * (_speed(run) - _speed(run, desired=True)), color=colour, lw=0.8
            )
        label_axes(speeds, "TCP speed", "", "TCP speed [mm/s]", span, 0.0)
        show_legend(speeds, "above")
        since = "time since the movement began [s]"
        label_axes(errors, "Speed error, actual − desired", since, "error [mm/s]", span)
        _draw_path(above.add_subplot(grid[:, 1], projection="3d"), coloured)
        joints, tracking, spread = below.subplots(1, 3)
        _draw_joints(joints, tracking, first)
        _draw_spread(spread, coloured)
    return page


def plot_speed(
    axes: Any, run: MeasuredRun, colour: str, text: str, *, desired: bool = False, width: float = 0.9
) -> None:
    """Plot the TCP speed [mm/s] over the time since the movement began [s]; not smoothed."""
    axes.plot(_step_times(run), 1e3 * _speed(run, desired=desired), color=colour, label=text, lw=width)


def _draw_path(axes: Any, coloured: Mapping[str, MeasuredRun]) -> None:
    first = next(iter(coloured.values()))
    desired = 1e3 * first.track.p_ref[first.track.movement]
    targets = 1e3 * np.array(first.provenance.target_points, dtype=np.float64).reshape(-1, 3)
    axes.plot(*desired.T, color=REFERENCE_GREY, lw=3.0, alpha=0.6)
    for colour, run in coloured.items():
        axes.plot(*(1e3 * run.track.p_actual[run.track.movement]).T, color=colour, lw=0.9)
    axes.plot(*targets.T, color="black", **HOLLOW)
    for number, target in enumerate(targets, start=1):
        axes.text(*target, f"  {number}", path_effects=OUTLINE)
    axes.set_title("TCP path and target points, base frame")
    space_axes(axes, np.vstack([desired, targets]), ("x [mm]", "y [mm]", "z [mm]"), zoom=0.9)


def _draw_joints(joints: Any, tracking: Any, run: MeasuredRun) -> None:
    rows, moving, number = run.track.rows, run.track.movement, f"r{run.provenance.repetition}"
    t = run.track.t[moving] - run.track.t_start
    span = (float(t[0]), float(t[-1]))
    ref, actual = (run.recording.column(name)[rows][moving] for name in ("ref_q", "actual_q"))
    joints.plot(t, ref - ref[0], color=REFERENCE_GREY, lw=2.6)
    _plot_joints(joints, t, actual - ref[0])
    label_axes(
        joints, f"Joints, reference (grey) and actual, {number}", "time [s]", "angle since start [rad]", span
    )
    _plot_joints(tracking, t, 1e3 * joint_errors(run.recording, run.track)[moving])
    label_axes(tracking, f"Joint tracking error, {number}", "time [s]", "reference − actual [mrad]", span)
    show_legend(tracking, "inside", 3)


def _draw_spread(axes: Any, coloured: Mapping[str, MeasuredRun]) -> None:
    errors = [1e3 * position_errors(run.track) for run in coloured.values()]
    edges = np.linspace(0.0, max(1e-3, *(float(e.max()) for e in errors)), 31)
    for (colour, run), error in zip(coloured.items(), errors, strict=True):
        shares = 100.0 * np.histogram(error, edges)[0] / len(error)
        text = f"r{run.provenance.repetition}: rms {run.errors.rms_position_error_mm:.2f} mm"
        axes.stairs(shares, edges, color=colour, label=text, lw=1.2)
    title, x = "Position error over the movement", "TCP position error [mm]"
    label_axes(axes, title, x, "share of time [%]", (0.0, float(edges[-1])), 0.0)
    show_legend(axes, "inside", 1)


def _plot_joints(axes: Any, t: Array, values: Array) -> None:
    for i, (joint, name) in enumerate(zip(values.T, JOINT_NAMES, strict=True)):
        axes.plot(t, joint, color=colour_of(i), label=name)


def _speed(run: MeasuredRun, *, desired: bool = False) -> Array:
    """TCP speed at each step [m/s]."""
    return speed(run.track.t, run.track.p_ref if desired else run.track.p_actual)


def _step_times(run: MeasuredRun) -> Array:
    """The middle of each step, s since the movement began."""
    t = run.track.t
    begins, ends = steps_of(t)
    middle: Array = 0.5 * (t[begins] + t[ends]) - run.track.t_start
    return middle
