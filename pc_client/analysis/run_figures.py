"""The figures of one run and of the runs of one movement. Loads matplotlib."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from pc_client.analysis.measures import joint_errors, position_errors, speed, steps_of
from pc_client.analysis.run import MeasuredRun
from pc_client.arrays import Array
from pc_client.results.figures import (
    BLUE,
    HOLLOW,
    OUTLINE,
    REFERENCE_GREY,
    colour_of,
    figure,
    label_axes,
    show_legend,
    space_axes,
)
from protocol.ur_types import JOINT_NAMES


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
