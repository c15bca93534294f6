"""Human variability: the same movement as a person would repeat it.

People repeat a movement with other parameters of its strokes, within ranges that were published for
handwriting. Some of those are relative to quantities that depend on the choice of a unit or an axis. They are
used here in this form:

    length    each stroke's D, relative
    sigma     each stroke's sigma, relative
    rhythm    t0, relative: one factor for the whole movement, on the times between commands. Where t0 counts
              from is arbitrary, the times between are not
    pace      mu, relative to its value *in human time*: mu is the logarithm of a number of seconds, so a
              relative change of it means nothing until the unit of time is fixed, and would change its sign
              at exp(mu) = 1 s. A slow movement is therefore thought of as sped up until its median stroke
              lasts as long as a hand's, .15 s; there mu is about -2, and 10 % of it are a factor of 1.2 in
              time. One draw for the whole movement
    angles    theta_s and theta_e of each stroke, in the plane of its arc, relative to a quarter turn, the
              mean size of an angle of any direction: space has no axis from which they could be measured

Rhythm and pace are drawn once a movement because they are properties of it: drawn for each stroke, mu's range
alone would move strokes by half of their time against each other and put them out of order.

Source: ranges attributed to M. Diaz et al., "Dynamic signature verification system based on one real
signature", as an open implementation of the kinematic theory states them (it, too, draws one change of t0
for all strokes, and finds angles relative to themselves unfit).
"""

import math
import random
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pc_client.arrays import Array
from pc_client.errors import MovementError
from pc_client.movements.lognormal import FULL_COVERAGE, Lognormal
from pc_client.movements.movement import Movement
from pc_client.movements.sigma_lognormal import SigmaLognormal, Stroke, arc_frame, sinc, tilt_of_normal

#: Time (s) between speed minima that a hand takes for a stroke. Source: the median of five public signatures.
HUMAN_STROKE = 0.15
#: An arc angle is less than a whole turn; varied arc angles are held below this, rad.
_MAX_ARC_ANGLE = 6.2


@dataclass(frozen=True, slots=True)
class VariabilityRanges:
    """Least and greatest relative change of each parameter; drawn evenly between."""

    length: tuple[float, float] = (-0.10, 0.10)
    rhythm: tuple[float, float] = (-0.085, 0.0825)  # of t0
    pace: tuple[float, float] = (-0.3775, 0.395)  # of mu
    sigma: tuple[float, float] = (-0.2875, 0.325)
    theta_start: tuple[float, float] = (-0.015, 0.03)
    theta_end: tuple[float, float] = (-0.015, 0.0275)


PUBLISHED = VariabilityRanges()


def duplicate(
    movement: Movement,
    seed: int,
    *,
    name: str | None = None,
    share: float = 1.0,
    ranges: VariabilityRanges = PUBLISHED,
) -> Movement:
    """The movement as a person might repeat it, by a seed.

    It begins at the same point with the same rest before and after; its other target points move, because its
    strokes have other lengths and directions. Planning checks whether an arm can execute it.

    Args:
        movement: a "lognormal" one.
        seed: 0 or more; the same seed gives the same duplicate everywhere.
        name: the duplicate's; made from name and seed if None.
        share: how much of the ranges is used: 0 gives the movement itself, 1 all of them.

    Raises:
        MovementError: another kind of movement, or a share outside of 0 to 1.
    """
    trajectory = movement.trajectory
    if not isinstance(trajectory, SigmaLognormal):
        raise MovementError(
            f"movement {movement.name} is of kind {movement.kind}: only lognormal strokes have the "
            "parameters that people vary; give a lognormal movement"
        )
    if not 0.0 <= share <= 1.0:
        raise MovementError(f"share {share} of the human variability: give a number from 0 to 1")
    if seed < 0:
        raise MovementError(f"seed {seed}: give a whole number, 0 or more")
    source = random.Random(seed)

    def draw(limits: tuple[float, float]) -> float:
        low, high = limits
        return share * (low + (high - low) * source.random())

    lognormals = _vary_timing(trajectory, float(np.median(movement.stroke_durations)), draw, ranges)
    targets, strokes = _vary_arcs(trajectory, lognormals, draw, ranges)
    varied = _framed(targets, strokes, trajectory)
    facts: dict[str, str | int | float] = {
        "duplicate_of": movement.name,
        "variation_seed": seed,
        "variation_share": share,
    }
    name = name or f"{movement.name}_v{seed}"
    return Movement(name, varied, _durations(varied), {**movement.provenance, **facts})


