"""New movements by a seed: every generator, and the sets of the library.

A generator makes a twin of the movement of the paper's recipe: it keeps its duration and, but for the
duplicate, its target points; whether it keeps the durations of its strokes, too, depends on the model.
`GENERATORS` says both for each. So what is compared are the models, not sizes or speeds.

Run as a program it writes the library's files again: `python -m pc_client.movements.generate [FOLDER]`. The
same seed gives the same bytes.
"""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from pc_client.errors import MovementError
from pc_client.movements.durations import DurationRule, Fitts, Isochrony, retimed
from pc_client.movements.library_sets import LIBRARY_FOLDER, library_names
from pc_client.movements.minimum_jerk import MinimumJerk, Passing
from pc_client.movements.movement import Movement
from pc_client.movements.power_law import TORSION_EXPONENT, TWO_THIRDS, PowerLaw
from pc_client.movements.recipes import arcs_movement, arcs_twin, recipe_movement
from pc_client.movements.sigma_lognormal import SigmaLognormal
from pc_client.movements.uniform import SETBACK, Corners, uniform_trajectory
from pc_client.movements.variability import duplicate

#: Overlap of re-timed strokes and rest before and after them (s): the middle of what new movements draw.
_OVERLAP, _REST = 0.425, 0.1
#: Each of the two ramps of a power-law movement, as a share of its mean stroke: together they take as long as
#: a stroke takes to its peak.
_RAMP_SHARE = 0.2
#: Radius (m) above which a path counts as straight: twice the reach of the arm.
_LARGEST_RADIUS = 1.0


def uniform_twin(
    movement: Movement, name: str, corners: Corners = "stop", setback: float = SETBACK
) -> Movement:
    """The robot-like movement along the same target points with the same stroke durations."""
    trajectory = uniform_trajectory(movement.target_points, movement.stroke_durations, corners, setback)
    return Movement(name, trajectory, movement.stroke_durations, _facts(movement))


def _minimum_jerk_twin(movement: Movement, name: str, passing: Passing = "stop") -> Movement:
    """The minimum-jerk movement to the same target points with the same stroke durations."""
    trajectory = MinimumJerk(movement.target_points, movement.stroke_durations, passing)
    return Movement(name, trajectory, movement.stroke_durations, _facts(movement))


def _power_law_twin(movement: Movement, name: str, *, torsion: bool = False) -> Movement:
    """The power-law movement through the same target points in the same total time.

    With `torsion` the torsion of the path counts, too.
    """
    ramp = _RAMP_SHARE * float(np.mean(movement.stroke_durations))
    trajectory = PowerLaw(
        movement.target_points,
        movement.duration,
        (ramp, ramp),
        _LARGEST_RADIUS,
        TWO_THIRDS,
        TORSION_EXPONENT if torsion else 0.0,
    )
    return Movement(name, trajectory, np.diff(trajectory.passages), _facts(movement))


def retimed_twin(movement: Movement, name: str, rule: DurationRule) -> Movement:
    """The human-like movement on the same arcs in the same total time, its strokes' windows by a rule."""
    if not isinstance(movement.trajectory, SigmaLognormal):
        raise MovementError(
            f"movement {movement.name} is of kind {movement.kind}: give a lognormal one to re-time"
        )
    trajectory = retimed(movement.trajectory, rule, overlap=_OVERLAP, rest=_REST)
    boundaries = np.concatenate(([0.0], trajectory.speed_minima(), [trajectory.duration]))
    return Movement(name, trajectory, np.diff(boundaries), _facts(movement))


@dataclass(frozen=True, slots=True)
class Generator:
    """One method to make a movement.

    Attributes:
        make: from the movement of the paper's recipe, a seed and the new movement's name.
        same_strokes: whether the strokes last as long as those of the recipe; the whole always does.
        same_targets: whether the target points are those of the recipe.
    """

    make: Callable[[Movement, int, str], Movement]
    says: str
    same_strokes: bool = False
    same_targets: bool = True


def _facts(movement: Movement) -> dict[str, str | int | float]:
    return {**movement.provenance, "twin": movement.name}


def _duplicate(movement: Movement, seed: int, name: str) -> Movement:
    varied = duplicate(movement, seed, name=name)
    return varied.stretched(movement.duration / varied.duration)


def _retimed_arcs(movement: Movement, seed: int, name: str, rule: DurationRule) -> Movement:
    return retimed_twin(arcs_twin(movement, seed, movement.name), name, rule)


def _fixed(twin: Callable[..., Movement], **options: Any) -> Callable[[Movement, int, str], Movement]:
    """What leaves nothing to a seed."""
    return lambda human, _, name: twin(human, name, **options)


#: Every generator by the name that `ur-client movements generate --kind` takes, human-like ones first.
GENERATORS: Mapping[str, Generator] = MappingProxyType(
    {
        "lognormal": Generator(
            _fixed(Movement.renamed), "the paper's recipe: straight lognormal strokes", True
        ),
        "arcs": Generator(arcs_twin, "arcs that overlap, lognormal strokes"),
        "isochronous": Generator(partial(_retimed_arcs, rule=Isochrony()), "the arcs with one mu and sigma"),
        "fitts": Generator(partial(_retimed_arcs, rule=Fitts()), "the arcs timed by Fitts' law"),
        "duplicate": Generator(_duplicate, "lognormal, varied as between repetitions", same_targets=False),
        "minimum_jerk": Generator(
            _fixed(_minimum_jerk_twin), "minimum jerk, at rest at every target point", True
        ),
        "minimum_jerk_via": Generator(
            _fixed(_minimum_jerk_twin, passing="via"), "minimum jerk through the target points", True
        ),
        "power_law": Generator(_fixed(_power_law_twin), "two-thirds power law on a smooth path"),
        "power_law_3d": Generator(
            _fixed(_power_law_twin, torsion=True), "power law with the factor of torsion"
        ),
        "uniform": Generator(_fixed(uniform_twin), "trapezoids, at rest at every target point", True),
        "uniform_blend": Generator(
            _fixed(uniform_twin, corners="blend"), "levels of speed, corners blended by 30 mm", True
        ),
    }
)

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
        kind: a name of `GENERATORS`, e.g. "lognormal" or "uniform".
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
    name = name or (human.name if kind == "lognormal" else f"{kind}_{n_targets}_seed{seed}")
    if kind == "uniform":
        return uniform_twin(human, name, corners)
    return GENERATORS[kind].make(human, seed, name)


def write_library(folder: Path = LIBRARY_FOLDER) -> None:
    """Make the movements of all sets afresh and write their files, each set in a folder of its name."""
    for set_name, (make, prefix) in _SETS.items():
        (folder / set_name).mkdir(parents=True, exist_ok=True)
        names = library_names(set_name)
        for pair, (human_name, robot_name) in enumerate(zip(names[5:], names[:5], strict=True)):
            number = human_name[-3:]
            human = make(int(number[0]), _LIBRARY_SEED + pair, f"{prefix}lognorm_{number}")
            robot = uniform_twin(human, f"{prefix}uniform_{number}")
            for name, movement in ((human_name, human), (robot_name, robot)):
                movement.save(folder / set_name / f"{Path(name).name}.toml")


if __name__ == "__main__":
    write_library(Path(sys.argv[1]) if len(sys.argv) > 1 else LIBRARY_FOLDER)
