"""Human-like movements of arcs that overlap in time, each in a window of its own.

People draw arcs and begin a stroke before the one before has ended; the paper's recipe (`recipe.py`) does
neither. So the hand cuts the corner at an inner target point, and the speed profiles are skewed to the left.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pc_client.movements.geometry import UR3_BOX
from pc_client.movements.movement import Movement
from pc_client.movements.sigma_lognormal import SigmaLognormal
from pc_client.movements.stroke import Stroke
from pc_client.movements.targets import random_targets
from pc_client.movements.timing import TwoSidedTiming

__all__ = ["ARC_RULES", "ArcRules", "arcs_movement", "arcs_twin"]

#: How far target points keep from the faces of the robot's box, m: arcs and cut corners stay inside.
_MARGIN = 0.015


@dataclass(frozen=True, slots=True)
class ArcRules:
    """Ranges from which strokes are drawn evenly; (low, high) each.

    Attributes:
        reference_leg: distance (m) that is run in `reference_window`.
        reference_window: window (s) of a stroke of that distance, both tails included; the visible part
            between two speed minima is shorter by the overlap. Such a slow hand keeps a UR3 far from its
            joint limits.
        isochrony: window = reference_window (leg / reference_leg)^isochrony: people hardly need longer for
            longer strokes.
        variability: factors on the window from stroke to stroke.
        sigma: of the lognormals.
        overlap: share of the shorter of two windows in which both strokes move.
        arc_angle: bending of the arcs, rad.
        rest: time at rest before the first and after the last window, s.
    """

    reference_leg: float = 0.15
    reference_window: float = 2.7
    isochrony: float = 0.3
    variability: tuple[float, float] = (0.92, 1.08)
    sigma: tuple[float, float] = (0.10, 0.20)
    overlap: tuple[float, float] = (0.35, 0.50)
    arc_angle: tuple[float, float] = (0.1, 0.6)
    rest: float = 0.1


ARC_RULES = ArcRules()


def arcs_movement(n_targets: int, seed: int, name: str) -> Movement:
    """A movement of arcs between random target points in the UR3's box.

    Args:
        n_targets: number of target points, at least 2.
        seed: 0 or more; the same seed gives the same movement everywhere.
        name: the movement's.
    """
    source = random.Random(seed)
    targets = random_targets(n_targets, UR3_BOX.shrunk(_MARGIN), source)
    facts: dict[str, str | int | float] = {"generator": "pc_client.movements.generate", "seed": seed}
    return _movement(name, _draw_strokes(targets, source, ARC_RULES), facts)


def arcs_twin(movement: Movement, seed: int, name: str) -> Movement:
    """Random arcs to the same target points in the same total time.

    Args:
        movement: any movement.
        seed: of the arcs.
        name: the twin's.
    """
    trajectory = _draw_strokes(movement.target_points, random.Random(seed), ARC_RULES)
    drawn = _movement(name, trajectory, {**movement.provenance, "twin": movement.name})
    return drawn.stretched(movement.duration / drawn.duration)


def _movement(name: str, trajectory: SigmaLognormal, facts: dict[str, str | int | float]) -> Movement:
    boundaries = np.concatenate(([0.0], np.round(trajectory.speed_minima(), 3), [trajectory.duration]))
    durations = [round(duration, 3) for duration in np.diff(boundaries).tolist()]
    return Movement(name, trajectory, np.array(durations), facts)


def _draw_strokes(targets: NDArray[np.float64], source: random.Random, rules: ArcRules) -> SigmaLognormal:
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
        strokes.append(Stroke(timing, arc_angle=draw(*rules.arc_angle), tilt=draw(-math.pi, math.pi)))
        end, window_before = start + window, window
    return SigmaLognormal(targets, tuple(strokes), round(end + rules.rest, 3))
