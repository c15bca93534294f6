"""`Movement`: a named trajectory of the TCP; through points, from samples, from a file or from the library.

Planning, running and analysis use a movement through this class only. Reading a file checks everything and
names file and field (or line) of what is wrong; docs/movements.md describes the formats.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Literal, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from pc_client.arrays import Array, read_only, set_fields
from pc_client.errors import MovementError, UnknownMovementError
from pc_client.files import FILE_KINDS
from pc_client.movements import samples
from pc_client.movements.durations import default_durations
from pc_client.movements.library_sets import LIBRARY_SETS, library_path
from pc_client.movements.movement_file import file_text, kind_of, read_record, trajectory_of
from pc_client.movements.samples import JointTrajectory, SampledTrajectory, parse_rows
from pc_client.movements.sigma_lognormal import leg_lengths, literal_strokes
from pc_client.movements.trajectory import Motion, Similarity, Trajectory, check_duration, check_name
from pc_client.movements.uniform import SETBACK, Corners, uniform_trajectory
from ur_hil.records import nearest

#: "human": straight lognormal strokes by the paper's recipe, sigma .067, at rest at each point; "robot": a
#: smoothed square wave on the same lines.
Style = Literal["human", "robot"]

#: A table of target points without times.
_POINT_COLUMNS = ("x", "y", "z")
#: Longest duration of a stroke, s, and farthest coordinate, m, that are taken for meant.
_LONGEST_STROKE, _FARTHEST = 600.0, 10.0
#: Points nearer than this (m) are one point.
_APART = 1e-6


class MovementSample(NamedTuple):
    """Position (m) and velocity (m/s) of the TCP in the base frame, each (n, 3)."""

    p: Array
    v: Array


@dataclass(frozen=True, slots=True, eq=False)
class Movement:
    """A movement of the TCP from rest to rest; its orientation is fixed by planning unless samples give it.

    Attributes:
        name: as in tables and file names.
        trajectory: the closed form behind it.
        stroke_durations: (n_strokes,), s, one after the other from time 0: the windows of strokes that do not
            overlap, the times between the speed minima of those that do, or, where a trajectory names them,
            between its passages at the target points; their sum is the duration.
        provenance: how it was made, as short facts; written into its file.
        may_be_moved: it was made for the UR3's box; planning moves it for an arm that cannot do it there.
    """

    name: str
    trajectory: Trajectory
    stroke_durations: Array
    provenance: Mapping[str, str | int | float] = field(default_factory=lambda: MappingProxyType({}))
    may_be_moved: bool = False

    def __post_init__(self) -> None:
        durations = read_only(self.stroke_durations)
        check_name(self.name)
        check_duration(self.duration, f"movement {self.name}")
        if durations.ndim != 1 or not len(durations) or not np.all(durations > 0.0):
            raise MovementError(
                f"movement {self.name} with stroke durations {durations.tolist()} s: give times above 0 s"
            )
        if abs(math.fsum(durations) - self.duration) > 1e-6:
            raise MovementError(
                f"movement {self.name}: stroke durations add up to {math.fsum(durations):.6f} s, "
                f"but it lasts {self.duration:.6f} s; they must be equal"
            )
        set_fields(self, stroke_durations=durations, provenance=MappingProxyType(dict(self.provenance)))

    @classmethod
    def through(
        cls,
        points: ArrayLike,
        style: Style = "human",
        durations: ArrayLike | None = None,
        *,
        name: str = "through",
        corners: Corners = "stop",
        setback: float = SETBACK,
    ) -> Movement:
        """A movement that begins at the first point, rests at each of the others and ends at the last.

        The two styles of the same points and durations are twins: same lines, same stroke durations.

        Args:
            points: (n, 3) [m]; at least two, consecutive ones apart.
            style: "human", straight lognormal strokes by the paper's recipe: sigma .067, nearly symmetric, at
                rest at each point, without arcs and overlap of strokes (docs/theory.md, section 2); "robot",
                a smoothed trapezoid of speed on the same lines.
            durations: of the strokes between the points, (n - 1,) [s]; chosen from their lengths if None.
            name: as in recordings and tables.
            corners: of "robot" only: "stop" at inner points, or "blend" them.
            setback: of blended corners [m].

        Raises:
            MovementError: points, durations or options are not valid.
        """
        targets = _checked(points, "points", 2)
        if len(targets) < 2:
            raise MovementError(f"{len(targets)} target points: a movement needs at least 2")
        for index, fault in _faults(targets):
            raise MovementError(f"target point {index + 1} {fault}")
        if style not in ("human", "robot"):
            raise MovementError(f'style "{style}": give "human" or "robot"')
        if corners != "stop" and style == "human":
            raise MovementError(
                f'corners "{corners}" of a human-like movement: corners go with style "robot"'
            )
        times = default_durations(targets) if durations is None else _checked(durations, "durations", 1)
        if not np.all((times > 0.0) & (times <= _LONGEST_STROKE)):
            raise MovementError(
                f"durations {times.tolist()} s: give times above 0, at most {_LONGEST_STROKE:g} s"
            )
        human = style == "human"
        trajectory = (
            literal_strokes(targets, times) if human else uniform_trajectory(targets, times, corners, setback)
        )
        return cls(name, trajectory, times, {"generator": "pc_client.movements.own_points"})

    @classmethod
    def from_samples(
        cls, t: ArrayLike, points: ArrayLike, rotations: ArrayLike | None = None, *, name: str = "samples"
    ) -> Movement:
        """A movement given as samples; a spline interpolates them, nothing is smoothed.

        Args:
            t: (n,) increasing times [s], n >= 4.
            points: (n, 3) positions [m].
            rotations: orientation of the TCP at each sample: rotation vectors (n, 3) [rad] or quaternions
                (n, 4) x, y, z, w. None: the experiment's fixed orientation, tool forward and 45 degrees down.
            name: as in recordings and tables.

        Raises:
            MovementError: shapes or values are not valid.
        """
        turns = None if rotations is None else samples.rotations_of(rotations)
        trajectory = SampledTrajectory(
            np.asarray(t, dtype=np.float64), np.asarray(points, dtype=np.float64), turns
        )
        return cls(name, trajectory, np.array([trajectory.duration]))

    @classmethod
    def from_csv(
        cls,
        path: str | Path,
        style: Style | None = None,
        durations: ArrayLike | None = None,
        *,
        corners: Corners = "stop",
    ) -> Movement:
        """A movement from a table, by the name of its file; see docs/movements.md.

        Args:
            path: x, y, z, t, or with orientations: samples. x, y, z alone: target points.
            style: "human" or "robot": the rows are target points, t when each is reached, as those of
                `ur-client movements new`; None: samples, if they have t.
            durations: of the strokes between target points without t, (n - 1,) [s]; as of `through` if None.
            corners: of "robot" only, as of `through`.

        Raises:
            MovementError: the file cannot be read or is not valid; names the line.
        """
        path = Path(path)
        if style is None and durations is None:
            return load_movement(path)
        points, times = load_targets(path)
        if times is not None and durations is not None:
            raise MovementError(f"durations, but {path} has a column t: give only one of them")
        given = times if durations is None else durations
        return cls.through(points, style or "human", given, name=path.stem, corners=corners)

    @classmethod
    def from_toml(cls, path: str | Path) -> Movement:
        """A movement from a file of its parameters.

        Raises:
            MovementError: the file cannot be read or is not valid; names the field.
        """
        return load_movement(Path(path))

    @classmethod
    def library(cls, name: str) -> Movement:
        """A movement of the library, such as "lognorm_4_1"; `ur-client movements list` names all.

        Raises:
            MovementError: no movement has that name.
        """
        return load_movement(name)

    def __repr__(self) -> str:
        return f"<Movement {self.name!r}: {self.kind}, {self.duration:.2f} s>"

    @property
    def kind(self) -> str:
        """Which model made it, as its file says it; "samples" are given."""
        return kind_of(self.trajectory)

    @property
    def text(self) -> str:
        """Its TOML file, complete and readable; empty for one made of samples."""
        if isinstance(self.trajectory, SampledTrajectory):
            return ""
        return file_text(self.name, self.trajectory, self.stroke_durations, self.provenance)

    @property
    def duration(self) -> float:
        """Total time, s; the movement begins at 0."""
        return self.trajectory.duration

    @property
    def target_points(self) -> Array:
        """Target points, (n, 3), m. Inner ones of a human-like movement are aimed at, not reached."""
        return self.trajectory.target_points

    @property
    def knots(self) -> Array:
        """Times that a plan does not miss, (n,), s: those of all samples, or both ends of a closed form."""
        if isinstance(self.trajectory, SampledTrajectory):
            return self.trajectory.t
        return np.array((0.0, self.duration))

    def motion(self, t: ArrayLike) -> Motion:
        """Position, velocity and acceleration at the times t, s; each (n, 3).

        Before 0 and after `duration` the TCP rests at the start and the end.
        """
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        if not np.all(np.isfinite(times)):
            raise MovementError(f"movement {self.name} sampled at a time that is not finite")
        motion = self.trajectory.evaluate(np.clip(times, 0.0, self.duration))
        moving = ((times >= 0.0) & (times <= self.duration))[:, None]
        return Motion(motion.p, np.where(moving, motion.v, 0.0), np.where(moving, motion.a, 0.0))

    def sample(self, t: ArrayLike) -> MovementSample:
        """Position (m) and velocity (m/s) at the times t, s, a number or (n,); each (n, 3).

        Before 0 and after `duration` the TCP rests at the start and the end.
        """
        motion = self.motion(t)
        return MovementSample(motion.p, motion.v)

    def rotations(self, t: ArrayLike) -> Array | None:
        """R_base_tcp at the times t, s, (n, 3, 3); None: the TCP keeps the one that planning fixes."""
        if not isinstance(self.trajectory, SampledTrajectory):
            return None
        return self.trajectory.rotations(np.clip(t, 0.0, self.duration))

    def speed(self, t: ArrayLike) -> Array:
        """Speed of the TCP at the times t, m/s, (n,)."""
        velocity = self.motion(t).v
        speed: Array = np.linalg.norm(velocity, axis=1)
        return speed

    def transformed(self, similarity: Similarity) -> Self:
        """Moved, scaled and rotated; the time is untouched, so the shape of the speed is too."""
        return replace(self, trajectory=self.trajectory.transformed(similarity))

    def stretched(self, factor: float) -> Self:
        """`factor` times as slow on the same path (the theory's own scaling of time): speeds / factor."""
        if not (math.isfinite(factor) and factor > 0.0):
            raise MovementError(f"time stretch of {factor}: give a number greater than 0")
        return replace(
            self,
            trajectory=self.trajectory.stretched(factor),
            stroke_durations=self.stroke_durations * factor,
        )

    def renamed(self, name: str) -> Self:
        """The same movement under another name."""
        return replace(self, name=name)

    def save(self, path: str | Path) -> None:
        """Write a movement file: .toml for a closed form, .csv for samples.

        Raises:
            MovementError: wrong suffix for the kind of movement, or the file cannot be written.
        """
        path = Path(path)
        wanted = ".csv" if isinstance(self.trajectory, SampledTrajectory) else ".toml"
        if path.suffix.lower() != wanted:
            raise MovementError(f"{path}: a movement of kind {self.kind} is saved as a {wanted} file")
        try:
            if isinstance(self.trajectory, SampledTrajectory):
                samples.write_samples(path, self.trajectory)
            else:
                path.write_text(self.text, encoding="utf-8")
        except OSError as error:
            raise MovementError(
                f"{path}: cannot be written ({error.strerror or error}); give a place that can be"
            ) from error


def load_movement(name_or_path: str | Path) -> Movement:
    """A movement of the library by its name, or one from a .toml or .csv file by its path.

    Args:
        name_or_path: "lognorm_4_1" (set "paper"), "arcs/lognorm_4_1" (set "arcs"), "mine.toml".

    Raises:
        MovementError: unknown name, unreachable file, or content that makes no sense, naming file and field
            or line.
    """
    motion = load_motion(name_or_path)
    if isinstance(motion, JointTrajectory):
        raise MovementError(f"{name_or_path} holds joint angles; give a movement of the TCP here")
    return motion


def load_motion(name_or_path: str | Path) -> Movement | JointTrajectory:
    """What an arm can be sent along: as `load_movement`, or a .csv file of joint angles."""
    found = library_path(name_or_path) if isinstance(name_or_path, str) else None
    if found:
        movement = _read(found)
        return replace(movement, may_be_moved=True) if isinstance(movement, Movement) else movement
    path = Path(name_or_path)
    if not path.suffix and not path.exists():
        known = [name for names in LIBRARY_SETS.values() for name in names]
        raise UnknownMovementError(
            f'no movement "{name_or_path}": {nearest(str(name_or_path), known)}; '
            "give one of the library, or the path of a .toml or .csv file"
        )
    return _read(path)


def load_targets(path: str | Path) -> tuple[Array, Array | None]:
    """Target points from a text file: columns x, y, z in m, base frame; and optionally t in s.

    t is when a point is reached; the times between are the durations of the strokes. The form is that of
    `samples`.

    Raises:
        MovementError: unreachable file, or content that makes no sense, naming file and line.
    """
    rows = parse_rows(
        FILE_KINDS["samples"].read_text(Path(path)),
        str(path),
        [_POINT_COLUMNS, (*_POINT_COLUMNS, "t")],
        "x, y, z in m, and optionally t in s",
    )
    if len(rows.values) < 2:
        raise MovementError(f"{path}: {len(rows.values)} target points; a movement needs at least 2")
    points = rows.values[:, :3]
    for index, fault in _faults(points):
        raise MovementError(f"{path}, line {rows.lines[index]}: target point {index + 1} {fault}")
    return points, np.diff(rows.values[:, 3]) if "t" in rows.columns else None


def _read(path: Path) -> Movement | JointTrajectory:
    suffix = path.suffix.lower()
    if suffix not in (".toml", ".csv"):
        raise MovementError(f"{path}: movement files are .toml (parameters) or .csv (samples)")
    if suffix == ".csv":
        return _parse_samples(FILE_KINDS["samples"].read_text(path), path)
    file = read_record(FILE_KINDS["movement"].read_toml(path), str(path))
    try:
        return Movement(file.name, *trajectory_of(file), file.provenance)
    except MovementError as error:
        raise MovementError(f"{path}: {error}") from error


def _parse_samples(text: str, path: Path) -> Movement | JointTrajectory:
    """What a table of samples or target points holds; without a line of names, x, y, z and perhaps t."""
    wanted = "x, y, z in m and t in s, target points x, y, z, or what docs/movements.md names beside them"
    rows = parse_rows(text, str(path), (*samples.FORMS, samples.JOINT_COLUMNS, _POINT_COLUMNS), wanted)
    if rows.columns != _POINT_COLUMNS and len(rows.values) < samples.MIN_SAMPLES:
        raise MovementError(
            f"{path}: {len(rows.values)} samples; a movement needs at least {samples.MIN_SAMPLES} "
            "(target points with times: `ur-client movements new`, or Movement.from_csv with a style)"
        )
    try:
        if rows.columns == _POINT_COLUMNS:
            return Movement.through(rows.values, name=path.stem)
        if rows.columns == samples.JOINT_COLUMNS:
            return JointTrajectory(rows.values[:, 0], rows.values[:, 1:], path.stem)
        trajectory = samples.samples_of(rows)
        return Movement(path.stem, trajectory, np.array([trajectory.duration]), {"file": path.name})
    except MovementError as error:
        raise MovementError(f"{path}: {error}") from error


def _faults(points: Array) -> Iterator[tuple[int, str]]:
    """Which points (n, 3), m, are wrong, and why."""
    for index in np.flatnonzero(np.abs(points).max(axis=1) > _FARTHEST).tolist():
        yield index, f"is {points[index].tolist()} m: that is beyond any arm; give metres, robot base frame"
    for index in np.flatnonzero(leg_lengths(points) < _APART).tolist():
        yield index + 1, f"is the same as target point {index + 1}: consecutive ones must be apart"


def _checked(values: ArrayLike, what: str, dimensions: Literal[1, 2]) -> Array:
    """Finite numbers (n,) or (n, 3), or an error that says what is needed."""
    wanted = "a list of [x, y, z] in m" if dimensions == 2 else "a list of times in s, one a stroke"
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise MovementError(f"{what} that are not a table of numbers: give {wanted}") from error
    if array.ndim != dimensions or (dimensions == 2 and array.shape[1] != 3):
        raise MovementError(f"{what} of shape {array.shape}: give {wanted}")
    bad = [value for value in array.ravel().tolist() if not math.isfinite(value)]
    if bad:
        raise MovementError(f"{what} with {bad[0]}: give finite numbers, {wanted}")
    return read_only(array)
