"""New movements by a seed, and the ten of the library.

Run as a program it writes the library's files again: `python -m pc_client.movements.generate [FOLDER]`. The
same seed gives the same bytes.
"""

from __future__ import annotations

import math
import random
import sys
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pc_client.errors import MovementError
from pc_client.movements.files import DEFAULT_SET, LIBRARY_FOLDER, LIBRARY_SETS, library_names, save_movement
from pc_client.movements.geometry import UR3_BOX, Box
from pc_client.movements.movement import Movement
from pc_client.movements.sigma_lognormal import SigmaLognormal
from pc_client.movements.stroke import Stroke
from pc_client.movements.targets import TargetRules, random_targets
from pc_client.movements.timing import TwoSidedTiming
from pc_client.movements.twins import GENERATORS, RobotRules, robotic_twin

__all__ = [
    "HumanRules",
    "RobotRules",
    "generate_library",
    "generate_movement",
    "robotic_twin",
    "write_library",
]

#: First seed of the library; its five pairs take this and the next four. Chosen once, never searched.
LIBRARY_SEED = 1


@dataclass(frozen=True, slots=True)
class HumanRules:
    """Ranges from which strokes are drawn evenly; (low, high) each.

    Attributes:
        reference_leg: distance (m) that is run in `reference_window`.
        reference_window: window (s) of a stroke of that distance, both tails included; the visible part
            between two least speeds is shorter by the overlap. Such a slow hand keeps a UR3 far from its
            joint limits.
        isochrony: window = reference_window (leg / reference_leg)^isochrony: people hardly need longer for
            longer ways.
        variability: factors on the window from stroke to stroke.
        sigma: widths of the bells.
        overlap: share of the shorter of two windows in which both strokes move.
        turn: bending of the arcs, rad.
        rest: time at rest before the first and after the last window, s.
    """

    reference_leg: float = 0.15
    reference_window: float = 2.7
    isochrony: float = 0.3
    variability: tuple[float, float] = (0.92, 1.08)
    sigma: tuple[float, float] = (0.10, 0.20)
    overlap: tuple[float, float] = (0.35, 0.50)
    turn: tuple[float, float] = (0.1, 0.6)
    rest: float = 0.1


def generate_movement(
    kind: str,
    n_targets: int,
    seed: int,
    *,
    name: str | None = None,
    box: Box = UR3_BOX,
    margin: float = 0.015,
    target_rules: TargetRules | None = None,
    human_rules: HumanRules | None = None,
    robot_rules: RobotRules | None = None,
) -> Movement:
    """A random movement; all kinds of one seed are twins: same target points, same duration.

    Args:
        kind: a name of `twins.GENERATORS`, e.g. "lognormal" or "uniform".
        n_targets: number of target points, at least 2.
        seed: 0 or more; the same seed gives the same movement everywhere.
        name: e.g. "lognorm_5_1"; made from kind, n_targets and seed if None.
        box: where, base frame, m.
        margin: how far (m) target points keep from the box's faces, so that arcs and cut corners stay inside.
        target_rules: rules for the points; defaults if None.
        human_rules: ranges of the strokes; defaults if None.
        robot_rules: profile of a "uniform" movement; defaults if None.
    """
    if kind not in GENERATORS:
        raise MovementError(f'kind "{kind}": give one of {", ".join(GENERATORS)}')
    if seed < 0:
        raise MovementError(f"seed {seed}: give a whole number, 0 or more")
    source = random.Random(seed)
    targets = random_targets(n_targets, box.shrunk(margin), source, target_rules)
    law = _draw_strokes(targets, source, human_rules or HumanRules())
    boundaries = np.concatenate(([0.0], np.round(law.speed_minima(), 3), [law.duration]))
    durations = [round(duration, 3) for duration in np.diff(boundaries).tolist()]
    provenance: dict[str, str | int | float] = {"generator": "pc_client.movements.generate", "seed": seed}
    human = Movement(f"lognorm_{n_targets}_seed{seed}", law, np.array(durations), provenance)
    if kind == "lognormal":
        return human.renamed(name or human.name)
    name = name or f"{kind}_{n_targets}_seed{seed}"
    if kind == "uniform":
        return robotic_twin(human, name, robot_rules)
    return GENERATORS[kind].make(human, seed, name)


def generate_library(set_name: str = DEFAULT_SET, seed: int = LIBRARY_SEED) -> dict[str, Movement]:
    """The ten movements of a set by their library names, made afresh.

    Args:
        set_name: as of `library_names`.
        seed: of the first pair; the other four take the next four. With the default the movements are those
            of the package's files.
    """
    prefix = "" if set_name == DEFAULT_SET else f"{set_name}_"
    made: dict[str, Movement] = {}
    names = library_names(set_name)
    for human_name, robot_name in zip(names[5:], names[:5], strict=True):
        number = human_name[-3:]
        human = generate_movement(
            "lognormal", int(number[0]), seed + len(made) // 2, name=f"{prefix}lognorm_{number}"
        )
        made[human_name] = human
        made[robot_name] = robotic_twin(human, f"{prefix}uniform_{number}")
    return {name: made[name] for name in names}


def write_library(folder: Path = LIBRARY_FOLDER) -> None:
    """Write the files of all sets, each set in a folder of its name."""
    for set_name in LIBRARY_SETS:
        (folder / set_name).mkdir(parents=True, exist_ok=True)
        for name, movement in generate_library(set_name).items():
            save_movement(movement, folder / set_name / f"{Path(name).name}.toml")


def _draw_strokes(targets: NDArray[np.float64], source: random.Random, rules: HumanRules) -> SigmaLognormal:
    """Strokes between the targets, drawn from the rules; rounded to three decimals for readable files."""

    def draw(low: float, high: float) -> float:
        return round(low + (high - low) * source.random(), 3)

    strokes: list[Stroke] = []
    end, window_before = rules.rest, math.inf
    for a, b in pairwise(targets):
        ease = (math.dist(a, b) / rules.reference_leg) ** rules.isochrony
        window = round(rules.reference_window * ease * draw(*rules.variability), 3)
        overlap = draw(*rules.overlap) * min(window, window_before) if strokes else 0.0
        start = round(end - overlap, 3)
        timing = TwoSidedTiming(start, window, draw(*rules.sigma))
        strokes.append(Stroke(timing, turn=draw(*rules.turn), tilt=draw(-math.pi, math.pi)))
        end, window_before = start + window, window
    return SigmaLognormal(targets, tuple(strokes), round(end + rules.rest, 3))


if __name__ == "__main__":
    write_library(Path(sys.argv[1]) if len(sys.argv) > 1 else LIBRARY_FOLDER)
