"""The plots of the report, as SVG text.

The only module that loads matplotlib; import it where a plot is drawn, never from what the control loop
imports. Colours are those of Okabe and Ito, which colour-blind readers can distinguish; the reference is
always the thick grey line, so that a plot can be read without its legend. Every plot of
data that are not known to be of a real arm says so.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from pc_client.analysis.budget import PARTS
from pc_client.analysis.metrics import joint_errors, position_errors
from pc_client.analysis.run import MeasuredRun, budget_column
from pc_client.analysis.table import Table
from pc_client.analysis.track import speed
from pc_client.recording.origin import origin_of
from protocol.ur_types import JOINT_NAMES

Array = np.ndarray

BLUE, ORANGE, GREEN, RED, PURPLE, SKY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9"
REFERENCE_GREY, PAPER_GREY = "#9A9A9A", "#B8B8B8"
RUN_COLOURS = (BLUE, RED, GREEN, PURPLE, ORANGE, SKY)
JOINT_COLOURS = (BLUE, ORANGE, GREEN, RED, PURPLE, SKY)
PART_COLOURS = (BLUE, ORANGE, GREEN, RED, "#444444")

_STYLE = {
    "font.family": "DejaVu Sans",  # comes with matplotlib, so every machine draws the same letters
    "font.size": 9.0,
    "text.parse_math": False,  # a name with two dollar signs is a name
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.edgecolor": "#666666",
    "xtick.color": "#333333",
    "ytick.color": "#333333",
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "lines.solid_joinstyle": "round",
    "svg.hashsalt": "ur-hil",  # the same data give the same file
    "svg.fonttype": "path",
    "path.simplify": True,
    "path.simplify_threshold": 0.2,
}


def movement_figure(runs: Sequence[MeasuredRun]) -> Figure:
    """Draw everything about the runs of one movement: the paper's figures 4 and 5 and what explains them."""
    with styled_figure(11.0, 8.4, runs[0].provenance.origin.mark) as figure:
        speed_axes = figure.add_axes((0.065, 0.645, 0.575, 0.3))
        _draw_speed(speed_axes, runs)
        _draw_speed_error(figure.add_axes((0.065, 0.425, 0.575, 0.165), sharex=speed_axes), runs)
        _draw_path(figure.add_axes((0.665, 0.395, 0.3, 0.525), projection="3d"), runs)
        _draw_joints(figure.add_axes((0.065, 0.06, 0.255, 0.27)), runs[0])
        _draw_joint_errors(figure.add_axes((0.395, 0.06, 0.255, 0.27)), runs[0])
        _draw_histogram(figure.add_axes((0.725, 0.06, 0.26, 0.27)), runs)
    return figure


def signals_figure(
    t: Array, tcp_speed: Array, q: Array, qd: Array, qd_cmd: Array, simulated: bool | None
) -> Figure:
    """Draw a motion without a reference.

    Args:
        t: (n,) [s].
        tcp_speed: (n,) [m/s].
        q: (n, 6) reported joint positions [rad].
        qd: (n, 6) reported joint velocities [rad/s].
        qd_cmd: (n, 6) commanded ones [rad/s].
        simulated: True, False, or None where it is not known.
    """
    with styled_figure(11.0, 7.2, origin_of(simulated).mark) as figure:
        upper = figure.add_axes((0.065, 0.71, 0.92, 0.24))
        upper.plot(t, 1e3 * tcp_speed, color=BLUE, lw=1.0)
        upper.set_ylim(bottom=0.0)
        upper.set_ylabel("TCP speed [mm/s]")
        middle = figure.add_axes((0.065, 0.39, 0.92, 0.24), sharex=upper)
        lower = figure.add_axes((0.065, 0.07, 0.92, 0.24), sharex=upper)
        for joint, colour in enumerate(JOINT_COLOURS):
            middle.plot(t, q[:, joint], color=colour, lw=1.0, label=JOINT_NAMES[joint])
            lower.step(t, qd_cmd[:, joint], color=REFERENCE_GREY, lw=2.0, where="post")
            lower.plot(t, qd[:, joint], color=colour, lw=1.0)
        middle.set_ylabel("joint angle [rad]")
        middle.legend(ncols=6, loc="lower right", bbox_to_anchor=(1.0, 0.99), borderaxespad=0.1)
        lower.set_ylabel("joint velocity [rad/s]")
        lower.set_title("Commanded (grey) and reported")
        lower.set_xlabel("time [s]")
    return figure


