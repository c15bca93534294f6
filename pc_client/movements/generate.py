"""New movements by a seed, and the sets of the library.

Run as a program it writes the library's files again: `python -m pc_client.movements.generate [FOLDER]`. The
same seed gives the same bytes.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

from pc_client.errors import MovementError
from pc_client.movements.files import LIBRARY_FOLDER, LIBRARY_SETS, library_names, save_movement
from pc_client.movements.movement import Movement
from pc_client.movements.recipes import arcs_movement, recipe_movement
from pc_client.movements.robotic import Corners
from pc_client.movements.twins import GENERATORS, robotic_twin

__all__ = ["generate_library", "generate_movement", "write_library"]

#: First seed of each set; its five pairs take this and the next four. Chosen once, never searched.
_LIBRARY_SEED = 1
#: For each set, what makes the human-like movement of a pair from number of target points, seed and name; and
#: what its names in recordings and tables begin with, for only one set may have the names of Table I.
_SETS: Mapping[str, tuple[Callable[[int, int, str], Movement], str]] = MappingProxyType(
    {"paper": (recipe_movement, ""), "arcs": (arcs_movement, "arcs_")}
)


def generate_movement(
    kind: str, n_targets: int, seed: int, *, name: str | None = None, corners: Corners = "stop"
) -> Movement:
    """A random movement; all kinds of one seed have the same duration and, but for duplicates, target points.

    Args:
        kind: a name of `twins.GENERATORS`, e.g. "lognormal" or "uniform".
        n_targets: number of target points, at least 2.
        seed: 0 or more; the same seed gives the same movement everywhere.
        name: e.g. "lognorm_5_1"; made from kind, n_targets and seed if None.
        corners: of kind "uniform": come to rest at inner target points, or blend them.
    """
    if kind not in GENERATORS:
        raise MovementError(f'kind "{kind}": give one of {", ".join(GENERATORS)}')
    if seed < 0:
        raise MovementError(f"seed {seed}: give a whole number, 0 or more")
    if corners != "stop" and kind != "uniform":
        raise MovementError(
            f'corners "{corners}" with kind "{kind}": only kind uniform has a choice of corners'
        )
    human = recipe_movement(n_targets, seed, f"lognorm_{n_targets}_seed{seed}")
    if kind == "lognormal":
        return human.renamed(name or human.name)
    name = name or f"{kind}_{n_targets}_seed{seed}"
    if kind == "uniform":
        return robotic_twin(human, name, corners)
    return GENERATORS[kind].make(human, seed, name)


def generate_library(set_name: str, seed: int = _LIBRARY_SEED) -> dict[str, Movement]:
    """The ten movements of a set by their library names, made afresh.

    Args:
        set_name: as of `library_names`.
        seed: of the first pair; the other four take the next four. With the default the movements are those
            of the package's files.
    """
    names = library_names(set_name)
    make, prefix = _SETS[set_name]
    made: dict[str, Movement] = {}
    for pair, (human_name, robot_name) in enumerate(zip(names[5:], names[:5], strict=True)):
        number = human_name[-3:]
        human = make(int(number[0]), seed + pair, f"{prefix}lognorm_{number}")
        made[human_name] = human
        made[robot_name] = robotic_twin(human, f"{prefix}uniform_{number}")
    return {name: made[name] for name in names}


def write_library(folder: Path = LIBRARY_FOLDER) -> None:
    """Write the files of all sets, each set in a folder of its name."""
    for set_name in LIBRARY_SETS:
        (folder / set_name).mkdir(parents=True, exist_ok=True)
        for name, movement in generate_library(set_name).items():
            save_movement(movement, folder / set_name / f"{Path(name).name}.toml")


if __name__ == "__main__":
    write_library(Path(sys.argv[1]) if len(sys.argv) > 1 else LIBRARY_FOLDER)
