"""Human-like movements from random target points, and the way of a movement into a robot's workspace.

The paper's recipe (sections II.B and IV.A):

    1. target points at random in a box of the size of a hand's movement
    2. between each two of them a stroke: D, mu and sigma by Eq. 6 to 9, in windows that abut
    3. the straight lines between the points, resampled with the speed of the strokes ("2.5 dimensions")
    4. moved, scaled and rotated into the robot's box, slowed down to a speed that the robot can reach

`docs/movements.md` says which sentence of the paper each step follows, and what the paper leaves open. People
draw arcs and begin a stroke before the one before has ended; `arcs_movement` does both: the hand cuts the
corner at an inner target point, and the speed profiles are skewed to the left.

`fit_movement` changes no shape: neither of the path nor of the speed over time; slowing down is the theory's
own scaling of time. Random numbers are those of Python's `random.Random.random()`, whose sequence the
language promises never to change: a seed gives the same movement on every machine and version.
"""

import math
import random
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from pc_client.arrays import Array
from pc_client.errors import MovementError
from pc_client.kinematics.arms import UR3_BOX, Box
from pc_client.movements.durations import ISOCHRONY, TOP_SPEED, Isochrony
from pc_client.movements.lognormal import TwoSidedTiming
from pc_client.movements.movement import Movement
from pc_client.movements.sigma_lognormal import SigmaLognormal, Stroke, leg_lengths, literal_strokes
from pc_client.movements.trajectory import Similarity, about_z

_N_SAMPLES = 2001


class Fit(NamedTuple):
    """A fitted movement and its changes; `stretch` is the factor by which it became slower (1: none)."""

    movement: Movement
    similarity: Similarity
    stretch: float


def fit_movement(movement: Movement, box: Box = UR3_BOX, *, max_speed: float | None = None) -> Fit:
    """The movement as large as it fits into a box (base frame, m), in its middle.

    It is turned about the vertical by the angle, of 360 half degrees, that allows the largest scale. Where
    its TCP would be faster than `max_speed` (m/s), it is slowed down.

    Raises:
        MovementError: the movement is a single point.
    """
    t = np.linspace(0.0, movement.duration, _N_SAMPLES)
    path = movement.sample(t).p
    rotations = (about_z(math.radians(0.5 * step)) for step in range(360))
    rotation, scale = max(
        ((R, largest_scale(path @ R.T, box.size)) for R in rotations), key=lambda found: found[1]
    )
    if not math.isfinite(scale):
        raise MovementError(
            f"movement {movement.name} stays at one point: there is nothing to fit into a box"
        )
    turned = scale * path @ rotation.T
    similarity = Similarity(scale, rotation, box.centre - 0.5 * (turned.min(axis=0) + turned.max(axis=0)))
    fitted = movement.transformed(similarity)
    stretch = 1.0 if max_speed is None else max(1.0, float(fitted.speed(t).max()) / max_speed)
    return Fit(fitted.stretched(stretch) if stretch > 1.0 else fitted, similarity, stretch)


def largest_scale(path: Array, room: Array) -> float:
    """The largest scale at which a path (n, 3) has no more than the room (3,); inf for one point."""
    extent = np.ptp(path.T.copy(), axis=1)  # six times as quick as along the columns
    scales = (free / need for free, need in zip(room, extent, strict=True) if need > 1e-12)
    return float(min(scales, default=math.inf))


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
) -> Array:
    """Draw at least 2 target points (n, 3), m, evenly from a box and keep those that follow the rules.

    Only `random()` of the source is used. Without rules, those of `TargetRules()` hold.

    Raises:
        MovementError: no such points are found, because the box is too small for the rules.
    """
    if n_targets < 2:
        raise MovementError(f"{n_targets} target points: a movement needs at least 2")
    rules = rules or TargetRules()
    for _ in range(_TRIES):
        points: list[Array] = []
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


def _follows_rules(points: list[Array], point: Array, rules: TargetRules) -> bool:
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


#: What the movement keeps from the faces of the robot's box, m: its twins with bent paths stay inside, too.
_MARGIN = 0.015


#: Where the target points of a hand's movement lie, m: a word or a signature in the air. Only its proportions
#: matter to the robot, for the movement is scaled.
HAND_BOX = Box((0.0, 0.0, 0.0), (0.10, 0.05, 0.05))

#: Legs of a hand are a quarter to a half of its box's length.
HAND_TARGETS = TargetRules(min_leg=0.025, max_leg=0.05, min_apart=0.0125)

#: Duration of a hand's stroke of `_HAND_LEG`, s. Source: section II.B, "duration 0.1 sec".
HAND_STROKE = 0.1
_HAND_LEG = 0.0375

