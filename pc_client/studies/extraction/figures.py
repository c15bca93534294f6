"""Pictures of extractions, as PNG bytes: one recording, and an overview of many. Loads matplotlib.

The recording is the thick grey line, the reconstruction the thin one upon it; what stands alone (single
strokes, virtual targets) has a colour of its own.
"""

from __future__ import annotations

from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import numpy as np

from pc_client.arrays import Array
from pc_client.errors import printable
from pc_client.movements.trajectory import Motion
from pc_client.results.figures import (
    BLUE,
    HOLLOW,
    RED,
    REFERENCE_GREY,
    SKY,
    figure,
    image_bytes,
    label_axes,
    show_legend,
    space_axes,
)
from pc_client.studies.extraction.extract import Extraction, PartExtraction

if TYPE_CHECKING:
    import polars as pl

_SIZE = (12.0, 4.6)
#: A part of more strokes is drawn without its single strokes; a longer one at no more than so many times.
_MOST_STROKES, _MOST_TIMES = 500, 5000


def draw_extraction(extraction: Extraction) -> bytes:
    """One recording: its path with the virtual targets, and its speed with the single strokes.

    Args:
        extraction: with at least one part that moves.
    """
    dim = extraction.parts[0].p.shape[1]
    everything: list[Array] = []
    with figure(_SIZE[1], width=_SIZE[0], title=printable(_title(extraction))) as page:
        grid = page.add_gridspec(1, 2, width_ratios=(1.0, 1.7))
        paths: Any = page.add_subplot(grid[0], projection="3d" if dim == 3 else None)
        speeds = page.add_subplot(grid[1])
        for index, part in enumerate(extraction.parts):
            t, motion = _reconstruction(part)
            targets = part.trajectory.target_points[:, :dim]
            names = ("recorded", "reconstructed", "virtual targets", "single strokes")
            texts = names if index == 0 else [None] * 4
            recorded: dict[str, Any] = {"color": REFERENCE_GREY, "label": texts[0], "lw": 4.0, "alpha": 0.7}
            paths.plot(*part.p.T, **recorded)
            paths.plot(*targets.T, color=BLUE, lw=0.5, ls=":")
            paths.plot(*targets.T, color=BLUE, label=texts[2], **(HOLLOW | {"ms": 4.0}))
            paths.plot(*motion.p[:, :dim].T, color=RED, label=texts[1], lw=1.3)
            everything += [part.p, targets, motion.p[:, :dim]]
            speeds.plot(part.t, np.linalg.norm(part.v, axis=1), **recorded)
            if part.n_strokes <= _MOST_STROKES:
                for k, v in enumerate(part.trajectory.stroke_speeds(t).T):
                    speeds.plot(t, v, color=SKY, label=None if k else texts[3], lw=0.8)
            speeds.plot(t, np.linalg.norm(motion.v, axis=1), color=RED, label=texts[1], lw=1.3)
        for still in extraction.still:
            paths.plot(*still.p[:1].T, "o", color=REFERENCE_GREY)
        labels = ("x [unit of the recording]", "y", "z")
        if dim == 3:
            space_axes(paths, np.vstack(everything), labels, least=0.3)
        else:
            label_axes(paths, "", *labels[:2])
            paths.set_aspect("equal", adjustable="datalim")
        label_axes(speeds, "", "time [s]", "speed, low-passed [unit of the recording per s]", bottom=0.0)
        for axes in (paths, speeds):
            show_legend(axes, "above")
    return image_bytes(page)


def draw_overview(table: pl.DataFrame) -> bytes:
    """A batch: histograms of SNR_v, SNR_t and strokes per speed peak.

    Args:
        table: `batch.table_of` recordings; those in which nothing moves are passed over.
    """
    moving = table.drop_nulls("snr_v_db")
    figures = (
        ("SNR_v [dB]", "snr_v_db", ".1f", "least"),
        ("SNR_t [dB]", "snr_t_db", ".1f", "least"),
        ("strokes per speed peak", "strokes_per_peak", ".2f", "most"),
    )
    with figure(3.4, width=12.0, title=f"{len(moving)} recordings") as page:
        for axes, (text, name, form, worst) in zip(page.subplots(1, 3), figures, strict=True):
            axes.set(xlabel=text, ylabel="recordings")
            known = moving[name].drop_nulls().to_numpy()
            if len(known):
                axes.hist(known, bins=min(40, max(5, len(known) // 4)), color=BLUE)
                axes.axvline(known.mean(), color=RED, lw=1.5)
                extreme = known.min() if worst == "least" else known.max()
                axes.set_title(f"mean {known.mean():{form}}, {worst} {extreme:{form}}")
    return image_bytes(page)


def _title(extraction: Extraction) -> str:
    return (
        f"{'/'.join(PurePath(extraction.name).parts[-3:])}: SNR_v {extraction.snr_v_db:.1f} dB, "
        f"SNR_t {extraction.snr_t_db:.1f} dB, {extraction.n_strokes} strokes for "
        f"{extraction.n_speed_peaks} speed peaks"
    )


def _reconstruction(part: PartExtraction) -> tuple[Array, Motion]:
    """The movement of the strokes at up to `_MOST_TIMES` times, computed for a few hundred at a time."""
    t = part.t[:: 1 + len(part.t) // _MOST_TIMES]
    blocks = [part.trajectory.evaluate(block) for block in np.array_split(t, 1 + len(t) // 250)]
    return t, Motion(*(np.concatenate(values) for values in zip(*blocks, strict=True)))