def draw_movement(runs: Sequence[MeasuredRun]) -> str:
    """`movement_figure` as SVG text."""
    return _svg_text(movement_figure(runs))


def draw_table(table: Table) -> str:
    """Draw Table I: our repetitions and mean beside the paper's figure, for each movement."""
    with svg_figure(11.0, 3.4, table.provenance.origin.mark) as (figure, page):
        axes = figure.add_axes((0.06, 0.2, 0.925, 0.68))
        x = np.arange(len(table.frame))
        names, paper, means, floors = (
            table.frame[name].to_numpy() for name in ("name", "paper_snr_db", "mean_snr_db", "noise_floor_db")
        )
        axes.bar(x - 0.2, paper, 0.36, color=PAPER_GREY, label="paper, real UR3")
        axes.bar(x + 0.2, means, 0.36, color=BLUE, label="ours, mean")
        for i, levels in enumerate(table.frame["snr_db"]):
            label = "ours, single runs" if i == 0 else None
            axes.plot(
                [i + 0.2] * len(levels),
                levels,
                "o",
                ms=3.2,
                mfc="white",
                mec="black",
                mew=0.8,
                label=label,
            )
        if not np.isnan(floors).all():
            axes.hlines(floors, x - 0.02, x + 0.42, color=RED, lw=1.4, label="noise floor of the encoders")
        axes.set_xticks(x, names, rotation=20, ha="right")
        axes.set_ylabel("SNR [dB]")
        axes.set_title("SNR of the TCP speed (Eq. 10)")
        axes.grid(axis="x", visible=False)
        axes.legend(ncols=4, loc="lower right", bbox_to_anchor=(0.9, 0.99), borderaxespad=0.2)
    return page.getvalue()


def draw_definitions(table: Table) -> str:
    """Draw the four SNR definitions for each movement, means over the repetitions."""
    series = (
        ("speed, as in Eq. 10", "o", BLUE, "snr_db"),
        ("speed, after best time shift", "^", SKY, "snr_shifted_db"),
        ("velocity vector", "s", RED, "vector_snr_db"),
        ("velocity vector, after best time shift", "D", ORANGE, "vector_snr_shifted_db"),
    )
    means = table.means
    with svg_figure(11.0, 3.1, table.provenance.origin.mark) as (figure, page):
        axes = figure.add_axes((0.06, 0.21, 0.925, 0.63))
        for i, (label, marker, colour, name) in enumerate(series):
            x = np.arange(len(means)) + 0.16 * (i - 1.5)
            axes.vlines(x, 0.0, means[name], color=colour, lw=1.2, alpha=0.5)
            axes.plot(x, means[name], marker, color=colour, ms=5.5, label=label)
        axes.set_xticks(range(len(means)), means["name"].to_list(), rotation=20, ha="right")
        axes.set_ylim(bottom=0.0)
        axes.set_ylabel("SNR [dB]")
        axes.grid(axis="x", visible=False)
        axes.legend(ncols=4, loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)
    return page.getvalue()


def draw_budget(table: Table) -> str:
    """Draw where the error power of each movement lies: bars of shares, and the level of the whole."""
    means = table.means
    with svg_figure(11.0, 0.34 * len(means) + 1.25, table.provenance.origin.mark) as (figure, page):
        height = figure.get_figheight()
        axes = figure.add_axes((0.115, 0.55 / height, 0.755, 1.0 - 1.15 / height))
        y = np.arange(len(means))
        left = np.zeros(len(means))
        for part, colour in zip(PARTS, PART_COLOURS, strict=True):
            shares = 100.0 * means[budget_column(part)].to_numpy()
            axes.barh(y, shares, 0.72, left=left, color=colour, label=part)
            for i, share in enumerate(shares):
                if share >= 6.0:
                    x = left[i] + share / 2
                    axes.text(x, i, f"{share:.0f}", ha="center", va="center", color="white", fontsize=8)
            left += shares
        for i, level in enumerate(means["snr_db"]):
            axes.text(101.0, i, f"{level:.1f} dB", va="center", fontsize=8.5)
        axes.set_yticks(y, means["name"].to_list())
        axes.set_ylim(len(means) - 0.5, -0.5)
        axes.set_xlim(0.0, 100.0)
        axes.set_xlabel("share of the error power [%]; at the right the SNR that the whole error leaves")
        axes.grid(axis="y", visible=False)
        axes.legend(ncols=len(PARTS), loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)
    return page.getvalue()


