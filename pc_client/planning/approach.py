"""The slow approach from where the arm is to where a plan begins; both in words, for who confirms them.

All joints move together on a straight line in joint space, whatever stands there; so the line is checked
here, posture by posture, before the arm moves. Two rules keep it short and safe: the
nearest of the start postures that differ by whole turns is used (the plan is shifted to match), and when the
direct line is not clear, routes over raised postures are tried: up, turn, and down.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import accumulate, pairwise, product
from math import pi, sqrt
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from pc_client.arrays import Array
from pc_client.errors import PlanningError
from pc_client.kinematics.clearance import Clearance, ClearanceModel, clearance_model
from pc_client.kinematics.model import RobotModel
from pc_client.planning.limits import PlanLimits
from pc_client.planning.plan import JointPlan
from protocol.ur_types import JOINT_NAMES


class JointLines:
    """A joint reference along straight joint lines; on each the speed is a trapezoid, from rest to rest.

    All joints begin and end a line together. The joint with the largest distance leads, with a largest speed
    v [rad/s] and an acceleration a [rad/s²]. There is at least one posture, (6,) each [rad].
    """

    def __init__(self, postures: Sequence[Array], v: float, a: float) -> None:
        self._postures = tuple(postures)
        self._v = v
        self._a = a
        durations = [
            self._line_duration(_largest_joint_distance(begin, end))
            for begin, end in pairwise(self._postures)
        ]
        self._ends = tuple(accumulate(durations, initial=0.0))

    @property
    def duration(self) -> float:
        """Time of all lines together [s]."""
        return self._ends[-1]

    def at(self, t: float) -> tuple[Array, Array]:
        """Positions (6,) [rad] and velocities (6,) [rad/s] at time t [s]; at rest before 0 and at the end."""
        still = np.zeros(len(self._postures[0]))
        if t <= 0.0:
            return self._postures[0], still
        if t >= self.duration:
            return self._postures[-1], still
        line = next(k for k in range(1, len(self._ends)) if t < self._ends[k])
        begin, end = self._postures[line - 1], self._postures[line]
        distance = _largest_joint_distance(begin, end)
        s, speed = self._on_line(t - self._ends[line - 1], distance)
        return begin + (s / distance) * (end - begin), (speed / distance) * (end - begin)

    def _line_duration(self, distance: float) -> float:
        v, a = self._v, self._a
        return distance / v + v / a if distance >= v * v / a else 2.0 * sqrt(distance / a)

    def _on_line(self, t: float, distance: float) -> tuple[float, float]:
        """Distance [rad] and speed [rad/s] of the leading joint, t [s] after its line begins."""
        a = self._a
        duration = self._line_duration(distance)
        ramp = min(self._v / a, duration / 2.0)
        if t < ramp:
            return 0.5 * a * t * t, a * t
        if t > duration - ramp:
            left = duration - t
            return distance - 0.5 * a * left * left, a * left
        return a * ramp * (t - 0.5 * ramp), a * ramp


def _largest_joint_distance(begin: Array, end: Array) -> float:
    return float(np.abs(end - begin).max())


_CHECK_STEP = 0.01
"""Largest distance of the stretched arm's TCP between checked postures [m]."""

_TURN = 2.0 * pi
_FOLDING_JOINTS = (1, 2)
# UR's home posture (0, -90, 0, -90, 0, 0) deg: far from the plane, and the wrist far from the forearm.
_RAISED = MappingProxyType({1: -pi / 2, 2: 0.0, 3: -pi / 2, 4: 0.0})


@dataclass(frozen=True, slots=True)
class Approach:
    """A checked path to the start of a plan.

    Attributes:
        plan: the plan to run afterwards, shifted by whole turns to begin where the approach ends.
        q_from: (6,) joint angles where the approach begins [rad].
        waypoints: a straight joint line to each, resting in between; the last is `plan.start_q` [rad].
        v: speed of the leading joint [rad/s].
        a: acceleration of the leading joint [rad/s²].
        clearance: least distances along the approach [m]; infinite without anything around.
    """

    plan: JointPlan
    q_from: Array = field(repr=False)
    waypoints: tuple[Array, ...] = field(repr=False)
    v: float
    a: float
    clearance: Clearance[float]

    @property
    def motion(self) -> JointLines:
        """The joint angles over time."""
        return JointLines((self.q_from, *self.waypoints), self.v, self.a)

    @property
    def duration(self) -> float:
        """How long the approach takes [s]."""
        return self.motion.duration


def plan_approach(plan: JointPlan, q_now: ArrayLike, *, model: RobotModel) -> Approach:
    """Plan a slow joint move from the present posture (6,) [rad] to the start of a plan.

    Returns:
        One waypoint, up to three if the direct line is not clear. Use `.plan` instead of `plan` from then on.

    Raises:
        PlanningError: the present posture or every tried route is not clear; names posture and joint.
    """
    q_from = np.array(q_now, dtype=np.float64)
    _refuse_posture(plan, model, q_from)
    limits = plan.report.limits
    v, a = limits.approach_speed, limits.approach_acceleration
    hulls = clearance_model(model)
    starts = _starts(plan, q_from)
    refusals = []
    for route in _ROUTES:
        for start in starts:
            waypoints = (*route(q_from, start.start_q), start.start_q)
            clearance = _check_route(plan.name, hulls, limits, (q_from, *waypoints))
            if isinstance(clearance, PlanningError):
                refusals.append(clearance)
                continue
            return Approach(start, q_from, waypoints, v, a, clearance)
    # The error of the direct route is the most useful one.
    raise refusals[0]


