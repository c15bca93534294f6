"""`drawing`: what a hand drew, as a movement of an arm.

The strokes of a recording are extracted, placed in the workspace, joined with lifts between them, and slowed
down as far as the arm needs it. Strokes of marks and of lifts add up alike, so all stand in one chain of
target points: one stroke lowers the pen, each mark has its own strokes, a pen-up move between two marks has
two that overlap in time, over a via point above the sheet, and one stroke lifts the pen at the end.

Each mark keeps its strokes, shape and timing. Only the gaps between marks may become longer: where a tail
of a mark's strokes would reach into its neighbour, or where a pen-up move needs more time. Strokes of lifts
lie in the gaps but for `TAIL` of their length at either end; `TAIL` of the drawing's size is also what a mark
may move while its neighbour is drawn.

One factor says how slow the whole must be. Slowed down by a factor a, on the same path, joint speeds fall by
a and joint accelerations by a^2; so one plan gives the factor that each moment needs. Marks come first: they
are what is drawn. A pen-up move that would need a larger factor than they do gets more time instead, and the
marks behind it come later.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import find_peaks
from scipy.special import ndtri

from pc_client.arm import Arm
from pc_client.arrays import Array, read_only
from pc_client.errors import MovementError, RecordingError
from pc_client.kinematics.model import RobotModel
from pc_client.movements.lognormal import TwoSidedTiming
from pc_client.movements.movement import Movement
from pc_client.movements.sigma_lognormal import SigmaLognormal, Stroke
from pc_client.movements.trajectory import Motion
from pc_client.planning.limits import limits_of
from pc_client.planning.plan import DEFAULT_DT, plan_movement
from pc_client.studies.drawing.placement import Mark, Placement, PlacementOptions, inverse, marks_of, place
from pc_client.studies.extraction.extract import Extraction, extract
from pc_client.studies.extraction.pen import PenRecording, on_one_axis, ordered_part, read_recording


def drawing(
    source: str | Path | Sequence[tuple[ArrayLike, ArrayLike]],
    arm: Arm,
    *,
    name: str = "drawing",
    plane: str = "vertical",
    size: float = 0.1,
    slower: float = 1.0,
) -> Drawing:
    """Extract the lognormal strokes of a drawing and make them a movement of an arm.

    Args:
        source: a file of pen samples (docs/extraction.md), or its parts: for each time that the pen was down,
            times (n,) [s] and positions (n, 2) or (n, 3) in any unit.
        arm: that shall execute it.
        name: of the movement.
        plane: of the sheet: "vertical", "horizontal" or "inclined".
        size: longest side of the drawing [m]; never larger than the workspace.
        slower: factor of time beyond the limits of the arm, >= 1.

    Returns:
        The drawing; `arm.run(drawing.movement)` executes it.

    Raises:
        ClientError: the file or the samples are not valid, or the arm cannot execute it.
    """
    recording = read_recording(source) if isinstance(source, str | Path) else _recording(name, source)
    options = PlacementOptions(plane=plane, size=size, box=arm.model.description.working_box)
    return make_drawing(extract(recording), name, arm.model, options, slower)


def _recording(name: str, parts: Sequence[tuple[ArrayLike, ArrayLike]]) -> PenRecording:
    ordered = [ordered_part(t, p) for t, p in parts]
    kept = [part for part, _ in ordered if part is not None]
    if not kept:
        raise RecordingError(f"{name}: no samples; give parts of times (n,) and positions (n, 2)")
    return on_one_axis(name, kept, [remark for _, remarks in ordered for remark in remarks])


@dataclass(frozen=True, slots=True, eq=False)
class Drawing:
    """A drawing as the arm executes it.

    Attributes:
        marks: its parts and dots, in the recording's frame and time.
        drawn: what the pen draws, dots included, in the recording's frame and unit, (n, 3).
        joined: all of it in one movement, base frame, as fast as the hand was.
        factor: how many times slower than the hand the arm is.
        movement: what the arm shall do.
    """

    extraction: Extraction
    marks: tuple[Mark, ...]
    drawn: Array
    placement: Placement
    joined: Joined
    factor: float
    movement: Movement

    @property
    def flat(self) -> bool:
        """Whether the recording is flat."""
        return self.placement.plane != "space"

    @property
    def moving(self) -> list[int]:
        """Indices of the marks that move: those of the extraction's parts, in their order."""
        return [index for index, mark in enumerate(self.marks) if mark.trajectory is not None]

    @property
    def delays(self) -> Array:
        """How much later after the first mark each one comes than recorded, (n_marks,), s of the hand."""
        at: Array = self.joined.shifts - self.joined.shifts[0]
        return at

    def arm_time(self, t: Array, mark: int) -> Array:
        """Time of the movement (s, arm) at times of the recording (s) that belong to a mark."""
        at: Array = (t + self.joined.shifts[mark]) * self.factor
        return at

    def recording_time(self, t: Array, mark: int) -> Array:
        """Time of the recording (s) at times of the movement (s, arm), for a mark; inverse of `arm_time`."""
        at: Array = t / self.factor - self.joined.shifts[mark]
        return at

    def points_back(self, p: Array) -> Array:
        """Points of the base frame (n, 3), m, in the recording's frame and unit."""
        return inverse(self.placement.similarity).points(p)

    def planned(self, t: Array, mark: int) -> Motion:
        """The plan at times of the recording that belong to a mark, in its frame, unit and time."""
        plan = self.joined.trajectory.transformed(inverse(self.placement.similarity))
        return plan.evaluate(t + self.joined.shifts[mark])


