"""How long a stroke lasts for its length: isochrony and Fitts' law, and strokes re-timed by them.

Both rules set the proportions between the strokes of one movement; the total is that of the movement. People
draw large and small in nearly the same time (isochrony, T = a D^b with b of .1 to .5, here 0 for the pure
case: the theory's mu and sigma are kept and only D scales). When they must hit a target they take longer
for a farther and a smaller one (Fitts, T = a + b log2(2 D / W)).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pc_client.arrays import Array
from pc_client.errors import MovementError
from pc_client.movements.lognormal import LiteralTiming, TwoSidedTiming
from pc_client.movements.sigma_lognormal import LEAD, SigmaLognormal, Stroke, leg_lengths


@dataclass(frozen=True, slots=True)
class Isochrony:
    """T = scale (D / 1 m)^exponent.

    Attributes:
        exponent: 0 is strict isochrony, 1 a constant mean speed.
        scale: s, for a stroke of 1 m.
    """

    exponent: float = 0.0
    scale: float = 1.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.exponent) and math.isfinite(self.scale) and self.scale > 0.0):
            raise MovementError(
                f"isochrony with exponent {self.exponent} and scale {self.scale} s: "
                "give finite numbers, the scale above 0"
            )

    def durations(self, lengths: Array) -> Array:
        """Durations (n,), s, of strokes of these lengths (n,), m."""
        return self.scale * lengths**self.exponent


@dataclass(frozen=True, slots=True)
class Fitts:
    """T = intercept + slope log2(2 D / width).

    Attributes:
        intercept: s.
        slope: s/bit; people reach with .1 to .2.
        width: of the target, m.
    """

    intercept: float = 0.1
    slope: float = 0.15
    width: float = 0.02

    def __post_init__(self) -> None:
        if not (
            self.slope >= 0.0 and self.width > 0.0 and math.isfinite(self.intercept + self.slope + self.width)
        ):
            raise MovementError(
                f"Fitts' law with slope {self.slope} s/bit and width {self.width} m: "
                "give a slope of 0 or more and a width above 0"
            )

    def durations(self, lengths: Array) -> Array:
        """Durations (n,), s, of strokes of these lengths (n,), m.

        Raises:
            MovementError: a stroke so short against the target's width that the rule gives it no time.
        """
        durations = self.intercept + self.slope * np.log2(2.0 * lengths / self.width)
        if not np.all(durations > 0.0):
            raise MovementError(
                f"Fitts' law gives a stroke of {lengths.min():.4f} m to a target of {self.width} m no time; "
                "give a smaller width"
            )
        return durations


DurationRule = Isochrony | Fitts
"""How long a stroke lasts for its length."""


def chained_windows(proportions: ArrayLike, total: float, overlap: float) -> tuple[Array, Array]:
    """Windows in these proportions, each overlapping the next, that together last a total.

    Args:
        proportions: (n,), above 0.
        total: from the start of the first window, 0, to the end of the last, s.
        overlap: share of the shorter of two windows in which both are open, 0 to below 1.

    Returns:
        Begins and lengths of the windows, each (n,), s.
    """
    shape = np.asarray(proportions, dtype=np.float64)
    if not (shape.ndim == 1 and len(shape) and np.all(np.isfinite(shape)) and np.all(shape > 0.0)):
        raise MovementError(f"windows in proportions {shape.tolist()}: give numbers above 0")
    if not (math.isfinite(total) and total > 0.0 and 0.0 <= overlap < 1.0):
        raise MovementError(
            f"windows of {total} s that overlap by {overlap}: give a time above 0, an overlap in [0, 1)"
        )
    shared = overlap * np.minimum(shape[:-1], shape[1:])
    begins = np.concatenate(([0.0], np.cumsum(shape[:-1] - shared)))
    scale = total / float(begins[-1] + shape[-1])
    return scale * begins, scale * shape


def retimed(trajectory: SigmaLognormal, rule: DurationRule, *, overlap: float, rest: float) -> SigmaLognormal:
    """The same arcs with windows by a rule, one sigma (the mean) and one overlap, in the same total time.

    Args:
        trajectory: whose target points, arcs and duration are kept.
        rule: how long a stroke lasts for the distance of its two target points.
        overlap: as of `chained_windows`.
        rest: time at rest before the first and after the last window, s.
    """
    if not 0.0 <= 2.0 * rest < trajectory.duration:
        raise MovementError(
            f"rests of {rest} s in a movement of {trajectory.duration} s: give less than half of it"
        )
    sigma = float(np.mean([stroke.timing.lognormal.sigma for stroke in trajectory.strokes]))
    durations = rule.durations(leg_lengths(trajectory.target_points))
    begins, windows = chained_windows(durations, trajectory.duration - 2.0 * rest, overlap)
    strokes = tuple(
        Stroke(TwoSidedTiming(rest + begin, window, sigma), stroke.arc_angle, stroke.tilt)
        for begin, window, stroke in zip(begins.tolist(), windows.tolist(), trajectory.strokes, strict=True)
    )
    return SigmaLognormal(trajectory.target_points, strokes, trajectory.duration)


#: Of the recipe: a stroke lasts in proportion to its length to this power, since people need hardly more time
#: for longer strokes.
ISOCHRONY = 0.3
#: Largest speed of the tool, m/s: movel's default, and within what a UR3 can do in any direction in its box.
TOP_SPEED = 0.25
#: Least default duration of a stroke, s: very short strokes would need more acceleration than speed.
_SHORTEST = 1.0


def default_durations(points: ArrayLike) -> Array:
    """How long the strokes between points (n, 3), m, last by themselves, (n - 1,), s.

    In the proportions of the recipe (length to the power .3), as quick as its top speed allows the human-like
    movement, but at least 1 s each; in whole milliseconds.
    """
    legs = leg_lengths(points)
    proportions = Isochrony(ISOCHRONY).durations(legs)
    speeds = LiteralTiming(0.0, 1.0, LEAD).lognormal.peak * legs / proportions
    durations = np.ceil(1e3 * proportions * float(speeds.max()) / TOP_SPEED) / 1e3
    return np.maximum(durations, _SHORTEST)
