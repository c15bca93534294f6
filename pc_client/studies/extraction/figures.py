"""Pictures of extractions, as PNG bytes: one recording, and an overview of many. Loads matplotlib.

The recording is the thick grey line, the reconstruction the thin one upon it; what stands alone (single
strokes, virtual targets) has a colour of its own.
"""

from __future__ import annotations

from pathlib import PurePath
from typing import TYPE_CHECKING

import numpy as np

from pc_client.arrays import Array
from pc_client.errors import printable
from pc_client.movements.trajectory import Motion
from pc_client.results.matplotlib_figures import draw, figure, image_bytes
from pc_client.results.sheet import BLUE, RED, REFERENCE_GREY, SKY, Curve, Panel, Sheet, boxes, cube_around
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
    paths: list[Curve] = []
    speeds: list[Curve] = []
    for index, part in enumerate(extraction.parts):
        t, motion = _reconstruction(part)
        targets = part.trajectory.target_points[:, :dim]
        names = ("recorded", "reconstructed", "virtual targets", "single strokes") if index == 0 else [""] * 4
        paths += [
            Curve(part.p, REFERENCE_GREY, names[0], 4.0, opacity=0.7),
            Curve(targets, BLUE, width=0.5, style=":"),
            Curve(targets, BLUE, names[2], 0.0, marker="o", size=4.0, hollow=True),
            Curve(motion.p[:, :dim], RED, names[1], 1.3),
        ]
        speeds.append(Curve(_over(part.t, part.v), REFERENCE_GREY, names[0], 4.0, opacity=0.7))
        if part.n_strokes <= _MOST_STROKES:
            strokes = part.trajectory.stroke_speeds(t).T
            speeds += [Curve(np.c_[t, v], SKY, "" if k else names[3], 0.8) for k, v in enumerate(strokes)]
        speeds.append(Curve(_over(t, motion.v), RED, names[1], 1.3))
    paths += [Curve(still.p[:1], REFERENCE_GREY, width=0.0, marker="o") for still in extraction.still]
    left, right = boxes(_SIZE, (1.0, 1.7), (1,), margins=(0.7, 0.15, 0.75, 0.55), gaps=(0.8, 0.0))[0]
    everything = np.vstack([curve.points for curve in paths])
    panels = (
        Panel(
            left,
            paths,
            labels=("x [unit of the recording]", "y", "z")[:dim],
            ranges=[(None, None)] * 2 if dim == 2 else cube_around(everything, least=0.3),
            legend="above",
            equal=True,
        ),
        Panel(
            right,
            speeds,
            labels=("time [s]", "speed, low-passed [unit of the recording per s]"),
            ranges=((None, None), (0.0, None)),
            legend="above",
        ),
    )
    return image_bytes(draw(Sheet(_SIZE[1], panels, "", printable(_title(extraction)), _SIZE[0])))


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
    size = (12.0, 3.4)
    places = boxes(size, (1, 1, 1), (1,), margins=(0.6, 0.15, 0.7, 0.55), gaps=(0.5, 0.0))[0]
    with figure(size[1], width=size[0], title=f"{len(moving)} recordings") as page:
        for box, (label, name, form, worst) in zip(places, figures, strict=True):
            axes = page.add_axes(box, xlabel=label, ylabel="recordings")
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


def _over(t: Array, v: Array) -> Array:
    return np.column_stack((t, np.linalg.norm(v, axis=1)))


def _reconstruction(part: PartExtraction) -> tuple[Array, Motion]:
    """The movement of the strokes at up to `_MOST_TIMES` times, computed for a few hundred at a time."""
    t = part.t[:: 1 + len(part.t) // _MOST_TIMES]
    blocks = [part.trajectory.evaluate(block) for block in np.array_split(t, 1 + len(t) // 250)]
    return t, Motion(*(np.concatenate(values) for values in zip(*blocks, strict=True)))