#: Factors on the duration from stroke to stroke, low and high.
_VARIABILITY = (0.92, 1.08)


def recipe_movement(n_targets: int, seed: int, name: str) -> Movement:
    """A movement by the recipe: as large as it fits into the UR3's box, as quick as `TOP_SPEED` allows.

    Numbers are rounded after the fit, points to .1 mm and durations to ms, so that files are readable.

    There are at least 2 target points. The same seed, 0 or more, gives the same movement everywhere.
    """
    source = random.Random(seed)
    targets = random_targets(n_targets, HAND_BOX, source, HAND_TARGETS)
    durations = _stroke_durations(targets, source)
    hand = Movement(name, literal_strokes(targets, durations), durations)
    fit = fit_movement(hand, UR3_BOX.shrunk(_MARGIN), max_speed=TOP_SPEED)
    points = np.round(fit.movement.target_points, 4)
    rounded = np.round(fit.movement.stroke_durations, 3)
    facts: dict[str, str | int | float] = {
        "generator": "pc_client.movements.generate",
        "seed": seed,
        "scale": round(fit.similarity.scale, 3),
        "time_stretch": round(fit.stretch, 3),
    }
    return Movement(name, literal_strokes(points, rounded), rounded, facts)


def _stroke_durations(targets: Array, source: random.Random) -> Array:
    low, high = _VARIABILITY
    rule = Isochrony(ISOCHRONY, HAND_STROKE / _HAND_LEG**ISOCHRONY)
    factors = [low + (high - low) * source.random() for _ in pairwise(targets)]
    durations: Array = rule.durations(leg_lengths(targets)) * np.array(factors)
    return durations


#: Window (s) of an arc between points so far apart (m), both tails included; the visible part between two
#: speed minima is shorter by the overlap. Such a slow hand keeps a UR3 far from its joint limits.
_ARC_WINDOW, _ARC_LEG = 2.7, 0.15

#: Ranges from which arcs are drawn evenly: the sigma of the lognormals, the share of the shorter of two
#: windows in which both strokes move, and the bending, rad.
_SIGMA, _OVERLAP, _ARC_ANGLE = (0.10, 0.20), (0.35, 0.50), (0.1, 0.6)

#: Time at rest before the first and after the last window, s.
_REST = 0.1


def arcs_movement(n_targets: int, seed: int, name: str) -> Movement:
    """A movement of arcs between random target points, at least 2, in the UR3's box.

    The same seed, 0 or more, gives the same movement everywhere.
    """
    source = random.Random(seed)
    targets = random_targets(n_targets, UR3_BOX.shrunk(_MARGIN), source)
    facts: dict[str, str | int | float] = {"generator": "pc_client.movements.generate", "seed": seed}
    return _movement(name, _draw_strokes(targets, source), facts)


def arcs_twin(movement: Movement, seed: int, name: str) -> Movement:
    """Random arcs, by a seed, to the same target points in the same total time."""
    trajectory = _draw_strokes(movement.target_points, random.Random(seed))
    drawn = _movement(name, trajectory, {**movement.provenance, "twin": movement.name})
    return drawn.stretched(movement.duration / drawn.duration)


def _movement(name: str, trajectory: SigmaLognormal, facts: dict[str, str | int | float]) -> Movement:
    boundaries = np.concatenate(([0.0], np.round(trajectory.speed_minima(), 3), [trajectory.duration]))
    durations = [round(duration, 3) for duration in np.diff(boundaries).tolist()]
    return Movement(name, trajectory, np.array(durations), facts)


def _draw_strokes(targets: Array, source: random.Random) -> SigmaLognormal:
    """Strokes between the targets, rounded to three decimals for readable files."""

    def draw(low: float, high: float) -> float:
        return round(low + (high - low) * source.random(), 3)

    strokes: list[Stroke] = []
    end, window_before = _REST, math.inf
    for a, b in pairwise(targets):
        ease = (math.dist(a, b) / _ARC_LEG) ** ISOCHRONY
        window = round(_ARC_WINDOW * ease * draw(*_VARIABILITY), 3)
        overlap = draw(*_OVERLAP) * min(window, window_before) if strokes else 0.0
        start = round(end - overlap, 3)
        timing = TwoSidedTiming(start, window, draw(*_SIGMA))
        strokes.append(Stroke(timing, arc_angle=draw(*_ARC_ANGLE), tilt=draw(-math.pi, math.pi)))
        end, window_before = start + window, window
    return SigmaLognormal(targets, tuple(strokes), round(end + _REST, 3))
