"""Twins: the same target points in the same time, by every other generator.

A twin is made from the movement of the paper's recipe and keeps its duration and, but for the duplicate, its
target points; whether it keeps the durations of its strokes, too, depends on the model. `GENERATORS` says
both for each. So what is compared are the models, not sizes or speeds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from pc_client.errors import MovementError
from pc_client.movements.durations import DurationRule, Fitts, Isochrony, retimed
from pc_client.movements.minimum_jerk import MinimumJerk, Passing
from pc_client.movements.movement import Movement
from pc_client.movements.power_law import TORSION_EXPONENT, TWO_THIRDS, PowerLaw
from pc_client.movements.recipes import arcs_twin
from pc_client.movements.robotic import Corners, RoboticTrajectory
from pc_client.movements.sigma_lognormal import SigmaLognormal
from pc_client.movements.variability import duplicate

__all__ = [
    "GENERATORS",
    "RAMPS",
    "SETBACK",
    "Generator",
    "retimed_twin",
    "robotic_trajectory",
    "robotic_twin",
]

#: The two boxcars (s) that smooth the square wave of a robot-like movement: together they last as long as the
#: ramp that a UR makes by itself, movel's default speed over its default acceleration, .25 m/s / 1.2 m/s^2 =
#: .21 s (Source: URScript manual, movel). Most of it bounds the acceleration, the rest the jerk.
RAMPS = (0.16, 0.05)
#: How far (m) a blended corner keeps from its target point along the lines.
SETBACK = 0.03
#: Overlap of re-timed strokes and rest before and after them (s): the middle of what new movements draw.
_OVERLAP, _REST = 0.425, 0.1
#: Each of the two ramps of a power-law movement, as a share of its mean stroke: together they take as long as
#: a stroke takes to its peak.
_RAMP_SHARE = 0.2
#: Radius (m) above which a path counts as straight: twice the reach of the arm.
_LARGEST_RADIUS = 1.0


def robotic_trajectory(
    target_points: ArrayLike, stroke_durations: ArrayLike, corners: Corners = "stop", setback: float = SETBACK
) -> RoboticTrajectory:
    """A constant speed a stroke, smoothed to ramps, on the straight lines between target points.

    Args:
        target_points: (n, 3), m.
        stroke_durations: (n - 1,), s.
        corners: come to rest at the inner target points, or blend them.
        setback: of blended corners, m: how far before and after a target point the path leaves the lines.

    Source: section II.C.
    """
    points, durations = (np.asarray(values, dtype=np.float64) for values in (target_points, stroke_durations))
    return RoboticTrajectory(points, durations, RAMPS, corners, setback if corners == "blend" else 0.0)


def robotic_twin(
    movement: Movement, name: str, corners: Corners = "stop", setback: float = SETBACK
) -> Movement:
    """The robot-like movement along the same target points with the same stroke durations.

    Args:
        movement: any movement with a stroke between each two target points.
        name: the twin's.
        corners: as of `robotic_trajectory`.
        setback: as of `robotic_trajectory`.
    """
    trajectory = robotic_trajectory(movement.target_points, movement.stroke_durations, corners, setback)
    return Movement(name, trajectory, movement.stroke_durations, _facts(movement))


def _minimum_jerk_twin(movement: Movement, name: str, passing: Passing = "stop") -> Movement:
    """The minimum-jerk movement to the same target points with the same stroke durations.

    Args:
        movement: any movement with a stroke between each two target points.
        name: the twin's.
        passing: whether it stops at the inner target points or passes through them at their times.
    """
    trajectory = MinimumJerk(movement.target_points, movement.stroke_durations, passing)
    return Movement(name, trajectory, movement.stroke_durations, _facts(movement))


def _power_law_twin(movement: Movement, name: str, *, torsion: bool = False) -> Movement:
    """The power-law movement through the same target points in the same total time.

    Args:
        movement: any movement.
        name: the twin's.
        torsion: whether the torsion of the path counts, too.
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
    """The human-like movement on the same arcs in the same total time, its strokes' windows by a rule.

    Args:
        movement: a "lognormal" one.
        name: the twin's.
        rule: how long a stroke lasts for its length.
    """
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
        says: what it is, for tables and help.
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


#: Every generator by the name that `ur-client movements generate --kind` takes, human-like ones first.
GENERATORS: Mapping[str, Generator] = MappingProxyType(
    {
        "lognormal": Generator(
            lambda human, _, name: human.renamed(name), "the paper's recipe: straight lognormal strokes", True
        ),
        "arcs": Generator(
            lambda human, seed, name: arcs_twin(human, seed, name), "arcs that overlap, lognormal strokes"
        ),
        "isochronous": Generator(
            lambda human, seed, name: _retimed_arcs(human, seed, name, Isochrony()),
            "the arcs with one mu and sigma",
        ),
        "fitts": Generator(
            lambda human, seed, name: _retimed_arcs(human, seed, name, Fitts()),
            "the arcs timed by Fitts' law",
        ),
        "duplicate": Generator(_duplicate, "lognormal, varied as between repetitions", same_targets=False),
        "minimum_jerk": Generator(
            lambda human, _, name: _minimum_jerk_twin(human, name),
            "minimum jerk, at rest at every target point",
            True,
        ),
        "minimum_jerk_via": Generator(
            lambda human, _, name: _minimum_jerk_twin(human, name, "via"),
            "minimum jerk through the target points",
            True,
        ),
        "power_law": Generator(
            lambda human, _, name: _power_law_twin(human, name), "two-thirds power law on a smooth path"
        ),
        "power_law_3d": Generator(
            lambda human, _, name: _power_law_twin(human, name, torsion=True),
            "power law with the factor of torsion",
        ),
        "uniform": Generator(
            lambda human, _, name: robotic_twin(human, name),
            "trapezoids, at rest at every target point",
            True,
        ),
        "uniform_blend": Generator(
            lambda human, _, name: robotic_twin(human, name, "blend"),
            "levels of speed, corners blended by 30 mm",
            True,
        ),
    }
)
