"""A movement through one's own target points, human-like or robot-like, in one's own time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pc_client.errors import MovementError
from pc_client.files import FILE_KINDS
from pc_client.movements.columns import parse_rows
from pc_client.movements.durations import Isochrony, leg_lengths
from pc_client.movements.geometry import read_only
from pc_client.movements.lognormal import LiteralTiming
from pc_client.movements.movement import Movement
from pc_client.movements.recipes import HAND, LEAD, TOP_SPEED, literal_strokes
from pc_client.movements.robotic import Corners
from pc_client.movements.twins import SETBACK, robotic_trajectory

__all__ = ["POINT_COLUMNS", "Style", "TargetTable", "default_durations", "load_targets", "through"]

#: "human": straight strokes by the paper's recipe; "robot": a smoothed square wave on the same lines.
Style = Literal["human", "robot"]

#: A table of target points without times.
POINT_COLUMNS = ("x", "y", "z")
#: Least default duration of a stroke, s: very short strokes would need more acceleration than speed.
_SHORTEST = 1.0
#: Longest duration of a stroke, s, and farthest coordinate, m, that are taken for meant.
_LONGEST, _FARTHEST = 600.0, 10.0
#: Points nearer than this (m) are one point.
_APART = 1e-6


class TargetTable(NamedTuple):
    """Target points (n, 3), m, and, where their table has a column t, the durations (n - 1,), s, between."""

    points: NDArray[np.float64]
    durations: NDArray[np.float64] | None


def through(
    points: ArrayLike,
    style: Style = "human",
    durations: ArrayLike | None = None,
    *,
    name: str = "through",
    corners: Corners = "stop",
    setback: float = SETBACK,
) -> Movement:
    """A movement that begins at the first point, comes to rest at each of the others, and ends at the last.

    The two styles of the same points and durations are twins: same lines, same stroke durations.

    Args:
        points: (n, 3), m, robot base frame; at least two, consecutive ones apart.
        style: human-like or robot-like.
        durations: of the strokes between the points, (n - 1,), s; `default_durations` if None.
        name: as in recordings and tables.
        corners: robot-like only: come to rest at inner points, or blend them.
        setback: of blended corners, m.

    Returns:
        The movement. Planning checks whether an arm can execute it.

    Raises:
        MovementError: saying what is wrong with the points, durations or choices.
    """
    targets = _checked(points, "points", (-1, 3))
    if len(targets) < 2:
        raise MovementError(f"{len(targets)} target points: a movement needs at least 2")
    for index, fault in _faults(targets):
        raise MovementError(f"target point {index + 1} {fault}")
    if style not in ("human", "robot"):
        raise MovementError(f'style "{style}": give "human" or "robot"')
    if corners != "stop" and style == "human":
        raise MovementError(f'corners "{corners}" of a human-like movement: corners go with style "robot"')
    times = default_durations(targets) if durations is None else _checked(durations, "durations", (-1,))
    if not np.all((times > 0.0) & (times <= _LONGEST)):
        raise MovementError(f"durations {times.tolist()} s: give times above 0, at most {_LONGEST:g} s")
    human = style == "human"
    trajectory = (
        literal_strokes(targets, times) if human else robotic_trajectory(targets, times, corners, setback)
    )
    return Movement(name, trajectory, times, {"generator": "pc_client.movements.own_points"})


def default_durations(points: ArrayLike) -> NDArray[np.float64]:
    """How long the strokes between points (n, 3), m, last by themselves, (n - 1,), s.

    In the proportions of the recipe (length to the power .3), as quick as its top speed allows the human-like
    movement, but at least 1 s each; in whole milliseconds.
    """
    legs = leg_lengths(points)
    proportions = Isochrony(HAND.isochrony).durations(legs)
    speeds = LiteralTiming(0.0, 1.0, LEAD).lognormal.peak * legs / proportions
    durations = np.ceil(1e3 * proportions * float(speeds.max()) / TOP_SPEED) / 1e3
    longest: NDArray[np.float64] = np.maximum(durations, _SHORTEST)
    return longest


def load_targets(path: str | Path) -> TargetTable:
    """Target points from a text file: columns x, y, z in m, base frame; and optionally t in s.

    t is when a point is reached; the times between are the durations of the strokes. The form is that of
    `columns`.

    Raises:
        MovementError: unreachable file, or content that makes no sense, naming file and line.
    """
    rows = parse_rows(
        FILE_KINDS["samples"].read_text(Path(path)),
        str(path),
        [POINT_COLUMNS, (*POINT_COLUMNS, "t")],
        "x, y, z in m, and optionally t in s",
    )
    if len(rows.values) < 2:
        raise MovementError(f"{path}: {len(rows.values)} target points; a movement needs at least 2")
    points = rows.values[:, :3]
    for index, fault in _faults(points):
        raise MovementError(f"{path}, line {rows.lines[index]}: target point {index + 1} {fault}")
    return TargetTable(points, np.diff(rows.values[:, 3]) if "t" in rows.columns else None)


def _faults(points: NDArray[np.float64]) -> Iterator[tuple[int, str]]:
    """What is wrong with points (n, 3), m: which of them, and what."""
    for index in np.flatnonzero(np.abs(points).max(axis=1) > _FARTHEST).tolist():
        yield index, f"is {points[index].tolist()} m: that is beyond any arm; give metres, robot base frame"
    for index in np.flatnonzero(leg_lengths(points) < _APART).tolist():
        yield index + 1, f"is the same as target point {index + 1}: consecutive ones must be apart"


def _checked(values: ArrayLike, what: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Finite numbers in a shape, or an error that says what is needed."""
    wanted = "a list of [x, y, z] in m" if len(shape) == 2 else "a list of times in s, one a stroke"
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise MovementError(f"{what} that are not a table of numbers: give {wanted}") from error
    if array.ndim != len(shape) or (len(shape) == 2 and array.shape[1] != shape[1]):
        raise MovementError(f"{what} of shape {array.shape}: give {wanted}")
    bad = [value for value in array.ravel().tolist() if not math.isfinite(value)]
    if bad:
        raise MovementError(f"{what} with {bad[0]}: give finite numbers, {wanted}")
    return read_only(array)