def _draw_speed(axes: Axes, runs: Sequence[MeasuredRun]) -> None:
    """Draw the paper's figure 4 or 5, without its smoothing."""
    first = runs[0].track
    t = _step_times(runs[0])
    axes.plot(t, 1e3 * speed(first.t, first.p_ref), color=REFERENCE_GREY, lw=4.0, label="desired")
    for run, colour in zip(runs, _colours(runs), strict=True):
        label = f"actual r{run.provenance.repetition}, {run.snr.speed_db:.1f} dB"
        track = run.track
        axes.plot(_step_times(run), 1e3 * speed(track.t, track.p_actual), color=colour, lw=0.9, label=label)
    axes.set_xlim(max(t[0], -0.15), min(t[-1], first.t_end - first.t_start + 0.35))
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("TCP speed [mm/s]")
    axes.set_title("TCP speed")
    axes.legend(ncols=4, loc="lower right", bbox_to_anchor=(1.0, 0.99), borderaxespad=0.1, columnspacing=1.2)
    axes.tick_params(labelbottom=False)


def _draw_speed_error(axes: Axes, runs: Sequence[MeasuredRun]) -> None:
    for run, colour in zip(runs, _colours(runs), strict=True):
        track = run.track
        error = speed(track.t, track.p_actual) - speed(track.t, track.p_ref)
        axes.plot(_step_times(run), 1e3 * error, color=colour, lw=0.8)
    axes.axhline(0.0, color="#666666", lw=0.6)
    axes.set_ylabel("error [mm/s]")
    axes.set_xlabel("time since the movement began [s]")
    axes.set_title("Speed error, actual − desired")


def _draw_path(axes: Any, runs: Sequence[MeasuredRun]) -> None:
    first = runs[0]
    for run, colour in zip(runs, _colours(runs), strict=True):
        p = 1e3 * run.track.p_actual[run.track.movement]
        axes.plot(*p.T, color=colour, lw=0.9)
    p = 1e3 * first.track.p_ref[first.track.movement]
    axes.plot(*p.T, color=REFERENCE_GREY, lw=3.0, alpha=0.6, zorder=0)
    targets = 1e3 * np.array(first.provenance.target_points, dtype=np.float64).reshape(-1, 3)
    axes.plot(*targets.T, ls="none", marker="o", ms=5.0, mfc="white", mec="black", mew=1.1)
    for i, target in enumerate(targets, start=1):
        axes.text(*target, f"  {i}", fontsize=8)
    corners = np.vstack([p, targets])
    middle = 0.5 * (corners.max(axis=0) + corners.min(axis=0))
    half = max(1.0, 0.5 * float(np.ptp(corners, axis=0).max()))
    axes.set(
        xlim=(middle[0] - half, middle[0] + half),
        ylim=(middle[1] - half, middle[1] + half),
        zlim=(middle[2] - half, middle[2] + half),
        box_aspect=(1, 1, 1),
        xlabel="x [mm]",
        ylabel="y [mm]",
        zlabel="z [mm]",
    )
    axes.tick_params(labelsize=7, pad=-1)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_major_locator(MaxNLocator(4))
    axes.set_title("TCP path and target points, base frame", pad=2.0)


