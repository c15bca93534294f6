"""Random target points in a box, by a seed and by rules that keep movements sensible.

The random numbers are those of Python's `random.Random.random()`, whose sequence the language promises never
to change: a seed gives the same movement on every machine and version.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pc_client.errors import MovementError
from pc_client.movements.geometry import Box

__all__ = ["TargetRules", "random_targets"]

_TRIES_A_POINT = 100
_TRIES = 50


@dataclass(frozen=True, slots=True)
class TargetRules:
    """What target points must keep to.

    Attributes:
        min_leg: least distance between consecutive points, m.
        max_leg: largest distance between consecutive points, m.
        min_apart: least distance between any two points, m.
        min_turn: least change of direction at an inner point, rad: below it two strokes look like one.
        max_turn: largest change of direction at an inner point, rad: above it the hand goes back on itself.
        decimals: points are rounded to so many decimals of a metre, so that files are readable.
    """

    min_leg: float = 0.10
    max_leg: float = 0.20
    min_apart: float = 0.05
    min_turn: float = math.radians(30.0)
    max_turn: float = math.radians(140.0)
    decimals: int = 4


def random_targets(
    n_targets: int, box: Box, source: random.Random, rules: TargetRules | None = None
) -> NDArray[np.float64]:
    """Target points drawn evenly from a box and kept when they follow the rules.

    Args:
        n_targets: how many, at least 2.
        box: where, base frame, m.
        source: random numbers; only its `random()` is used.
        rules: what the points must keep to; `TargetRules()` if None.

    Returns:
        (n_targets, 3), m.

    Raises:
        MovementError: when no such points are found, because the box is too small for the rules.
    """
    if n_targets < 2:
        raise MovementError(f"{n_targets} target points: a movement needs at least 2")
    rules = rules or TargetRules()
    for _ in range(_TRIES):
        points: list[NDArray[np.float64]] = []
        for _ in range(_TRIES_A_POINT * n_targets):
            point = np.array(
                [low + (high - low) * source.random() for low, high in zip(box.low, box.high, strict=True)]
            )
            point = np.round(point, rules.decimals)
            if _follows_rules(points, point, rules):
                points.append(point)
            if len(points) == n_targets:
                return np.array(points)
    raise MovementError(
        f"no {n_targets} target points in a box of {[round(float(x), 4) for x in box.size]} m with legs of "
        f"{rules.min_leg} to {rules.max_leg} m: give a larger box, fewer points or shorter legs"
    )


def _follows_rules(points: list[NDArray[np.float64]], point: NDArray[np.float64], rules: TargetRules) -> bool:
    if not points:
        return True
    if any(math.dist(point, other) < rules.min_apart for other in points):
        return False
    leg = point - points[-1]
    if not rules.min_leg <= math.dist(point, points[-1]) <= rules.max_leg:
        return False
    if len(points) == 1:
        return True
    before = points[-1] - points[-2]
    turn = math.atan2(float(np.linalg.norm(np.cross(before, leg))), float(before @ leg))
    return rules.min_turn <= turn <= rules.max_turn
