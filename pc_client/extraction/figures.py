"""Pictures of extractions, as PNG bytes: one recording, and an overview of many.

The only module of the package that loads matplotlib. The recording is the thick grey line, the reconstruction
the thin one upon it; what stands alone (single strokes, virtual targets) has the colour of its own.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import PurePath
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pc_client.errors import printable
from pc_client.extraction.extract import Extraction, PartExtraction
from pc_client.extraction.results import Row
from pc_client.movements.stroke import Motion

__all__ = ["draw_extraction", "draw_overview"]

_RECORDED, _RECONSTRUCTED, _STROKES, _TARGETS = "#A8A29E", "#D55E00", "#56B4E9", "#0072B2"
_DPI = 110
#: A part of more strokes is drawn without its single strokes; a longer one at no more than so many times.
_MOST_STROKES, _MOST_TIMES = 500, 5000


def draw_extraction(extraction: Extraction) -> bytes:
    """One recording: its path with the virtual targets, and its speed with the single strokes.

    Args:
        extraction: with at least one part that moves.
    """
    spatial = extraction.parts[0].p.shape[1] == 3
    figure = Figure(figsize=(12.0, 4.6), layout="constrained")
    figure.suptitle(printable(_title(extraction)), fontsize=10, parse_math=False)
    grid = figure.add_gridspec(1, 2, width_ratios=(1.0, 1.7))
    path = figure.add_subplot(grid[0], projection="3d" if spatial else None)
    speed = figure.add_subplot(grid[1])
    for index, part in enumerate(extraction.parts):
        _draw_path(path, part, labelled=index == 0)
        _draw_speed(speed, part, labelled=index == 0)
    if not spatial:
        for still in extraction.still:
            path.plot(*still.p[0], marker=".", color=_RECORDED)
        path.set_aspect("equal", adjustable="datalim")
    else:
        path.set_aspect("equal")
    path.set_title("path, unit of the recording", fontsize=9)
    path.legend(fontsize=7, frameon=False, loc="upper left", bbox_to_anchor=(0.0, -0.06), ncols=3)
    speed.set_title("speed, unit of the recording per s", fontsize=9)
    speed.set_xlabel("time (s)")
    speed.set_ylim(bottom=0.0)
    speed.spines[["top", "right"]].set_visible(False)
    speed.legend(fontsize=7, frameon=False, loc="upper left", bbox_to_anchor=(0.0, -0.1), ncols=3)
    return _png(figure)


def draw_overview(rows: Sequence[Row]) -> bytes:
    """A batch: histograms of SNR_v, SNR_t and strokes per speed peak.

    Args:
        rows: of recordings; those in which nothing moves are passed over.
    """
    moving = [row for row in rows if row.snr_v_db is not None]
    figures = (
        ("SNR_v (dB)", [row.snr_v_db for row in moving], "%.1f dB", "least"),
        ("SNR_t (dB)", [row.snr_t_db for row in moving], "%.1f dB", "least"),
        ("strokes per speed peak", [row.strokes_per_peak for row in moving], "%.2f", "most"),
    )
    figure = Figure(figsize=(12.0, 3.4), layout="constrained")
    figure.suptitle(f"{len(moving)} recordings", fontsize=10)
    for index, (label, values, form, worst) in enumerate(figures):
        axes = figure.add_subplot(1, 3, index + 1)
        known = np.array([value for value in values if value is not None])
        if len(known):
            axes.hist(known, bins=min(40, max(5, len(known) // 4)), color=_TARGETS)
            axes.axvline(known.mean(), color=_RECONSTRUCTED, linewidth=1.5)
            extreme = f"{worst} {form % (known.min() if worst == 'least' else known.max())}"
            axes.set_title(f"mean {form % known.mean()}, {extreme}", fontsize=9)
        axes.set_xlabel(label)
        axes.spines[["top", "right"]].set_visible(False)
        if index == 0:
            axes.set_ylabel("recordings")
    return _png(figure)


def _title(extraction: Extraction) -> str:
    return (
        f"{'/'.join(PurePath(extraction.name).parts[-3:])}: SNR_v {extraction.snr_v_db:.1f} dB, "
        f"SNR_t {extraction.snr_t_db:.1f} dB, {extraction.n_strokes} strokes for "
        f"{extraction.n_speed_peaks} speed peaks"
    )


def _draw_path(axes: Any, part: PartExtraction, *, labelled: bool) -> None:
    dim = part.p.shape[1]
    labels = ("recorded", "reconstructed", "virtual targets") if labelled else (None, None, None)
    targets = part.trajectory.target_points[:, :dim]
    _, reconstruction = _reconstruction(part)
    axes.plot(*part.p.T, color=_RECORDED, linewidth=4.0, alpha=0.7, label=labels[0])
    axes.plot(*targets.T, color=_TARGETS, linewidth=0.5, linestyle=":")
    axes.plot(
        *targets.T, linestyle="none", marker="o", markersize=4, mfc="none", mec=_TARGETS, label=labels[2]
    )
    axes.plot(*reconstruction.p[:, :dim].T, color=_RECONSTRUCTED, linewidth=1.3, label=labels[1])


def _draw_speed(axes: Any, part: PartExtraction, *, labelled: bool) -> None:
    labels = ("recorded, low-passed", "reconstructed", "single strokes") if labelled else (None, None, None)
    speed = np.linalg.norm(part.v, axis=1)
    t, reconstruction = _reconstruction(part)
    axes.plot(part.t, speed, color=_RECORDED, linewidth=4.0, alpha=0.7, label=labels[0])
    if part.n_strokes <= _MOST_STROKES:
        for index, lognormal in enumerate(part.trajectory.stroke_speeds(t).T):
            axes.plot(t, lognormal, color=_STROKES, linewidth=0.8, label=labels[2] if index == 0 else None)
    reconstructed = np.linalg.norm(reconstruction.v, axis=1)
    axes.plot(t, reconstructed, color=_RECONSTRUCTED, linewidth=1.3, label=labels[1])


def _reconstruction(part: PartExtraction) -> tuple[NDArray[np.float64], Motion]:
    """The movement of the strokes at up to `_MOST_TIMES` times, worked out a few hundred at a time."""
    t = part.t[:: 1 + len(part.t) // _MOST_TIMES]
    blocks = [part.trajectory.evaluate(block) for block in np.array_split(t, 1 + len(t) // 250)]
    return t, Motion(*(np.concatenate(values) for values in zip(*blocks, strict=True)))


def _png(figure: Figure) -> bytes:
    page = io.BytesIO()
    FigureCanvasAgg(figure)
    figure.savefig(page, format="png", dpi=_DPI)
    return page.getvalue()
