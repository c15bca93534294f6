"""Which movements are compared: every generator in the same time, for one or more seeds.

All but the duplicate, which moves its target points as people do, have the same target points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from pc_client.errors import ClientError
from pc_client.movements.files import save_movement
from pc_client.movements.generate import generate_movement
from pc_client.movements.movement import Movement
from pc_client.movements.twins import GENERATORS

__all__ = ["MovementSet", "make_sets", "save_sets"]

MovementSet = Mapping[str, Movement]
"""The movements of one seed by the generator's name, in the order of `GENERATORS`."""


def make_sets(n_targets: int, seed: int, n_sets: int) -> list[MovementSet]:
    """Make the movements of the seeds seed, seed + 1 ...

    Args:
        n_targets: number of target points, at least 2.
        seed: the first, 0 or more.
        n_sets: how many, at least 1.
    """
    if n_sets < 1:
        raise ClientError(f"{n_sets} sets of movements is nothing to compare; give at least one")
    return [
        {kind: _make(kind, n_targets, number) for kind in GENERATORS} for number in range(seed, seed + n_sets)
    ]


def _make(kind: str, n_targets: int, seed: int) -> Movement:
    made = generate_movement(kind, n_targets, seed, name=f"{kind}_{n_targets}_seed{seed}")
    return replace(made, may_be_moved=True)


def save_sets(sets: Sequence[MovementSet], folder: Path) -> None:
    """Write all movements as files into a folder, so that each can be run or looked at by itself.

    Raises:
        ClientError: the folder cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ClientError(f"cannot use the folder {folder}: {error.strerror or error}") from error
    for movements in sets:
        for movement in movements.values():
            save_movement(movement, folder / f"{movement.name}.toml")