def make_drawing(
    extraction: Extraction,
    name: str,
    arm: RobotModel,
    options: PlacementOptions | None = None,
    slower: float = 1.0,
) -> Drawing:
    """Make a drawing ready for an arm.

    Args:
        slower: times slower than the arm's limits ask, >= 1: leaves room for a controller's corrections.

    Raises:
        MovementError: nothing in it moves, or `slower` is below 1.
        PlanningError: the arm cannot do it at any speed; the message is planning's.
    """
    if not (math.isfinite(slower) and slower >= 1.0):
        raise MovementError(f"{slower:g} times slower than the limits ask: give 1 or more")
    options = options or PlacementOptions()
    marks = marks_of(extraction)
    lines = [spatial(part.p) for part in extraction.parts]
    drawn = np.vstack([*lines, *(mark.first for mark in marks if mark.trajectory is None)])
    placement = place(marks, drawn, options, flat=extraction.parts[0].p.shape[1] == 2)
    on_arm = [mark.transformed(placement.similarity) for mark in marks]
    size = placement.similarity.scale * float(np.ptp(drawn, axis=0).max())
    joined, need = _paced(name, on_arm, least_gaps(on_arm, size), placement.lift, arm)
    factor = slower * max(1.0, need * (1.0 + ACCURACY))
    trajectory = joined.trajectory.stretched(factor)
    facts: dict[str, str | int | float] = {
        "drawing": extraction.name.rpartition("/")[2],
        "plane": placement.plane,
        "metres_per_unit": placement.similarity.scale,
        "rotation_deg": float(np.degrees(placement.rotation)),
        "marks": len(joined.shifts),
        "lift_m": float(np.linalg.norm(placement.lift)),
        "slower_than_the_hand": factor,
    }
    movement = Movement(name, trajectory, _between_slow_moments(trajectory), facts)
    return Drawing(extraction, marks, read_only(drawn), placement, joined, factor, movement)


def spatial(p: Array) -> Array:
    """Points (n, 2) with a third coordinate 0; points (n, 3) as they are."""
    return p if p.shape[1] == 3 else np.column_stack((p, np.zeros(len(p))))


