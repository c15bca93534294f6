"""A movement given as samples of position, of pose, or of joint angles over time; tables of them.

Samples are taken as they are: nothing is smoothed and nothing is resampled here. Positions get a natural
cubic spline, orientations scipy's rotation spline, which has a continuous angular acceleration.

A table has one row a line; columns are separated by commas, semicolons, tabs or blanks. A first line of their
names may give another order. Empty lines and lines that begin with # are skipped.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from pc_client.arrays import Array, read_only, set_fields
from pc_client.errors import MovementError
from pc_client.movements.trajectory import Motion, Similarity, check_duration, check_name

#: Fewest samples of a movement: a cubic has four coefficients.
MIN_SAMPLES = 4

#: No joint of a UR arm turns faster than 2 pi rad/s; three wrists together stay below this, rad/s.
_FASTEST_TURN = 20.0

#: How far from 1 the length of a quaternion may be: three digits in a file.
_QUATERNION_TOLERANCE = 2e-3

_COLUMNS = ("x", "y", "z", "t")
_VECTOR, _QUATERNION = ("rx", "ry", "rz"), ("qx", "qy", "qz", "qw")

#: What the columns of a file may be: position in m; with it a rotation vector in rad, as UR writes poses,
#: or a unit quaternion, as ROS does.
FORMS = (_COLUMNS, ("x", "y", "z", *_VECTOR, "t"), ("x", "y", "z", *_QUATERNION, "t"))


@dataclass(frozen=True, slots=True, eq=False)
class SampledTrajectory:
    """The natural cubic spline through samples.

    Attributes:
        t: times, (n,), s, increasing; shifted so that the first is 0.
        points: (n, 3), m.
        orientations: of the TCP in the base frame, n of them; None: the fixed one of planning.
    """

    t: Array
    points: Array
    orientations: Rotation | None = None
    _spline: CubicSpline = field(init=False, repr=False, compare=False)
    _rotations: RotationSpline | None = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        t, points = _checked(self.t, self.points, 3, "points of x, y, z in m")
        turns = self.orientations
        if turns is not None and (turns.single or len(turns) != len(t)):
            raise MovementError(f"orientations for {len(t)} samples: give one for each")
        if turns is not None:
            _check_turning(t, turns)
        try:
            with np.errstate(over="raise", divide="raise", invalid="raise"):
                spline = CubicSpline(t, points, bc_type="natural")
                rotations = None if turns is None else RotationSpline(t, turns)
                between = t[:-1, None] + np.diff(t)[:, None] * [0.0, 0.5, 1.0]
                values = [spline.c] if rotations is None else [spline.c, rotations(between.ravel()).as_quat()]
                is_finite = all(np.isfinite(value).all() for value in values)
        except (ValueError, FloatingPointError):
            is_finite = False
        if not is_finite:
            raise MovementError(
                f"samples up to {np.abs(points).max():g} away with times from {np.diff(t).min():g} s apart: "
                "the speed between them is no number; give metres and seconds"
            )
        set_fields(self, t=t, points=points, _spline=spline, _rotations=rotations)

    @property
    def duration(self) -> float:
        """Time of the last sample, s."""
        return float(self.t[-1])

    @property
    def target_points(self) -> Array:
        """Samples name no targets: the first and the last point, (2, 3), m."""
        return read_only(self.points[[0, -1]])

    def evaluate(self, t: ArrayLike) -> Motion:
        """Position, velocity and acceleration at the times t (n,), s; each (n, 3)."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        return Motion(self._spline(times), self._spline(times, 1), self._spline(times, 2))

    def rotations(self, t: ArrayLike) -> Array | None:
        """R_base_tcp at the times t (n,), s, (n, 3, 3); None without orientations."""
        if self._rotations is None:
            return None
        return np.asarray(self._rotations(np.atleast_1d(t)).as_matrix(), dtype=np.float64)

    def transformed(self, similarity: Similarity) -> SampledTrajectory:
        """Moved, scaled and rotated."""
        turns = self.orientations
        rotated = None if turns is None else Rotation.from_matrix(similarity.R) * turns
        return SampledTrajectory(self.t, similarity.points(self.points), rotated)

    def stretched(self, factor: float) -> SampledTrajectory:
        """`factor` times as slow."""
        return SampledTrajectory(self.t * factor, self.points, self.orientations)


#: Columns of a file; angles in rad, base to wrist 3.
JOINT_COLUMNS = ("t", "q0", "q1", "q2", "q3", "q4", "q5")


@dataclass(frozen=True, slots=True, eq=False)
class JointTrajectory:
    """Joint angles over time, from rest to rest.

    Attributes:
        t: (n,) times [s], increasing; shifted so that the first is 0.
        q: (n, 6) joint angles [rad], base to wrist 3.
        name: as in tables and file names.

    Raises:
        MovementError: shapes, times or values make no sense, or there are fewer than 4 samples.
    """

    t: Array
    q: Array
    name: str = "joints"

    def __post_init__(self) -> None:
        check_name(self.name)
        try:
            t, q = _checked(self.t, self.q, 6, "rows of six angles in rad")
        except MovementError as error:
            raise MovementError(f"{self.name}: {error}") from None
        set_fields(self, t=t, q=q)
        check_duration(self.duration, self.name)

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self.t[-1])


