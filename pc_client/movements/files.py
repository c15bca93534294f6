"""Movement files: TOML for movements in closed form, CSV for samples; and the library, two sets of ten.

The format is described in `docs/movements.md`. Reading checks everything and names file and field (or line)
of what is wrong.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import MappingProxyType

import numpy as np

from pc_client.errors import MovementError, UnknownMovementError
from pc_client.files import FILE_KINDS
from pc_client.movements.columns import parse_rows
from pc_client.movements.movement import JOINT_COLUMNS, JointTrajectory, Movement
from pc_client.movements.movement_file import movement_text, parse_movement
from pc_client.movements.own_points import POINT_COLUMNS, through
from pc_client.movements.samples import FORMS, MIN_SAMPLES, SampledTrajectory, samples_of, write_samples
from ur_hil.records import nearest

__all__ = [
    "DEFAULT_SET",
    "LIBRARY_FOLDER",
    "LIBRARY_SETS",
    "library_name_of",
    "library_names",
    "library_path",
    "load_motion",
    "load_movement",
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


def library_name_of(text: str) -> str | None:
    """Which movement of the library has this file; None: none."""
    return _names_by_text().get(text)


@cache
def _names_by_text() -> Mapping[str, str]:
    names = [name for names in LIBRARY_SETS.values() for name in names]
    paths = ((name, library_path(name)) for name in names)
    return {path.read_text(encoding="utf-8"): name for name, path in paths if path}


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


def _read(path: Path) -> Movement | JointTrajectory:
    suffix = path.suffix.lower()
    if suffix not in (".toml", ".csv"):
        raise MovementError(f"{path}: movement files are .toml (parameters) or .csv (samples)")
    if suffix == ".csv":
        return _parse_samples(FILE_KINDS["samples"].read_text(path), path)
    return parse_movement(FILE_KINDS["movement"].read_toml(path), str(path))


def _parse_samples(text: str, path: Path) -> Movement | JointTrajectory:
    """What a table of samples or target points holds; without a line of names, x, y, z and perhaps t."""
    wanted = "x, y, z in m and t in s, target points x, y, z, or what docs/movements.md names beside them"
    rows = parse_rows(text, str(path), (*FORMS, JOINT_COLUMNS, POINT_COLUMNS), wanted)
    if rows.columns != POINT_COLUMNS and len(rows.values) < MIN_SAMPLES:
        raise MovementError(
            f"{path}: {len(rows.values)} samples; a movement needs at least {MIN_SAMPLES} "
            "(target points with times: `ur-client movements new`, or Movement.from_csv with a style)"
        )
    try:
        if rows.columns == POINT_COLUMNS:
            return through(rows.values, name=path.stem)
        if rows.columns == JOINT_COLUMNS:
            return JointTrajectory(rows.values[:, 0], rows.values[:, 1:], path.stem)
        trajectory = samples_of(rows)
        return Movement(path.stem, trajectory, np.array([trajectory.duration]), {"file": path.name})
    except MovementError as error:
        raise MovementError(f"{path}: {error}") from error
