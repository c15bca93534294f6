"""A move under way, and the moves that blend out of it: one generator for the whole chain.

Blending needs to know the next move before the blend begins, and the arm must be able to stop if none comes.
So an instruction with a blend radius gives way to the script (`open`) while the arm can still brake before
the blend; a move that is commanded then joins it (`follow`). If none comes the arm stops at the waypoint.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from math import dist, sqrt

from ur_emulator.models.robot_model import Vector6, six
from ur_emulator.motion.blend import Blend, blend
from ur_emulator.motion.joint_path import JointPath
from ur_emulator.motion.leg import Leg
from ur_emulator.motion.profile import Trapezoid
from ur_emulator.motion.target import JointTarget

# A blend that the arm is too fast for is made smaller by this factor, so many times, and then given up.
_SHRINK, _ATTEMPTS = 0.7, 16


class Follow(Enum):
    """What became of a move that was to follow another one."""

    BLENDED = "blended"
    SKIPPED = "skipped"
    REFUSED = "refused"


@dataclass(frozen=True, slots=True)
class _Stage:
    """A part of a path with its profile: from `begin` on."""

    path: JointPath
    begin: float
    profile: Trapezoid
    last: bool


class Move:
    """Travels legs, one into the next.

    Attributes:
        done: at rest at the last waypoint.
        left: the instruction has given way: another one may follow, or the arm stops at the waypoint.
    """

    def __init__(self, leg: Leg) -> None:
        """Plan a leg from rest to rest."""
        self._leg = leg = leg.in_time()
        length = leg.path.length
        self._zone = leg.last_part(leg.r, 0.5 * length) if leg.r > 0.0 else 0.0
        profile = Trapezoid.from_limits(length, leg.v, leg.a)
        if length <= 0.0 < leg.t:
            profile = Trapezoid.from_duration(length, leg.t, profile)
        self._stages = [_Stage(leg.path, 0.0, profile, last=True)]
        self._time = self._time_before = 0.0
        self._step = 0.0
        self.done = profile.duration <= 0.0
        self.left = False

    def take_back(self) -> None:
        """Undo the last step: its target was not accepted."""
        self._time = self._time_before

    def abandon(self) -> None:
        """Give the move up: whoever waits for its end need not wait longer."""
        self.done = True

    @property
    def goal(self) -> Vector6 | None:
        """Joint angles at the waypoint of the move under way [rad]; None if the arm cannot be there."""
        return self._leg.goal

    @property
    def leg(self) -> Leg:
        """The last leg."""
        return self._leg

    @property
    def duration(self) -> float:
        """Time that is still planned, at full speed [s]."""
        return sum(stage.profile.duration for stage in self._stages) - self._time

    @property
    def open(self) -> bool:
        """True from the cycle on in which it must be known whether a move follows."""
        if self.done:
            return True
        if self._leg.r <= 0.0 or not self._stages[0].last:
            return False
        s, speed = self._state()
        leg = self._leg
        faster = min(leg.v, speed + leg.a * self._step)
        braking = faster * self._step + faster * faster / (2.0 * leg.a)
        return s + braking >= leg.path.length - self._zone

    def follow(self, leg: Leg) -> Follow:
        """Let another leg follow, if this one still may.

        Its path begins at this one's waypoint. Source for the skipping: URScript manual CB3 3.15, movej:
        "if the blend region of this move overlaps with the blend radius of previous or following waypoints,
        this move will be skipped".
        """
        if self.done or not self._stages[0].last or self._leg.r <= 0.0:
            return Follow.REFUSED
        if leg.r > 0.0 and self._leg.r + leg.r > dist(self._leg.goal_pose[:3], leg.goal_pose[:3]):
            return Follow.SKIPPED
        s, speed = self._state()
        first, radius = self._leg, self._leg.r
        for _ in range(_ATTEMPTS):
            found = blend(first, leg, radius, min(self._zone, first.path.length - s))
            if found is None:
                return Follow.REFUSED
            second = leg.in_time(found.enter)
            passing = _passing_speed(first, second, found, s, speed)
            if passing is not None:
                self._plan(second, found, s, speed, passing)
                return Follow.BLENDED
            radius *= _SHRINK
        return Follow.REFUSED

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Advance on the path by `scale * dt`.

        Raises:
            UnreachableError: the path leads where the arm cannot be.
        """
        self._step = dt
        time = self._time + scale * dt
        near = [p + dt * v for p, v in zip(target.q, target.qd, strict=True)]
        while time >= self._stages[0].profile.duration and len(self._stages) > 1:
            time -= self._stages.pop(0).profile.duration
        stage = self._stages[0]
        if time >= stage.profile.duration:
            q, _ = stage.path.at(stage.path.length, near)
            self.done = True
            return JointTarget(q)
        s, speed, _ = stage.profile.at(time)
        q, slope = stage.path.at(stage.begin + s, near)
        self._time_before, self._time = self._time, time
        qd = six([scale * speed * k for k in slope])
        return JointTarget(q, qd, six([(b - a) / dt for a, b in zip(target.qd, qd, strict=True)]))

    def _state(self) -> tuple[float, float]:
        """Return where the move is on the path under way, and how fast."""
        stage = self._stages[0]
        s, speed, _ = stage.profile.at(self._time)
        return stage.begin + s, speed

    def _plan(self, second: Leg, found: Blend, s: float, speed: float, passing: float) -> None:
        first = self._leg
        entry = passing * found.ratio
        rest = second.path.length - found.enter
        self._stages = [
            _Stage(
                first.path,
                s,
                Trapezoid.from_limits(found.leave - s, first.v, first.a, speed, passing),
                last=False,
            ),
            _Stage(
                found.path,
                0.0,
                Trapezoid.from_limits(found.path.length, passing, first.a, passing, passing),
                last=False,
            ),
            _Stage(
                second.path,
                found.enter,
                Trapezoid.from_limits(rest, second.v, second.a, entry),
                last=True,
            ),
        ]
        self._time = 0.0
        self._leg = second
        self._zone = second.last_part(second.r, 0.5 * second.path.length) if second.r > 0.0 else 0.0
        self.left = False


def _passing_speed(first: Leg, second: Leg, found: Blend, s: float, speed: float) -> float | None:
    """Return the speed through the blend in units of the first move; None if the arm is too fast for it.

    The arm must have braked or accelerated to it before the blend, and must be able to stop at the next
    waypoint behind it.
    """
    way = max(0.0, found.leave - s)
    rest = second.path.length - found.enter
    fastest = min(
        found.top_speed,
        first.v,
        second.v / found.ratio,
        sqrt(2.0 * second.a * rest) / found.ratio,
        sqrt(speed * speed + 2.0 * first.a * way),
    )
    slowest = sqrt(max(0.0, speed * speed - 2.0 * first.a * way))
    return fastest if fastest >= slowest and fastest > 0.0 else None