def _between_slow_moments(trajectory: SigmaLognormal) -> Array:
    """Times (s) between the speed minima of a movement, its start and its end."""
    t = np.linspace(0.0, trajectory.duration, max(200, int(500 * trajectory.duration)))
    slow, _ = find_peaks(-np.linalg.norm(trajectory.evaluate(t).v, axis=1))
    return np.diff(np.concatenate(([0.0], t[slow], [trajectory.duration])))


#: Share of a lift's length outside its gap, and of the drawing's size that a mark moves beside its
#: neighbours.
TAIL = 1e-3
#: Share of the drawing's size that may be left to do before the movement begins and after it ends.
_REST = 1e-4
#: Least time, s of the hand, to lower the pen at the start and to lift it at the end.
_LOWERING_S = 0.4
#: Least time, s of the hand, between two marks.
_LEAST_GAP_S = 0.1
#: Of each of the two strokes of a pen-up move, as a share of the gap: they overlap in its middle.
_PEN_UP_SHARE = 0.7
#: Sigma of the lognormals of lifts; people show .1 to .35 in reaches.
_LIFT_SIGMA = 0.15
_COVERAGE = -float(ndtri(TAIL))


@dataclass(frozen=True, slots=True, eq=False)
class Joined:
    """Marks and lifts in one movement.

    Attributes:
        trajectory: all strokes; the movement begins at 0 at rest, the pen lifted.
        shifts: (n_marks,), s: time of the movement less time of the recording, for each mark.
        pen_down: (n_marks, 2), s: when in the movement the pen comes down and goes up.
    """

    trajectory: SigmaLognormal
    shifts: Array
    pen_down: Array

    @property
    def gaps(self) -> Array:
        """(n_marks + 1, 2), s: start and end of each gap, before the first mark to after the last."""
        return np.array([0.0, *self.pen_down.ravel(), self.trajectory.duration]).reshape(-1, 2)


def least_gaps(marks: Sequence[Mark], size: float) -> Array:
    """The gaps that the recording has, or longer where strokes need it; (n_marks + 1,), s.

    The marks are in order of time; tails are judged by the size of the drawing, in the unit of the marks.
    """
    between = [
        max(b.begin - a.end, a.lag(TAIL * size), b.lead(TAIL * size), _LEAST_GAP_S)
        for a, b in pairwise(marks)
    ]
    before, after = marks[0].lead(_REST * size), marks[-1].lag(_REST * size)
    return np.array([max(before, _LOWERING_S), *between, max(after, _LOWERING_S)])


def join(marks: Sequence[Mark], gaps: Array, lift: Array) -> Joined:
    """Join marks, m, in the frame of the arm, with the pen lifted between them.

    Args:
        marks: in order of time, on the recording's time axis.
        gaps: (n_marks + 1,), s.
        lift: from the sheet to the lifted pen, (3,), m.
    """
    begins, ends = np.array([(mark.begin, mark.end) for mark in marks]).T
    ups = np.cumsum(gaps[:-1] + ends - begins)
    shifts = ups - ends
    targets, strokes = [marks[0].first + lift], [_lift_stroke(0.0, float(gaps[0]))]
    for row, mark in enumerate(marks):
        targets.append(mark.first)
        if mark.trajectory is not None:
            targets += list(mark.trajectory.target_points[1:])
            strokes += [stroke.later(float(shifts[row])) for stroke in mark.trajectory.strokes]
        up, gap = float(ups[row]), float(gaps[row + 1])
        if row + 1 < len(marks):
            targets.append(0.5 * (mark.last + marks[row + 1].first) + lift / _pen_up_height())
            share = _PEN_UP_SHARE * gap
            strokes += [_lift_stroke(up, share), _lift_stroke(up + gap - share, share)]
        else:
            targets.append(mark.last + lift)
            strokes.append(_lift_stroke(up, gap))
    trajectory = SigmaLognormal(np.array(targets), tuple(strokes), float(ups[-1] + gaps[-1]))
    return Joined(trajectory, read_only(shifts), read_only(np.column_stack((begins + shifts, ups))))


