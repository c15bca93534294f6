"""A chain of moves with blends between them: one generator for all of them.

The next move must be known before its blend begins, and the arm must be able to stop if there is none. So an
instruction with a blend radius returns to the script (`open`) when the arm must begin to brake in order to
stop before the blend. A move that is commanded then joins the chain (`follow`), and the speed of the whole
chain is planned again. Where waypoints are close together the script is several of them ahead of the arm. If
there is no further move, the arm stops at the last waypoint.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from enum import Enum
from itertools import accumulate
from math import dist
from typing import ClassVar

from ur_emulator.machine.models.robot_model import Vector6, six
from ur_emulator.machine.motion.blend import blend
from ur_emulator.machine.motion.generators import JointTarget, Kind
from ur_emulator.machine.motion.leg import Leg
from ur_emulator.machine.motion.path_segment import PathSegment, intervals_of
from ur_emulator.machine.motion.speed_plan import SmoothPlan, SpeedPlan, StoppingCurve, plan, stopping_curve

# If the arm is too fast for a blend, its radius is reduced by this factor, at most so many times.
_SHRINK, _ATTEMPTS = 0.7, 16
# A script has this many cycles to command the next move after the instruction returned.
_LEAD_CYCLES = 2


class Follow(Enum):
    """The result of `Move.follow`."""

    BLENDED = "the move joined the chain"
    SKIPPED = "its waypoint is left out, if the next move allows it"
    REFUSED = "the arm stops first"


class Move:
    """Moves along legs, with a blend from each to the next.

    Attributes:
        done: at rest at the last waypoint.
        returned: the script's instruction has returned: another move may follow.
        n_joined: moves that joined since the last cycle.
        left_out: the move after the last one of the chain, if its waypoint is left out for now.
    """

    kind: ClassVar[Kind] = Kind.MOVE

    def __init__(self, leg: Leg) -> None:
        """Plan a leg from rest to rest."""
        leg = leg.with_duration()
        self._cycle = self._time = self._time_before = 0.0
        segment = PathSegment.of(leg, leg, 0.0, 1.0)
        rest = plan(segment.intervals, 0.0)
        assert rest is not None
        is_smooth = leg.smoothing > 0.0 and leg.r <= 0.0 < rest.duration
        self._use(leg, 0.0, [segment], SmoothPlan(rest, leg.smoothing) if is_smooth else rest)
        # A move of length 0 may have a duration.
        self._wait = leg.t if leg.path.length <= 0.0 else 0.0
        self.done = self.duration <= 0.0
        self.returned = False
        self.n_joined = 0
        self.left_out: Leg | None = None

    @property
    def goal(self) -> Vector6 | None:
        """Joint angles at the next waypoint [rad]; None if the arm cannot reach it."""
        return self._segments[self._at(self._plan.at(self._time)[0])].leg.goal

    @property
    def leg(self) -> Leg:
        """The last leg that was commanded; the next one begins at its waypoint."""
        return self._leg if self.left_out is None else self.left_out

    @property
    def duration(self) -> float:
        """Time until the end of the plan, at a speed scaling of 1 [s]."""
        return max(self._plan.duration, self._wait) - self._time

    @property
    def open(self) -> bool:
        """True when the next move must be known now: later the arm brakes."""
        if self.done:
            return True
        if self._leg.r <= 0.0 or self._stopping is None:
            return False
        s, speed = self._plan.at(self._time + _LEAD_CYCLES * self._cycle)
        return not self._stopping.can_stop(s, speed)

    def follow(self, leg: Leg) -> Follow:
        """Append another leg, if the arm can still blend into it; its path begins at the waypoint of `leg`.

        A waypoint is left out if its blend overlaps with the one before it: the next move then begins at the
        waypoint before. If that is not possible, for an arc or where the arm would not arrive, the waypoint
        stays with a smaller blend.

        Source: URScript manual CB3 3.15, movej: "if the blend region of this move overlaps with the blend
        radius of previous or following waypoints, this move will be skipped". That it may stay is chosen.
        """
        if self.done or self._wait > 0.0 or self._leg.r <= 0.0:
            return Follow.REFUSED
        if (left_out := self.left_out) is not None:
            last = self._leg
            direct = None if last.goal is None else leg.starting_at(last.goal, last.goal_pose)
            if direct is not None:
                leg = direct
            elif not self._join(left_out):
                return Follow.REFUSED
        if leg.r > 0.0 and self._leg.r + leg.r > dist(self._leg.goal_pose[:3], leg.goal_pose[:3]):
            self.left_out = leg if leg.goal is not None and leg.path.length > 0.0 else None
            return Follow.SKIPPED
        return Follow.BLENDED if self._join(leg) else Follow.REFUSED

    def _join(self, leg: Leg) -> bool:
        """Blend from the last leg into another one; False if the arm is too fast for all blends."""
        s, speed = self._plan.at(self._time)
        ahead = self._ahead(s)
        last, radius = ahead[-1], self._leg.r
        second = leg.with_duration(from_blend=True)
        for _ in range(_ATTEMPTS):
            found = blend(self._leg, second, radius, min(self._zone, last.end - last.begin))
            if found is not None:
                segments = [
                    *ahead[:-1],
                    last.cut(end=found.leave),
                    PathSegment.of(found, second, 0.0, last.scale),
                    PathSegment.of(second, second, found.enter, last.scale * found.scale),
                ]
                planned = plan(intervals_of(segments), speed)
                if planned is not None:
                    self._use(second, found.enter, segments, planned)
                    self.left_out = None
                    self.returned = False
                    self.n_joined += 1
                    return True
            radius *= _SHRINK
        return False

    def step(self, target: JointTarget, dt: float, scale: float, rate: float | None = None) -> JointTarget:
        """Advance on the path by `scale * dt`; UnreachableError if the arm cannot reach the path there.

        `rate` is the speed scaling at the end of the cycle, if that is another one.
        """
        self._cycle = dt
        self.n_joined = 0
        time = self._time + scale * dt
        near = [p + dt * v for p, v in zip(target.q, target.qd, strict=True)]
        self._time_before, self._time = self._time, time
        if self.duration <= 0.0:
            q, _ = self._leg.path.at(self._leg.path.length, near)
            self.done = True
            return JointTarget(q)
        s, speed = self._plan.at(time)
        k = self._at(s)
        segment = self._segments[k]
        begin = self._ends[k - 1] if k > 0 else 0.0
        q, slope = segment.path.at(min(segment.begin + (s - begin) / segment.scale, segment.end), near)
        factor = (scale if rate is None else rate) * speed / segment.scale
        qd = six([factor * x for x in slope])
        return JointTarget(q, qd, six([(b - a) / dt for a, b in zip(target.qd, qd, strict=True)]))

    def take_back(self) -> None:
        """Undo the last step: its target was not accepted."""
        self._time = self._time_before

    def _use(
        self, leg: Leg, begin: float, segments: Sequence[PathSegment], found: SpeedPlan | SmoothPlan
    ) -> None:
        """Begin to execute a plan for segments; the last one is a leg from `begin` on."""
        self._leg, self._segments, self._plan = leg, segments, found
        self._time = self._time_before = 0.0
        self._ends: list[float] = list(accumulate(segment.length for segment in segments))
        # How much of the leg's end its blend may replace: at most half of the leg.
        length, r = leg.path.length, leg.r
        self._zone = min(leg.last_part(r, 0.5 * length), length - begin) if r > 0.0 else 0.0
        self._stopping: StoppingCurve | None = None
        if self._zone > 0.0:
            stop = self._ends[-1] - self._zone * segments[-1].scale
            self._stopping = stopping_curve(intervals_of(segments), stop)

    def _at(self, s: float) -> int:
        """Return the index of the segment at a length."""
        return min(bisect_right(self._ends, s), len(self._segments) - 1)

    def _ahead(self, s: float) -> list[PathSegment]:
        """Return the rest of the segments after a length."""
        k = self._at(s)
        segment = self._segments[k]
        begin = segment.begin + (s - (self._ends[k - 1] if k > 0 else 0.0)) / segment.scale
        return [segment.cut(begin=min(begin, segment.end)), *self._segments[k + 1 :]]