def _checked(t: Array, rows: Array, width: int, what: str) -> tuple[Array, Array]:
    """Times that begin at 0, and what is given for each; MovementError if they make no sense."""
    t, rows = read_only(t), read_only(rows)
    if t.ndim != 1 or rows.shape != (len(t), width):
        raise MovementError(f"samples with t {t.shape} and values {rows.shape}: give n times and n {what}")
    if len(t) < MIN_SAMPLES:
        raise MovementError(f"{len(t)} samples: a movement needs at least {MIN_SAMPLES}")
    for index, row in enumerate(np.column_stack((t, rows)).tolist()):
        if not all(map(math.isfinite, row)):
            raise MovementError(f"sample {index} is not finite, t and values {row}: give finite numbers")
    stalled = np.flatnonzero(np.diff(t) <= 0.0)
    if len(stalled):
        index = int(stalled[0]) + 1
        raise MovementError(
            f"sample {index} is at t = {t[index]} s after {t[index - 1]} s: times must increase"
        )
    return read_only(t - t[0]), rows


def _check_turning(t: Array, turns: Rotation) -> None:
    """Refuse orientations that no wrist follows; through them there is no spline either."""
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        speed = (turns[:-1].inv() * turns[1:]).magnitude() / np.diff(t)
    if not (speed <= _FASTEST_TURN).all():
        k = int(np.argmax(~(speed <= _FASTEST_TURN)))
        raise MovementError(
            f"the orientation turns at {speed[k]:.3g} rad/s from sample {k} to {k + 1}: give samples that "
            f"turn at {_FASTEST_TURN:g} rad/s at most"
        )


def rotations_of(values: ArrayLike) -> Rotation:
    """Orientations from rotation vectors (n, 3), rad, or quaternions (n, 4), x, y, z, w.

    Raises:
        MovementError: another shape, a value that is not finite, or a quaternion that is not of length 1.
    """
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] not in (3, 4):
        raise MovementError(
            f"orientations of shape {array.shape}: give (n, 3) rotation vectors in rad, or (n, 4) "
            "quaternions x, y, z, w"
        )
    if not np.isfinite(array).all():
        raise MovementError("orientations with numbers that are not finite: give finite ones")
    if array.shape[1] == 3:
        return Rotation.from_rotvec(array)
    odd = np.flatnonzero(np.abs(np.linalg.norm(array, axis=1) - 1.0) > _QUATERNION_TOLERANCE)
    if len(odd):
        raise MovementError(f"quaternion {array[odd[0]].tolist()} of sample {odd[0]}: give one of length 1")
    return Rotation.from_quat(array)


_SEPARATOR = re.compile(r"\s*[,;\t]\s*|\s+")


class Rows(NamedTuple):
    """A table: values (n, m) in the order of `columns`, and the line (n,) of each row."""

    columns: tuple[str, ...]
    values: Array
    lines: tuple[int, ...]


def parse_rows(text: str, source: str, forms: Sequence[tuple[str, ...]], wanted: str) -> Rows:
    """Rows of finite numbers; a column t must increase.

    Args:
        forms: the columns that the table may have; without a first line of names, the only one with as many
            columns.
        wanted: what the columns are, for messages.

    Raises:
        MovementError: naming the line.
    """
    columns: tuple[str, ...] = ()
    order: list[int] = []
    rows: list[list[float]] = []
    lines: list[int] = []
    for number, line in enumerate(text.splitlines(), start=1):
        cells = line.strip().lstrip("\ufeff")
        if not cells or cells.startswith("#"):
            continue
        fields = _SEPARATOR.split(cells)
        if not columns:
            names = [name.strip('"').lower() for name in fields]
            header = next((form for form in forms if sorted(names) == sorted(form)), None)
            fitting = [form for form in forms if len(form) == len(fields)]
            if not header and len(fitting) > 1:
                raise MovementError(
                    f"{source}, line {number}: {len(fields)} columns without names may be "
                    f"{' or '.join(', '.join(form) for form in fitting)}; name them in the first line"
                )
            columns = header or next(iter(fitting), ())
            order = [names.index(name) for name in columns] if header else list(range(len(columns)))
            if header:
                continue
        if not columns or len(fields) != len(columns):
            raise MovementError(f"{source}, line {number}: {len(fields)} columns; give {wanted}")
        row = [
            _parse_number(fields[place], source, number, name)
            for place, name in zip(order, columns, strict=True)
        ]
        at = columns.index("t") if "t" in columns else None
        if at is not None and rows and row[at] <= rows[-1][at]:
            raise MovementError(
                f"{source}, line {number}: t = {row[at]:g} s after t = {rows[-1][at]:g} s in line "
                f"{lines[-1]}; times must increase"
            )
        rows.append(row)
        lines.append(number)
    return Rows(columns, np.array(rows, dtype=np.float64).reshape(len(rows), len(columns)), tuple(lines))


def _parse_number(text: str, source: str, line: int, column: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise MovementError(f'{source}, line {line}: {column} is "{text}"; give a finite number')
    return value


def samples_of(rows: Rows) -> SampledTrajectory:
    """The movement that a table in one of `FORMS` holds; MovementError if it makes no sense."""
    columns = rows.columns
    values = {name: rows.values[:, k] for k, name in enumerate(columns)}
    turn = next((names for names in (_VECTOR, _QUATERNION) if names[0] in columns), ())
    return SampledTrajectory(
        values["t"],
        np.column_stack([values[name] for name in ("x", "y", "z")]),
        rotations_of(np.column_stack([values[name] for name in turn])) if turn else None,
    )


def write_samples(path: Path, trajectory: SampledTrajectory) -> None:
    """Write samples as CSV, to the last digit; orientations as rotation vectors."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    turns = trajectory.orientations
    writer.writerow(FORMS[0] if turns is None else FORMS[1])
    poses = trajectory.points if turns is None else np.hstack((trajectory.points, turns.as_rotvec()))
    writer.writerows([*pose, time] for pose, time in zip(poses.tolist(), trajectory.t.tolist(), strict=True))
    path.write_text(text.getvalue(), encoding="utf-8")
