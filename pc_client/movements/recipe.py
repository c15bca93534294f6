"""The paper's recipe for a human-like movement, and how it comes into the workspace of a UR3.

    1. target points at random in a box of the size of a hand's movement
    2. between each two of them a stroke: D, mu and sigma by Eq. 6 to 9, in windows that abut
    3. the straight lines between the points, resampled with the speed of the strokes ("2.5 dimensions")
    4. moved, scaled and rotated into the robot's box, slowed down to a speed that the robot can reach

`docs/movements.md` says which sentence of the paper each step follows, and what the paper leaves open.

Source: sections II.B and IV.A.
"""

from __future__ import annotations

import random
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pc_client.errors import MovementError
from pc_client.movements.durations import Isochrony, leg_lengths
from pc_client.movements.fit import fit_movement
from pc_client.movements.geometry import UR3_BOX, Box
from pc_client.movements.movement import Movement
from pc_client.movements.sigma_lognormal import SigmaLognormal
from pc_client.movements.stroke import PlanarStroke, lift_strokes
from pc_client.movements.targets import TargetRules, random_targets
from pc_client.movements.timing import LiteralTiming

__all__ = ["HAND", "LEAD", "TOP_SPEED", "HandRules", "literal_strokes", "recipe_movement"]

#: Lead of the command before the window of its stroke, in windows. Eq. 9 needs k = (lead + 1) / (lead + 1/2),
#: and the paper states neither. At 1, k is 4/3, sigma .0668, the skewness .20 and the kurtosis 3.07: "close
#: to zero but positive" and "around 3". A stroke of .1 s then has mu = -1.89, which a hand's mu (-2.2 to
#: -1.6) allows; a lead of 1/2 gives -2.29, a lead of 2 gives -1.38.
LEAD = 1.0
#: Largest speed of the tool, m/s: movel's default, and within what a UR3 can do in any direction in its box.
TOP_SPEED = 0.25
#: What the movement keeps from the faces of the robot's box, m: its twins with bent paths stay inside, too.
_MARGIN = 0.015


@dataclass(frozen=True, slots=True)
class HandRules:
    """The movement of a hand, before it is brought to the robot.

    Attributes:
        box: where the target points lie, m: a word or a signature in the air. Only its proportions matter to
            the robot, for the movement is scaled.
        targets: what the points must keep to: legs of a quarter to a half of the box's length.
        stroke: duration of a stroke of `leg`, s. Source: section II.B, "duration 0.1 sec".
        leg: m.
        isochrony: a stroke lasts stroke (length / leg)^isochrony: people need hardly more time for longer
            strokes.
        variability: factors on the duration from stroke to stroke, low and high.
    """

    box: Box
    targets: TargetRules
    stroke: float
    leg: float
    isochrony: float
    variability: tuple[float, float]


HAND = HandRules(
    box=Box((0.0, 0.0, 0.0), (0.10, 0.05, 0.05)),
    targets=TargetRules(min_leg=0.025, max_leg=0.05, min_apart=0.0125),
    stroke=0.1,
    leg=0.0375,
    isochrony=0.3,
    variability=(0.92, 1.08),
)


def literal_strokes(target_points: ArrayLike, durations: ArrayLike) -> SigmaLognormal:
    """Straight strokes by Eq. 6 to 9 between target points, one after the other.

    The window of a stroke begins where the one before ends, the first at 0; its peak is in the middle, and
    all of its length is done at its end. So the movement all but rests at every target point and reaches it.

    Args:
        target_points: (n, 3), m.
        durations: windows of the strokes, (n - 1,), s.
    """
    legs, windows = leg_lengths(target_points), np.asarray(durations, dtype=np.float64)
    if windows.shape != legs.shape:
        raise MovementError(
            f"{windows.size} stroke durations for {len(legs) + 1} target points: give {len(legs)}"
        )
    edges = np.round(np.concatenate(([0.0], np.cumsum(windows))), 9).tolist()
    planar = [
        PlanarStroke(LiteralTiming(begin, window, LEAD * window), leg, 0.0, 0.0)
        for begin, window, leg in zip(edges[:-1], windows.tolist(), legs.tolist(), strict=True)
    ]
    return SigmaLognormal(np.asarray(target_points, dtype=np.float64), lift_strokes(planar), edges[-1])


def recipe_movement(n_targets: int, seed: int, name: str, box: Box = UR3_BOX) -> Movement:
    """A movement by the recipe: as large as it fits into the box, as quick as `TOP_SPEED` allows.

    Numbers are rounded after the fit, points to .1 mm and durations to ms, so that files are readable.

    Args:
        n_targets: number of target points, at least 2.
        seed: 0 or more; the same seed gives the same movement everywhere.
        name: the movement's.
        box: where, base frame, m.
    """
    source = random.Random(seed)
    targets = random_targets(n_targets, HAND.box, source, HAND.targets)
    durations = _stroke_durations(targets, source)
    hand = Movement(name, literal_strokes(targets, durations), durations)
    fit = fit_movement(hand, box.shrunk(_MARGIN), rotate="yaw", max_speed=TOP_SPEED, may_slow_down=True)
    points = np.round(fit.movement.target_points, 4)
    rounded = np.round(fit.movement.stroke_durations, 3)
    facts: dict[str, str | int | float] = {
        "generator": "pc_client.movements.generate",
        "seed": seed,
        "scale": round(fit.similarity.scale, 3),
        "time_stretch": round(fit.stretch, 3),
    }
    return Movement(name, literal_strokes(points, rounded), rounded, facts)


def _stroke_durations(targets: NDArray[np.float64], source: random.Random) -> NDArray[np.float64]:
    low, high = HAND.variability
    rule = Isochrony(HAND.isochrony, HAND.stroke / HAND.leg**HAND.isochrony)
    factors = [low + (high - low) * source.random() for _ in pairwise(targets)]
    durations: NDArray[np.float64] = rule.durations(leg_lengths(targets)) * np.array(factors)
    return durations