def _refuse_posture(plan: JointPlan, arm: RobotModel, q_from: Array) -> None:
    """Raise for a present posture that no arm can have."""
    if q_from.shape != (6,):
        raise PlanningError(
            f"{plan.name}: the present posture must be six joint angles, not shape {q_from.shape}"
        )
    inside = (q_from >= np.array(arm.limits.q_min)) & (q_from <= np.array(arm.limits.q_max))
    if not inside.all():
        joint = int((~inside).argmax())
        raise PlanningError(
            f"{plan.name}: {JOINT_NAMES[joint]} stands at {np.degrees(q_from[joint]):.1f} deg, outside its"
            f" range of {np.degrees(arm.limits.q_min[joint]):.0f} to"
            f" {np.degrees(arm.limits.q_max[joint]):.0f} deg; move it back by hand first",
            joint=joint,
        )


def _starts(plan: JointPlan, q_from: Array) -> list[JointPlan]:
    """Return the plan in every sensible turn, the one nearest to q_from first.

    Base and wrists take the nearest turn that keeps the range margin of the whole plan. Shoulder and elbow
    are offered in all their turns: the nearest one may lead through the plane or the folded elbow.
    """
    fitting = [_fitting_turns(plan, q_from, joint) for joint in range(6)]
    options = (turns if joint in _FOLDING_JOINTS else turns[:1] for joint, turns in enumerate(fitting))
    starts = [plan.shifted(turns) for turns in product(*options)]
    return sorted(starts, key=lambda start: float(np.abs(start.start_q - q_from).max()))


def _fitting_turns(plan: JointPlan, q_from: Array, joint: int) -> list[int]:
    """Return the turns of one joint that keep its range margin, nearest to q_from first; 0 always fits."""
    margin = plan.report.limits.position_margin
    limits = plan.report.joint_limits
    low, high = limits.q_min[joint] + margin, limits.q_max[joint] - margin
    fitting = [
        turn
        for turn in (0, -1, 1, -2, 2)
        if plan.report.q_min[joint] + _TURN * turn >= low and plan.report.q_max[joint] + _TURN * turn <= high
    ]
    return sorted(fitting, key=lambda turn: abs(float(plan.start_q[joint] + _TURN * turn - q_from[joint])))


def _raised(q: Array) -> Array:
    """Return q with the arm straight up as in UR's home posture, each joint in its nearest possible turn."""
    posture = q.copy()
    for joint, angle in _RAISED.items():
        turns = (angle - _TURN, angle, angle + _TURN)
        options = np.array([option for option in turns if abs(option) < _TURN])
        posture[joint] = options[np.abs(options - q[joint]).argmin()]
    return posture


def _check_route(
    name: str, hulls: ClearanceModel, limits: PlanLimits, postures: tuple[Array, ...]
) -> Clearance[float] | PlanningError:
    """Return the least clearances on straight joint lines, or the first bad posture's error."""
    step = _CHECK_STEP / hulls.robot.reach
    lines = []
    for begin, end in pairwise(postures):
        n = max(2, int(np.ceil(np.abs(end - begin).max() / step)) + 1)
        lines.append(begin + np.linspace(0.0, 1.0, n)[:, None] * (end - begin))
    q = np.concatenate(lines)
    clearance = hulls.along(q)
    for distances, least in zip(clearance, limits.clearance_min, strict=True):
        bad = np.flatnonzero(distances.least < least)
        if bad.size:
            k = int(bad[0])
            nearest = distances.nearest[k]
            where = (
                "the present posture"
                if k == 0
                else f"the approach to the start, {100 * k / (len(q) - 1):.0f} % along"
            )
            return PlanningError(
                f"{name}: {where} is not clear: {nearest.says(float(distances.least[k]), least)};"
                " move the arm by hand to an open posture, elbow up",
                joint=nearest.joint,
            )
    return Clearance(*(float(distances.least.min()) for distances in clearance))


_ROUTES: tuple[Callable[[Array, Array], tuple[Array, ...]], ...] = (
    lambda q_from, q_to: (),
    lambda q_from, q_to: (_raised(q_from),),
    lambda q_from, q_to: (_raised(q_to),),
    lambda q_from, q_to: (_raised(q_from), _raised(q_to)),
)
"""Postures between start and end of a route, shortest first: none; or postures with the arm straight up,
turning the base while folding down, while rising, or in between."""


def plan_text(plan: JointPlan) -> str:
    """Return the plan as a few lines: box of motion, top speeds, duration, margins, start posture."""
    title = f"{plan.name} on a {plan.report.robot} (nominal kinematics, {plan.report.cell.tool.tcp_text})"
    return "\n".join(
        (title, *(f"  {line}" for line in plan.report.lines()), f"  start posture   {_degrees(plan.start_q)}")
    )


def approach_text(approach: Approach) -> str:
    """Return the approach to the start as a few lines."""
    floor, _, cell = approach.clearance
    clear = f"{floor * 1e3:.0f} mm clear of the floor"
    if np.isfinite(cell):
        clear += f", {cell * 1e3:.0f} mm of walls and solids of the cell"
    title = (
        f"first, slowly (at most {np.degrees(approach.v):.0f} deg/s, about {approach.duration:.1f} s,"
        f" {clear}), joints {', '.join(JOINT_NAMES)}:"
    )
    ways = (f"  to              {_degrees(waypoint)}" for waypoint in approach.waypoints)
    return "\n".join((title, f"  from            {_degrees(approach.q_from)}", *ways))


def _degrees(q: Array) -> str:
    return "(" + ", ".join(f"{angle:.1f}" for angle in np.degrees(q)) + ") deg"
