"""Small drawings for tests: strokes that are known, and a recording of them as a text file has it."""

from __future__ import annotations

import numpy as np

from pc_client.movements.lognormal import Lognormal
from pc_client.movements.sigma_lognormal import SigmaLognormal, Stroke
from pc_client.studies.extraction.extract import Extraction, PartExtraction
from pc_client.studies.extraction.pen import PenPart


def flat_trajectory(targets, onsets, end, sigma=0.2, mu=-1.6, arc_angle=0.6):
    """Strokes between points of the plane; the strokes begin before the part does."""
    points = np.column_stack((np.asarray(targets, float), np.zeros(len(targets))))
    # In the plane z = 0 the arc's normal is z x chord: a tilt of a quarter turn from the upright plane.
    strokes = tuple(Stroke(Lognormal(t0, mu, sigma), arc_angle, -np.pi / 2) for t0 in onsets)
    return SigmaLognormal(points, strokes, end)


def part_of(trajectory, begin, end):
    """A part whose recording is exactly what its strokes say."""
    t = np.linspace(begin, end, round((end - begin) * 200) + 1)
    motion = trajectory.evaluate(t)
    return PartExtraction(t, motion.p[:, :2], motion.v[:, :2], trajectory, 60.0, 60.0, 2)


def two_parts_and_a_dot(gap=0.6, dot=True):
    """Two pen-down parts, in motion at their ends, and a dot behind them; pixels, y down."""
    first = part_of(flat_trajectory([(20, 20), (60, 30), (55, 80)], (-0.15, 0.05), 0.3), 0.0, 0.3)
    begin = 0.3 + gap
    second = part_of(
        flat_trajectory([(30, 60), (80, 55), (90, 20)], (begin - 0.15, begin + 0.08), begin + 0.33),
        begin,
        begin + 0.33,
    )
    still = (PenPart(np.array([begin + 1.2]), np.array([[50.0, 95.0]])),) if dot else ()
    return Extraction("two/parts.txt", (first, second), 60.0, 60.0, remarks=("a gap",), still=still)


def one_part():
    """A drawing of one part."""
    part = part_of(flat_trajectory([(20, 20), (60, 30), (55, 80)], (-0.15, 0.05), 0.3), 0.0, 0.3)
    return Extraction("one.txt", (part,), 60.0, 60.0)


def recording_text(extraction):
    """The drawing as Omniglot's files have it: whole milliseconds, a hundredth of a pixel."""
    lines = ["START"]
    blocks = [(part.t[::2], part.p[::2]) for part in extraction.parts]
    blocks += [(part.t, part.p) for part in extraction.still]
    for t, p in blocks:
        lines += [f"{x:.2f},{y:.2f},{1000 * s:.0f}" for s, (x, y) in zip(t, p, strict=True)]
        lines.append("BREAK")
    return "\n".join(lines) + "\n"