def _vary_timing(
    trajectory: SigmaLognormal,
    stroke_time: float,
    draw: Callable[[tuple[float, float]], float],
    ranges: VariabilityRanges,
) -> list[Lognormal]:
    lognormals = [stroke.timing.lognormal for stroke in trajectory.strokes]
    to_human = math.log(stroke_time / HUMAN_STROKE)
    rhythm, pace = 1.0 + draw(ranges.rhythm), draw(ranges.pace)
    first = lognormals[0].t0
    return [
        Lognormal(
            first + rhythm * (lognormal.t0 - first),
            lognormal.mu + pace * (lognormal.mu - to_human),
            lognormal.sigma * (1.0 + draw(ranges.sigma)),
        )
        for lognormal in lognormals
    ]


def _vary_arcs(
    trajectory: SigmaLognormal,
    lognormals: list[Lognormal],
    draw: Callable[[tuple[float, float]], float],
    ranges: VariabilityRanges,
) -> tuple[Array, tuple[Stroke, ...]]:
    """New arcs, each in the plane of the old one, end to end from the same first point."""
    points = trajectory.target_points
    targets, strokes = [points[0]], []
    for a, b, stroke, length, lognormal in zip(
        points[:-1], points[1:], trajectory.strokes, trajectory.lengths.tolist(), lognormals, strict=True
    ):
        chord, normal = arc_frame(a, b, stroke.tilt)
        length = length * (1.0 + draw(ranges.length))
        begins, ends = (0.5 * math.pi * draw(limits) for limits in (ranges.theta_start, ranges.theta_end))
        arc_angle = min(max(stroke.arc_angle + ends - begins, -_MAX_ARC_ANGLE), _MAX_ARC_ANGLE)
        swing = 0.5 * (begins + ends)
        new_chord = math.cos(swing) * chord + math.sin(swing) * normal
        new_normal = math.cos(swing) * normal - math.sin(swing) * chord
        targets.append(targets[-1] + length * float(sinc(0.5 * arc_angle)) * new_chord)
        strokes.append(Stroke(lognormal, arc_angle, tilt_of_normal(new_chord, new_normal)))
    return np.array(targets), tuple(strokes)


def _framed(targets: Array, strokes: tuple[Stroke, ...], trajectory: SigmaLognormal) -> SigmaLognormal:
    """The strokes shifted and the end set so that the rests before and after are those of the trajectory."""
    old_begin, old_end = _extent(trajectory.strokes)
    begin, end = _extent(strokes)
    rest_before, rest_after = max(old_begin, 0.0), max(trajectory.duration - old_end, 0.0)
    shift = rest_before - begin
    moved = tuple(stroke.later(shift) for stroke in strokes)
    return SigmaLognormal(targets, moved, end + shift + rest_after)


def _extent(strokes: tuple[Stroke, ...]) -> tuple[float, float]:
    """When the first tail begins and the last one ends, s."""
    lognormals = [stroke.timing.lognormal for stroke in strokes]
    return (
        min(lognormal.time_at_deviation(-FULL_COVERAGE) for lognormal in lognormals),
        max(lognormal.time_at_deviation(FULL_COVERAGE) for lognormal in lognormals),
    )


def _durations(trajectory: SigmaLognormal) -> Array:
    """Times between speed minima; strokes that merged into one count as one."""
    inner = np.unique(trajectory.speed_minima())
    inner = inner[(inner > 1e-3) & (inner < trajectory.duration - 1e-3)]
    return np.diff(np.concatenate(([0.0], inner, [trajectory.duration])))
