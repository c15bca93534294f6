"""Movement files: TOML for movements in closed form, CSV for samples; and the library, two sets of ten.

The format is described in `docs/movements.md`. Reading checks everything and names file and field (or line)
of what is wrong.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType

import numpy as np

from pc_client.errors import MovementError
from pc_client.input_files import FILE_KINDS
from pc_client.movements.columns import parse_rows
from pc_client.movements.joint_trajectory import JOINT_COLUMNS, JointTrajectory
from pc_client.movements.movement import Movement, check_duration, check_name
from pc_client.movements.samples import FORMS, MIN_SAMPLES, SampledTrajectory, samples_of, write_samples
from pc_client.movements.trajectory_tables import (
    KIND_WORDS,
    TRAJECTORY_FIELDS,
    parse_trajectory,
    trajectory_lines,
)
from pc_client.toml_tables import TableReader, toml_value

__all__ = [
    "DEFAULT_SET",
    "LIBRARY_FOLDER",
    "LIBRARY_SETS",
    "library_names",
    "library_path",
    "load_motion",
    "load_movement",
    "movement_text",
    "save_movement",
]

LIBRARY_FOLDER = Path(__file__).parent / "library"
#: The ten movements of the paper's Table I, in its order.
_TEN = tuple(
    f"{kind}_{number}" for kind in ("uniform", "lognorm") for number in ("4_1", "4_2", "5_1", "5_2", "5_3")
)
#: The set that is run when none is named; its movements go by their bare names.
DEFAULT_SET = "paper"
#: Every named set of the library: what `load_movement` takes for its movements, in the order of Table I.
LIBRARY_SETS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {DEFAULT_SET: _TEN, "arcs": tuple(f"arcs/{name}" for name in _TEN)}
)

MOST_POINTS = 1000
"""Most target points of a file: a page of handwriting has some 500."""

_FORMAT = 1
_FIELDS = f"format, name, kind, duration, stroke_durations, target_points, provenance, {TRAJECTORY_FIELDS}"


def library_names(set_name: str = DEFAULT_SET) -> list[str]:
    """What `load_movement` takes for the movements of a set, in the order of Table I.

    Args:
        set_name: "paper", the ten by the paper's own recipe; "arcs", ten of arcs that overlap in time.

    Raises:
        MovementError: there is no such set.
    """
    if set_name not in LIBRARY_SETS:
        raise MovementError(f'no set of movements "{set_name}": give one of {", ".join(LIBRARY_SETS)}')
    return list(LIBRARY_SETS[set_name])


def library_path(name: str) -> Path | None:
    """The file of a movement of the library, or None if there is none of that name."""
    if not any(name in names for names in LIBRARY_SETS.values()):
        return None
    return LIBRARY_FOLDER / (f"{name}.toml" if "/" in name else f"{DEFAULT_SET}/{name}.toml")


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
    """What an arm can be sent along: as `load_movement`, or a .csv file of joint angles.

    Raises:
        MovementError: as `load_movement`.
    """
    found = library_path(name_or_path) if isinstance(name_or_path, str) else None
    if found:
        return _read(found)
    path = Path(name_or_path)
    if not path.suffix and not path.exists():
        known = [name for names in LIBRARY_SETS.values() for name in names]
        near = difflib.get_close_matches(str(name_or_path), known, n=1)
        hint = f"did you mean {near[0]}? " if near else ""
        raise MovementError(
            f'no movement "{name_or_path}": {hint}give the path of a .toml or .csv file, '
            f"or one of {', '.join(known)}"
        )
    return _read(path)


def save_movement(movement: Movement, path: str | Path) -> None:
    """Write a movement file: .toml for a closed form, .csv for samples.

    Raises:
        MovementError: wrong suffix for the kind of movement, or the file cannot be written.
    """
    path = Path(path)
    trajectory = movement.trajectory
    wanted = ".csv" if isinstance(trajectory, SampledTrajectory) else ".toml"
    if path.suffix.lower() != wanted:
        raise MovementError(f"{path}: a movement of kind {movement.kind} is saved as a {wanted} file")
    try:
        if isinstance(trajectory, SampledTrajectory):
            write_samples(path, trajectory)
        else:
            path.write_text(movement_text(movement), encoding="utf-8")
    except OSError as error:
        raise MovementError(
            f"{path}: cannot be written ({error.strerror or error}); give a place that can be"
        ) from error


def movement_text(movement: Movement) -> str:
    """The TOML file of a movement in closed form, complete and readable."""
    trajectory = movement.trajectory
    if movement.kind not in KIND_WORDS:
        raise MovementError(f"movement {movement.name} is made of samples: save it as a .csv file")
    lines = [
        f"# A movement of the TCP, {KIND_WORDS[movement.kind]}.",
        "# x, y, z over t derive from it; docs/movements.md explains the fields.",
        f"format = {_FORMAT}",
        f"name = {toml_value(movement.name)}",
        f"kind = {toml_value(movement.kind)}",
        f"duration = {toml_value(movement.duration)}  # s",
        f"stroke_durations = {toml_value(movement.stroke_durations.tolist())}  # s",
        "target_points = [  # m, robot base frame",
        *(f"    {toml_value(point)}," for point in movement.target_points.tolist()),
        "]",
    ]
    if movement.provenance:
        lines += ["", "[provenance]"]
        lines += [f"{_toml_key(key)} = {toml_value(value)}" for key, value in movement.provenance.items()]
    lines += trajectory_lines(trajectory)
    return "\n".join(lines) + "\n"


def _toml_key(key: str) -> str:
    return key if key.replace("_", "").replace("-", "").isalnum() and key.isascii() else toml_value(key)


def _read(path: Path) -> Movement | JointTrajectory:
    suffix = path.suffix.lower()
    if suffix not in (".toml", ".csv"):
        raise MovementError(f"{path}: movement files are .toml (parameters) or .csv (samples)")
    if suffix == ".csv":
        return _parse_samples(FILE_KINDS["samples"].read_text(path), path)
    return _parse_movement(TableReader(FILE_KINDS["movement"].read_toml(path), str(path)), str(path))


def _parse_samples(text: str, path: Path) -> Movement | JointTrajectory:
    """What a table of samples holds; without a first line of names its columns are x, y, z, t."""
    wanted = "x, y, z in m and t in s, and docs/movements.md for poses and joint angles"
    rows = parse_rows(text, str(path), (*FORMS, JOINT_COLUMNS), wanted)
    if len(rows.values) < MIN_SAMPLES:
        raise MovementError(f"{path}: {len(rows.values)} samples; a movement needs at least {MIN_SAMPLES}")
    with _naming(str(path)):
        if rows.columns == JOINT_COLUMNS:
            return JointTrajectory(rows.values[:, 0], rows.values[:, 1:], path.stem)
        trajectory = samples_of(rows)
        return Movement(path.stem, trajectory, np.array([trajectory.duration]), {"file": path.name})


def _parse_movement(table: TableReader, source: str) -> Movement:
    version = table.number("format")
    if version != _FORMAT:
        raise table.error("format", f"{version:g}; this program reads format {_FORMAT}")
    name, kind = table.text("name"), table.text("kind")
    points = table.points("target_points")
    provenance = table.table("provenance").facts() if "provenance" in table else {}
    duration = table.number("duration")
    if len(points) > MOST_POINTS:
        raise table.error("target_points", f"{len(points)} points; give {MOST_POINTS} at most")
    durations = np.array(table.numbers("stroke_durations")) if "stroke_durations" in table else None
    with _naming(source):
        check_name(name)
        check_duration(duration, f"movement {name}")
        trajectory, durations = parse_trajectory(kind, table, points, duration, durations)
        table.finish(_FIELDS)
        return Movement(name, trajectory, durations, provenance)


@contextmanager
def _naming(source: str) -> Iterator[None]:
    """Put the file's name before messages of those who do not know it."""
    try:
        yield
    except MovementError as error:
        if str(error).startswith(source):
            raise
        raise MovementError(f"{source}: {error}") from error
