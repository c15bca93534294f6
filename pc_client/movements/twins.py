"""Twins: the same target points in the same time, by every other generator.

A twin is made from a human-like movement and keeps its target points and its duration; whether it keeps the
durations of its strokes, too, is up to the law: `GENERATORS` says it for each. So what is compared are the
laws, not sizes or speeds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from pc_client.errors import MovementError
from pc_client.movements.durations import DurationRule, Fitts, Isochrony, retimed
from pc_client.movements.minimum_jerk import MinimumJerk, Passing
from pc_client.movements.movement import Movement
from pc_client.movements.power_law import TORSION_EXPONENT, TWO_THIRDS, PowerLaw
from pc_client.movements.robotic import Corners, RoboticLaw
from pc_client.movements.sigma_lognormal import SigmaLognormal
from pc_client.movements.variability import duplicate

__all__ = [
    "GENERATORS",
    "Generator",
    "RobotRules",
    "minimum_jerk_twin",
    "power_law_twin",
    "retimed_twin",
    "robotic_twin",
]

#: Overlap of re-timed strokes and rest before and after them (s): the middle of what new movements draw.
_OVERLAP, _REST = 0.425, 0.1
#: Each of the two ramps of a power-law movement, as a share of its mean stroke: together they take as long as
#: a stroke takes to its peak.
_RAMP_SHARE = 0.2
#: Radius (m) above which a path counts as straight: twice the reach of the arm.
_LARGEST_RADIUS = 1.0


@dataclass(frozen=True, slots=True)
class RobotRules:
    """The profile of robot-like movements: see `RoboticLaw`.

    The ramps together last as long as those that a UR makes by itself: movel's default speed over its default
    acceleration, .25 m/s / 1.2 m/s^2 = .21 s (Source: URScript manual, movel). Most of it bounds the
    acceleration, the rest the jerk. To stop at the target points is what a UR does on movel without a blend
    radius.
    """

    ramps: tuple[float, ...] = (0.16, 0.05)
    corners: Corners = "stop"
    blend: float = 0.0


def robotic_twin(movement: Movement, name: str, rules: RobotRules | None = None) -> Movement:
    """The robot-like movement along the same target points with the same stroke durations.

    Args:
        movement: any movement with a stroke between each two target points.
        name: the twin's.
        rules: its profile; defaults if None.
    """
    rules = rules or RobotRules()
    law = RoboticLaw(
        movement.target_points, movement.stroke_durations, rules.ramps, rules.corners, rules.blend
    )
    return Movement(name, law, movement.stroke_durations, _facts(movement))


def minimum_jerk_twin(movement: Movement, name: str, passing: Passing = "stop") -> Movement:
    """The minimum-jerk movement to the same target points with the same stroke durations.

    Args:
        movement: any movement with a stroke between each two target points.
        name: the twin's.
        passing: whether it stops at the inner target points or passes through them at their times.
    """
    law = MinimumJerk(movement.target_points, movement.stroke_durations, passing)
    return Movement(name, law, movement.stroke_durations, _facts(movement))


def power_law_twin(movement: Movement, name: str, *, torsion: bool = False) -> Movement:
    """The power-law movement through the same target points in the same total time.

    Args:
        movement: any movement.
        name: the twin's.
        torsion: whether the torsion of the path counts, too.
    """
    ramp = _RAMP_SHARE * float(np.mean(movement.stroke_durations))
    law = PowerLaw(
        movement.target_points,
        movement.duration,
        (ramp, ramp),
        _LARGEST_RADIUS,
        TWO_THIRDS,
        TORSION_EXPONENT if torsion else 0.0,
    )
    return Movement(name, law, np.diff(law.passages), _facts(movement))


def retimed_twin(movement: Movement, name: str, rule: DurationRule) -> Movement:
    """The human-like movement on the same arcs in the same total time, its strokes' windows by a rule.

    Args:
        movement: a "lognormal" one.
        name: the twin's.
        rule: how long a stroke lasts for its length.
    """
    if not isinstance(movement.law, SigmaLognormal):
        raise MovementError(
            f"movement {movement.name} is of kind {movement.kind}: give a lognormal one to re-time"
        )
    law = retimed(movement.law, rule, overlap=_OVERLAP, rest=_REST)
    boundaries = np.concatenate(([0.0], law.speed_minima(), [law.duration]))
    return Movement(name, law, np.diff(boundaries), _facts(movement))


@dataclass(frozen=True, slots=True)
class Generator:
    """One way to make a movement.

    Attributes:
        make: from the human-like movement, a seed and the new movement's name.
        says: what it is, for tables and help.
        same_strokes: whether the strokes last as long as those of the human-like movement; the whole always
            does.
    """

    make: Callable[[Movement, int, str], Movement]
    says: str
    same_strokes: bool


def _facts(movement: Movement) -> dict[str, str | int | float]:
    return {**movement.provenance, "twin": movement.name}


def _duplicate(movement: Movement, seed: int, name: str) -> Movement:
    varied = duplicate(movement, seed, name=name)
    return varied.stretched(movement.duration / varied.duration)


#: Every generator by the name that `ur-client movements generate --kind` takes, human-like ones first.
GENERATORS: Mapping[str, Generator] = MappingProxyType(
    {
        "lognormal": Generator(
            lambda human, _, name: human.renamed(name), "overlapping lognormal strokes", True
        ),
        "isochronous": Generator(
            lambda human, _, name: retimed_twin(human, name, Isochrony()),
            "lognormal strokes with one mu and sigma",
            False,
        ),
        "fitts": Generator(
            lambda human, _, name: retimed_twin(human, name, Fitts()),
            "lognormal strokes timed by Fitts' law",
            False,
        ),
        "duplicate": Generator(_duplicate, "lognormal strokes, varied as between repetitions", False),
        "minimum_jerk": Generator(
            lambda human, _, name: minimum_jerk_twin(human, name),
            "minimum jerk, at rest at every target point",
            True,
        ),
        "minimum_jerk_via": Generator(
            lambda human, _, name: minimum_jerk_twin(human, name, "via"),
            "minimum jerk through the target points",
            True,
        ),
        "power_law": Generator(
            lambda human, _, name: power_law_twin(human, name),
            "two-thirds power law on a smooth path",
            False,
        ),
        "power_law_3d": Generator(
            lambda human, _, name: power_law_twin(human, name, torsion=True),
            "power law with the factor of torsion",
            False,
        ),
        "uniform": Generator(
            lambda human, _, name: robotic_twin(human, name),
            "trapezoids, at rest at every target point",
            True,
        ),
        "uniform_blend": Generator(
            lambda human, _, name: robotic_twin(human, name, RobotRules(corners="blend", blend=0.03)),
            "levels of speed, corners blended by 30 mm",
            True,
        ),
    }
)
