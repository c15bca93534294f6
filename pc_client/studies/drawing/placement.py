"""The marks of a drawing, and where in the workspace they are done: a sheet, an angle and a scale.

A mark is a part of the recording, what the pen left between coming down and going up. Its strokes are taken
whole: where the part begins in full motion they begin before the pen is down, and where it ends so they end
after the pen is up.

The sheet stands before the robot as a board before a person who looks in the same direction: right of the
drawing is -y of the base frame. A recording's own axes are x to the right and y down the sheet, as pixels are
counted, or up, as everywhere else; its third axis then points into the sheet, or out of it, so that the map
is a proper rotation and no drawing is mirrored. Pixels are never below 0: where a y is, y is taken to point
up (Omniglot writes the rows of its screen as 0, -1, -2 ...). A pen goes up against the direction into the
sheet.

Recordings in space keep their axes: x, y, z are those of the base frame, and the pen goes up along +z.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.optimize import bisect

from pc_client.arrays import Array, read_only
from pc_client.errors import MovementError
from pc_client.kinematics.arms import UR3_BOX, Box
from pc_client.movements.recipes import largest_scale
from pc_client.movements.sigma_lognormal import SigmaLognormal
from pc_client.movements.trajectory import Similarity, about_z
from pc_client.studies.extraction.extract import Extraction

#: Deviation at which a speed profile is over for every purpose: 1e-9 of its length is left.
_OVER = 6.0
#: Accuracy of times of tails, s.
_TIME_ACCURACY = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Mark:
    """One part of a drawing.

    Attributes:
        begin: when the pen comes down, s.
        end: when it goes up, s; of a dot maybe the same time.
        first: where the strokes begin, (3,): a virtual point; of a dot the dot.
        last: where they end, (3,), likewise.
        trajectory: the strokes on the same time axis, or None for a dot.
    """

    begin: float
    end: float
    first: Array
    last: Array
    trajectory: SigmaLognormal | None

    def transformed(self, similarity: Similarity) -> Mark:
        """Moved, scaled and rotated; the time is untouched."""
        first, last = similarity.points(np.vstack((self.first, self.last)))
        trajectory = None if self.trajectory is None else self.trajectory.transformed(similarity)
        return Mark(self.begin, self.end, read_only(first), read_only(last), trajectory)

    def length_outside(self, time: float, *, before: bool) -> float:
        """Path length done `time` s before the pen comes down, or still to do `time` s after it went up."""
        if self.trajectory is None:
            return 0.0
        t = self.begin - time if before else self.end + time
        shares = (float(stroke.timing.lognormal.evaluate(t).done) for stroke in self.trajectory.strokes)
        return math.fsum(
            length * (share if before else 1.0 - share)
            for length, share in zip(self.trajectory.lengths.tolist(), shares, strict=True)
        )

    def lead(self, tolerance: float) -> float:
        """How long (s) before the pen comes down the strokes have done no more than a path length."""
        return self._tail(tolerance, before=True)

    def lag(self, tolerance: float) -> float:
        """How long (s) after the pen went up the strokes have no more than a path length to do."""
        return self._tail(tolerance, before=False)

    def _tail(self, tolerance: float, *, before: bool) -> float:
        def too_much(time: float) -> float:
            return self.length_outside(time, before=before) - tolerance

        if self.trajectory is None or too_much(0.0) <= 0.0:
            return 0.0
        lognormals = [stroke.timing.lognormal for stroke in self.trajectory.strokes]
        if before:
            most = self.begin - min(lognormal.time_at_deviation(-_OVER) for lognormal in lognormals)
        else:
            most = max(lognormal.time_at_deviation(_OVER) for lognormal in lognormals) - self.end
        return most if too_much(most) > 0.0 else float(bisect(too_much, 0.0, most, xtol=_TIME_ACCURACY))

    def path(self, tolerance: float, n: int = 801) -> Array:
        """The whole path of the strokes, up to a path length at both ends, and its end points; (m, 3)."""
        ends = np.vstack((self.first, self.last))
        if self.trajectory is None:
            return ends
        t = np.linspace(self.begin - self.lead(tolerance), self.end + self.lag(tolerance), n)
        return np.vstack((ends, self.trajectory.evaluate(t).p))


def marks_of(extraction: Extraction) -> tuple[Mark, ...]:
    """The marks of a drawing in order of time, in the recording's frame, unit and time.

    Raises:
        MovementError: nothing in it moves.
    """
    if not extraction.parts:
        raise MovementError(
            f"{extraction.name}: holds no movement, only dots; give a drawing with a line in it"
        )
    marks = []
    for part in extraction.parts:
        points = part.trajectory.target_points
        marks.append(Mark(float(part.t[0]), float(part.t[-1]), points[0], points[-1], part.trajectory))
    for still in extraction.still:
        dot = np.zeros(3)
        dot[: still.p.shape[1]] = still.p.mean(axis=0)
        marks.append(Mark(float(still.t[0]), float(still.t[-1]), read_only(dot), read_only(dot), None))
    return tuple(sorted(marks, key=lambda mark: mark.begin))


_HALF = math.sqrt(0.5)
_RIGHT = (0.0, -1.0, 0.0)

#: Direction into the sheet, base frame: a board in front, a table below, a desk square to the tool.
PLANES: Mapping[str, tuple[float, float, float]] = MappingProxyType(
    {"vertical": (1.0, 0.0, 0.0), "horizontal": (0.0, 0.0, -1.0), "inclined": (_HALF, 0.0, -_HALF)}
)

#: Tails of strokes shorter than this share of the drawing's size are not looked at when it is placed.
_PATH_SHARE = 1e-4


@dataclass(frozen=True, slots=True)
class PlacementOptions:
    """What is asked of a placement.

    Attributes:
        plane: a key of `PLANES`; only for flat recordings.
        y_up: whether the recording's y axis points up the sheet; None: when one of its y is below 0.
        rotation: turn of the drawing on its sheet, rad, positive to the left as it is looked at; None: the
            half degree that allows the largest scale.
        size: longest side of what the pen draws, m; None or too much: as large as the box allows.
        lift: how far the pen is lifted, m.
        box: where the whole path must lie, base frame.
    """

    plane: str = "vertical"
    y_up: bool | None = None
    rotation: float | None = 0.0
    size: float | None = 0.1
    lift: float = 0.03
    box: Box = UR3_BOX

    def __post_init__(self) -> None:
        if self.plane not in PLANES:
            raise MovementError(f'plane "{self.plane}": give one of {", ".join(PLANES)}')
        if not (math.isfinite(self.lift) and 0.0 < self.lift < float(self.box.size.min())):
            raise MovementError(
                f"lift of {1e3 * self.lift:g} mm: give more than 0 and less than the "
                f"{1e3 * float(self.box.size.min()):g} mm of the box"
            )
        if self.size is not None and not (math.isfinite(self.size) and self.size > 0.0):
            raise MovementError(f"size of {1e3 * self.size:g} mm: give more than 0")
        if self.rotation is not None and not math.isfinite(self.rotation):
            raise MovementError(f"rotation of {self.rotation} rad: give a finite angle")


@dataclass(frozen=True, slots=True)
class Placement:
    """Where a drawing is done.

    Attributes:
        similarity: from the recording's frame (third axis 0 for flat ones) to the base frame, m.
        lift: from the sheet to the lifted pen, (3,), m, base frame.
        rotation: turn on the sheet, rad.
        plane: a key of `PLANES`, or "space".
    """

    similarity: Similarity
    lift: Array
    rotation: float
    plane: str
    y_up: bool


def sheet_frame(plane: str, *, y_up: bool) -> Array:
    """The axes of a flat recording in the base frame: columns x (right), y and x cross y; (3, 3)."""
    into = np.array(PLANES[plane])
    down = np.cross(into, _RIGHT)
    return np.column_stack((_RIGHT, -down, -into) if y_up else (_RIGHT, down, into))


def place(marks: Sequence[Mark], drawn: Array, options: PlacementOptions, *, flat: bool = True) -> Placement:
    """Find the similarity of a drawing.

    Args:
        marks: in the recording's frame; their whole path must lie in the box.
        drawn: (n, 3), what the pen draws in the same frame: it has the size that is asked for.

    Raises:
        MovementError: all of the drawing is one point.
    """
    extent = float(np.ptp(drawn, axis=0).max())
    if not extent > 0.0:
        raise MovementError("a drawing of one point has no size: there is nothing to fit into a box")
    y_up = bool(drawn[:, 1].min() < 0.0) if options.y_up is None else options.y_up
    frame = sheet_frame(options.plane, y_up=y_up) if flat else np.eye(3)
    out = -np.array(PLANES[options.plane]) if flat else np.array((0.0, 0.0, 1.0))
    lift = options.lift * out
    path = np.vstack([mark.path(_PATH_SHARE * extent) for mark in marks])
    # Seen from the side that the pen is on, the recording's third axis points away where y points down.
    sense = 1.0 if y_up or not flat else -1.0
    half_degrees = [math.radians(0.5 * step) for step in range(360)]
    angles = half_degrees if options.rotation is None else [options.rotation]
    rotations = [frame @ about_z(sense * angle) for angle in angles]
    scales = [largest_scale(path @ R.T, options.box.size - np.abs(lift)) for R in rotations]
    best = int(np.argmax(scales))
    R = rotations[best]
    scale = scales[best] if options.size is None else min(scales[best], options.size / extent)
    turned = scale * path @ R.T
    low = turned.min(axis=0) + np.minimum(lift, 0.0)
    high = turned.max(axis=0) + np.maximum(lift, 0.0)
    similarity = Similarity(scale, R, options.box.centre - 0.5 * (low + high))
    return Placement(similarity, read_only(lift), angles[best], options.plane if flat else "space", y_up)


def inverse(similarity: Similarity) -> Similarity:
    """The similarity that undoes another."""
    back = similarity.R.T
    return Similarity(1.0 / similarity.scale, back, -(back @ similarity.shift) / similarity.scale)