def _lift_stroke(start: float, duration: float) -> Stroke:
    return Stroke(TwoSidedTiming(start, duration, _LIFT_SIGMA, _COVERAGE))


@lru_cache(maxsize=1)
def _pen_up_height() -> float:
    """Height of a pen-up move over that of its via point: its two strokes cut the corner there."""
    t = np.linspace(0.0, 1.0, 20001)
    up = _lift_stroke(0.0, _PEN_UP_SHARE).timing.lognormal.evaluate(t).done
    down = _lift_stroke(1.0 - _PEN_UP_SHARE, _PEN_UP_SHARE).timing.lognormal.evaluate(t).done
    return float((up - down).max())


#: By how much the factor is larger than the need, which other samples of the same path show a little less.
ACCURACY = 1e-3
#: Pen-up moves with this time, s of the hand, hold nothing up.
_WIDE_GAP_S = 3.0
#: A pen-up move that is too fast gets this much more time at least and at most, per attempt.
_LONGER = (1.03, 1.5)
_ATTEMPTS = 40
#: Most way, m, between two samples of a path.
_STEP = 0.0012


def factor_needed(name: str, joined: Joined, arm: RobotModel) -> tuple[Array, Array]:
    """The factor that each moment of a movement, as fast as the hand was, needs on an arm.

    Returns:
        Times (n,), s of the hand, and factors (n,); below 1 there is room.

    Raises:
        PlanningError: the path itself cannot be done, at any speed.
    """
    movement = Movement(name, joined.trajectory, np.array([joined.trajectory.duration]))
    fastest = float(movement.speed(np.linspace(0.0, movement.duration, 2001)).max())
    limits = limits_of(arm)
    no_speeds = replace(limits, speed_fraction=1e6, qdd_max=(1e9,) * 6, tcp_speed_max=1e6, rest_speed_max=1e6)
    plan = plan_movement(movement, model=arm, dt=min(DEFAULT_DT, _STEP / fastest), limits=no_speeds)
    qd = np.abs(plan.spline.sample(plan.t)[1]) / (limits.speed_fraction * np.array(arm.limits.qd_max))
    qdd = np.abs(plan.spline.qdd(plan.t)) / np.array(limits.qdd_max)
    tcp = movement.speed(plan.t) / limits.tcp_speed_max
    tcp[[0, -1]] *= limits.tcp_speed_max / limits.rest_speed_max
    need = np.maximum(np.maximum(qd.max(axis=1), np.sqrt(qdd.max(axis=1))), tcp)
    return plan.t, need


def _paced(
    name: str, marks: Sequence[Mark], gaps: Array, lift: Array, arm: RobotModel
) -> tuple[Joined, float]:
    """Join marks with pen-up moves that ask no more of the arm than the marks do; return the factor, too.

    Args:
        marks: in order of time, m, base frame.
        gaps: the least ones, (n_marks + 1,), s of the hand.
        lift: from the sheet to the lifted pen, (3,), m.

    Raises:
        PlanningError: the path itself cannot be done, at any speed.
    """
    slow = join(marks, np.maximum(gaps, _WIDE_GAP_S), lift)
    allowed = max(1.0, float(factor_needed(name, slow, arm)[1].max()))
    gaps = gaps.copy()
    for _ in range(_ATTEMPTS):
        joined = join(marks, gaps, lift)
        t, need = factor_needed(name, joined, arm)
        worst = np.array([need[(t >= start) & (t <= end)].max(initial=0.0) for start, end in joined.gaps])
        late = (worst > allowed * (1.0 + ACCURACY)) & (gaps < _WIDE_GAP_S)
        if not late.any():
            break
        gaps[late] *= np.clip(worst[late] / allowed, *_LONGER)
    return joined, float(need.max())