def _draw_joints(axes: Axes, run: MeasuredRun) -> None:
    rows, moving = run.track.rows, run.track.movement
    t = run.track.t[moving] - run.track.t_start
    ref = run.recording.column("ref_q")[rows][moving]
    actual = run.recording.column("actual_q")[rows][moving]
    for joint, colour in enumerate(JOINT_COLOURS):
        axes.plot(t, ref[:, joint] - ref[0, joint], color=REFERENCE_GREY, lw=2.6)
        axes.plot(t, actual[:, joint] - ref[0, joint], color=colour, lw=1.0)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("angle since start [rad]")
    axes.set_title(f"Joints, reference (grey) and actual, r{run.provenance.repetition}")


def _draw_joint_errors(axes: Axes, run: MeasuredRun) -> None:
    moving = run.track.movement
    t = run.track.t[moving] - run.track.t_start
    errors = 1e3 * joint_errors(run.recording, run.track)[moving]
    for joint, colour in enumerate(JOINT_COLOURS):
        axes.plot(t, errors[:, joint], color=colour, lw=0.9, label=JOINT_NAMES[joint])
    low, high = float(errors.min()), float(errors.max())
    axes.set_ylim(low - 0.05 * (high - low) - 1e-6, high + 0.38 * (high - low) + 1e-6)  # room for the legend
    axes.legend(ncols=3, loc="upper left", columnspacing=1.0, handlelength=1.2, borderaxespad=0.1)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("reference − actual [mrad]")
    axes.set_title(f"Joint tracking error, r{run.provenance.repetition}")


def _draw_histogram(axes: Axes, runs: Sequence[MeasuredRun]) -> None:
    errors = [1e3 * position_errors(run.track) for run in runs]
    bins = np.linspace(0.0, max(1e-3, *(float(e.max()) for e in errors)), 31).tolist()
    for run, error, colour in zip(runs, errors, _colours(runs), strict=True):
        label = f"r{run.provenance.repetition}: rms {run.errors.rms_position_error_mm:.2f} mm"
        weights = np.full(len(error), 100.0 / len(error))
        axes.hist(error, bins=bins, weights=weights, histtype="step", color=colour, lw=1.2, label=label)
    axes.set_ylim(top=1.4 * axes.get_ylim()[1])  # room for the legend
    axes.legend(loc="upper left", borderaxespad=0.1)
    axes.set_xlabel("TCP position error [mm]")
    axes.set_ylabel("share of time [%]")
    axes.set_title("Position error over the movement")


def _step_times(run: MeasuredRun) -> np.ndarray:
    """Return the middle of each first difference, s since the movement began."""
    t = run.track.t
    return 0.5 * (t[1:] + t[:-1]) - run.track.t_start


def _colours(runs: Sequence[MeasuredRun]) -> list[str]:
    return [RUN_COLOURS[i % len(RUN_COLOURS)] for i in range(len(runs))]


@contextmanager
def styled_figure(width_in: float, height_in: float, mark: str) -> Iterator[Figure]:
    """Give a figure in the report's style; arguments as of `svg_figure`."""
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(width_in, height_in))
        yield figure
        if mark:
            box = {
                "boxstyle": "round,pad=0.3",
                "facecolor": "#FFF3CD",
                "edgecolor": "#B8860B",
                "linewidth": 0.8,
            }
            figure.text(
                0.992,
                1.0 - 0.08 / height_in,
                mark,
                ha="right",
                va="top",
                fontsize=8.5,
                weight="bold",
                bbox=box,
            )


@contextmanager
def svg_figure(width_in: float, height_in: float, mark: str) -> Iterator[tuple[Figure, io.StringIO]]:
    """Give a figure in the report's style; on leaving, its SVG text is in the page.

    Args:
        width_in: width [inch].
        height_in: height [inch].
        mark: what the data are, written on it; empty for those of a real arm, or none at all.

    Yields:
        The figure, and the page that the text will be in.
    """
    page = io.StringIO()
    with styled_figure(width_in, height_in, mark) as figure:
        yield figure, page
    page.write(_svg_text(figure))


def _svg_text(figure: Figure) -> str:
    page = io.StringIO()
    with mpl.rc_context(_STYLE):
        FigureCanvasSVG(figure)
        figure.savefig(page, format="svg", metadata={"Date": None, "Creator": None})
    return page.getvalue()
