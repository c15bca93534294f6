"""Moves from waypoint to waypoint: each moves the arm for its thread, or joins the move before it."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import inf
from typing import Any

from protocol.pose import Pose as ToolPose
from protocol.primary.messages import ReportLevel
from protocol.ur_types import JOINT_ACCELERATION, JOINT_SPEED
from ur_emulator.machine.controller.events import ErrorReported, EventQueue
from ur_emulator.machine.controller.settings import PlanningSettings, ToolWrenchLimit
from ur_emulator.machine.controller.world_model import BASE, WorldModel, WorldModelError
from ur_emulator.machine.models.robot_model import Vector6, six
from ur_emulator.machine.motion.generators import StopJ
from ur_emulator.machine.motion.leg import Leg, move_j, move_tool
from ur_emulator.machine.motion.move import Follow, Move
from ur_emulator.machine.motion.ownership import Command, Fate
from ur_emulator.machine.motion.path import PoseLine, PosePath, arc_through
from ur_emulator.machine.scripting.builtin_group import (
    BuiltinGroup,
    Cycles,
    ScriptArm,
    builtin,
    floats,
    require_positive,
    require_range,
    until_over,
)
from ur_emulator.machine.scripting.move_planner import MovePlanner
from urscript import NEXT_CYCLE, ScriptRuntimeError
from urscript.values import Pose, Struct, log_form

# Acceleration and speed of moves that give none. Source: URScript manual, module variables of motion.
JOINT_DEFAULTS = (JOINT_ACCELERATION, JOINT_SPEED)
TOOL_DEFAULTS = (1.2, 0.25)  # m/s^2, m/s
# The controller's number of the warning "Overlapping Blends" is not known: it goes out with the text alone.
OVERLAPPING_BLENDS = ErrorReported(0, 0, ReportLevel.WARNING, "Overlapping Blends")

# A program with waypoints close together may command so many moves in one cycle.
MAX_PER_CYCLE = 4

# Names of the limits of a wrench.
_AXES = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")

# Makes a move for joint angles and tool pose at its start.
MakeLeg = Callable[[Vector6, ToolPose], Leg]


@dataclass(frozen=True)
class MoveBuiltins(BuiltinGroup):
    """Moves from waypoint to waypoint, and how they shall be planned.

    `_place_arm` puts the arm at joint angles [rad]; it is False where the arm would touch something.
    """

    _arm: ScriptArm
    _place_arm: Callable[[Vector6], bool]
    _events: EventQueue
    _planner: MovePlanner
    _planning: PlanningSettings
    _world: WorldModel

    # --- moves of the joints

    @builtin("movej")
    def _movej(self, thread: object, q: Any, a: float, v: float, t: float, r: float) -> Cycles:
        a, v = _limits("movej", a, v, t, r, JOINT_DEFAULTS)
        make = self._joint_leg("movej", q, a=a, v=v, t=t, r=r)
        return self._travel(thread, make, self._planner.usual)

    @builtin("optimovej")
    def _optimovej(self, thread: object, goal: Any, a: float, v: float, r: float) -> Cycles:
        _require_shares("optimovej", a, v, r)
        make = self._joint_leg("optimovej", self._goal_of("optimovej", goal), a=1.0, v=1.0, r=r)
        return self._travel(thread, make, partial(self._planner.optimal, a_share=a, v_share=v))

    def _joint_leg(self, function: str, target: Any, **limits: float) -> MakeLeg:
        def make(start: Vector6, _: ToolPose) -> Leg:
            goal = self._joints_of(target, start)
            require_range(function, goal, self._arm.safety.limits)
            return move_j(start, goal, self._arm.tool, **limits)

        return make

    # --- moves of the tool

    @builtin("movel")
    def _movel(self, thread: object, pose: Any, a: float, v: float, t: float, r: float) -> Cycles:
        a, v = _limits("movel", a, v, t, r)
        make = self._tool_leg(PoseLine, pose, a=a, v=v, t=t, r=r)
        return self._travel(thread, make, self._planner.usual)

    @builtin("optimovel")
    def _optimovel(self, thread: object, goal: Any, a: float, v: float, r: float) -> Cycles:
        _require_shares("optimovel", a, v, r)
        make = self._tool_leg(PoseLine, self._goal_of("optimovel", goal), a=1.0, v=1.0, r=r)
        return self._travel(thread, make, partial(self._planner.optimal, a_share=a, v_share=v))

    @builtin("movep")
    def _movep(self, thread: object, pose: Any, a: float, v: float, r: float) -> Cycles:
        make = self._process_leg("movep", PoseLine, pose, a=a, v=v, r=r)
        return self._travel(thread, make, self._planner.limited)

    @builtin("servoc")
    def _servoc(self, thread: object, pose: Any, a: float, v: float, r: float) -> Cycles:
        make = self._process_leg("servoc", PoseLine, pose, a=a, v=v, r=r)
        # Drivers call it with the same pose again and again: nothing to warn of.
        return self._travel(thread, make, self._planner.limited, may_overlap=True)

    @builtin("movec")
    def _movec(
        self, thread: object, pose_via: Any, pose_to: Any, a: float, v: float, r: float, mode: float
    ) -> Cycles:
        arc = partial(arc_through, fixed=mode == 1)
        make = self._process_leg("movec", arc, pose_via, pose_to, a=a, v=v, r=r)
        return self._travel(thread, make, self._planner.limited)

    def _process_leg(
        self, function: str, path: Callable[..., PosePath], *goals: Any, a: float, v: float, r: float
    ) -> MakeLeg:
        """Return what makes a move along a path at constant speed of the tool."""
        _limits(function, a, v, 0.0, r)
        return self._tool_leg(path, *goals, a=a, v=v, r=r, process=True)

    def _tool_leg(self, path: Callable[..., PosePath], *goals: Any, **limits: Any) -> MakeLeg:
        """Return what makes a move of the tool along a path from where it is through the goals."""
        poses = [self._pose_of(goal) for goal in goals]
        return lambda q, start: move_tool(path(start, *poses), q, self._arm.tool, **limits)

    # --- how an arm gets there

    def _travel(
        self, thread: object, make: MakeLeg, plan: Callable[[Leg], Leg], *, may_overlap: bool = False
    ) -> Cycles:
        """Follow a leg, made where it starts and then planned; from rest, or out of a blend.

        `may_overlap`: no warning about a waypoint that is left out.
        """
        arm, motion = self._arm, self._arm.motion
        before = motion.command_of(thread)
        if before is not None and isinstance(move := before.generator, Move) and move.returned:
            last = move.leg
            if last.goal is not None and last.tool.tcp == arm.settings.tcp_offset:
                outcome = move.follow(plan(make(last.goal, last.goal_pose)))
                if outcome is Follow.BLENDED:
                    yield from _until_open(before, move)
                    return
                if outcome is Follow.SKIPPED:
                    if not may_overlap:
                        self._events.append(OVERLAPPING_BLENDS)
                    move.n_joined += 1
                    if may_overlap or move.n_joined >= MAX_PER_CYCLE:
                        yield NEXT_CYCLE
                    return
            yield from until_over(before)
            if before.fate is Fate.DONE and move.left_out is not None:  # without a blend none overlaps
                yield from until_over(arm.take(thread, Move(move.left_out)))
        if any(motion.path.qd):  # a move begins at rest, also after a program that was replaced in motion
            yield from arm.stop(thread, StopJ(motion.stop_deceleration))
        start = motion.path.q
        move = Move(plan(make(start, arm.tcp_pose(start))))
        yield from _until_open(arm.take(thread, move), move)

    def _goal_of(self, function: str, goal: Any) -> Any:
        """Return joint angles or a pose in the base; a goal may be a frame, or a pose in one."""
        try:
            match goal:
                case str():
                    return Pose.of(self._world.pose(goal, BASE))
                case Struct(members={"pose": Pose() as pose, "frame": str(frame)}):
                    return Pose.of(self._world.convert(floats(pose), frame, BASE))
        except WorldModelError as error:
            raise ScriptRuntimeError(f"{function}: {error}") from None
        if isinstance(goal, Pose) or (isinstance(goal, list) and len(goal) == 6):
            return goal
        raise ScriptRuntimeError(
            f"{function}: goal {log_form(goal)} is none; allowed: six joint positions, a pose, a frame, "
            "struct(pose, frame)"
        )

    def _joints_of(self, target: Any, near: Vector6) -> Vector6:
        if not isinstance(target, Pose):
            return floats(target)
        solution = self._arm.model.inverse(floats(target), near, self._arm.settings.tcp_offset)
        if solution is None:
            raise ScriptRuntimeError(
                "The robot cannot reach the requested pose. "
                "Script function movej is unable to find an inverse kinematics solution."
            )
        return solution

    def _pose_of(self, target: Any) -> ToolPose:
        values = floats(target)
        return values if isinstance(target, Pose) else self._arm.tcp_pose(values)

    @builtin("set_pos")
    def _set_pos(self, thread: object, q: Any) -> None:
        angles = floats(q)
        if self._arm.motion.is_moving or self._arm.motion.owner is not None:
            raise ScriptRuntimeError("set_pos: the arm moves, stop it first")
        require_range("set_pos", angles, self._arm.safety.limits)
        if not self._place_arm(angles):
            raise ScriptRuntimeError(
                "set_pos: the arm would touch itself or the table there, choose another place"
            )

    # --- how moves shall be planned

    @builtin("motion_version_set")
    def _set_version(self, thread: object, version: int) -> None:
        self._planning.motion_version = version

    @builtin("motion_version_get")
    def _version(self, thread: object) -> int:
        return self._planning.motion_version

    @builtin("jerk_gain_scaling_set")
    def _set_jerk_gain(self, thread: object, gain: float) -> None:
        self._planning.jerk_gain = float(gain)

    @builtin("jerk_gain_scaling_get")
    def _jerk_gain(self, thread: object) -> float:
        return self._planning.jerk_gain

    @builtin("tool_wrench_limit_disable")
    def _remove_limit(self, thread: object) -> None:
        self._planning.tool_wrench_limit = None

    @builtin("tool_wrench_limit_set")
    def _set_limit(self, thread: object, frame: Pose, *most: float | None) -> None:
        given = {name: value for name, value in zip(_AXES, most, strict=True) if value is not None}
        require_positive("tool_wrench_limit_set", **given)
        limits = [inf if value is None else float(value) for value in most]
        self._planning.tool_wrench_limit = ToolWrenchLimit(six(frame), six(limits))


def _until_open(command: Command, move: Move) -> Cycles:
    """Wait until a move's instruction returns; with waypoints close together perhaps in this cycle."""
    if move.done:
        yield NEXT_CYCLE
    while not (command.is_over or (move.open and (move.done or move.n_joined < MAX_PER_CYCLE))):
        yield NEXT_CYCLE
    move.returned = True


def _limits(
    function: str, a: float, v: float, t: float, r: float, defaults: tuple[float, float] = TOOL_DEFAULTS
) -> tuple[float, float]:
    """Check limits; return acceleration and speed: a time has priority, so that they may be 0 beside it."""
    if t > 0.0:
        a, v = a or defaults[0], v or defaults[1]
    require_positive(function, a=a, v=v)
    for name, value in (("t", t), ("r", r)):
        if not value >= 0.0:
            raise ScriptRuntimeError(f"{function}: {name} must not be below 0, got {value:g}")
    if t:
        require_positive(function, t=t)
    return a, v


def _require_shares(function: str, a: float, v: float, r: float) -> None:
    for name, share in (("a", a), ("v", v)):
        if not 0.0 < share <= 1.0:
            raise ScriptRuntimeError(f"{function}: {name} must be above 0 and up to 1, got {share:g}")
    if r < 0.0:
        raise ScriptRuntimeError(f"{function}: r must not be below 0, got {r:g}")
