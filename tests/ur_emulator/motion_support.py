"""What the motion tests share: an arm, a starting pose, and functions that run generators to their ends."""

import itertools
import math

import numpy as np

from protocol.pose import pose_trans
from ur_emulator.machine.kinematics.arm_model import ArmModel
from ur_emulator.machine.models.robot_model import ZERO6
from ur_emulator.machine.models.robots import robot_by_name
from ur_emulator.machine.motion.generators import JointTarget
from ur_emulator.machine.motion.leg import move_tool
from ur_emulator.machine.motion.move import Follow, Move
from ur_emulator.machine.motion.path import PoseLine
from ur_emulator.machine.motion.tool import Tool

DT = 0.008
ARM = ArmModel(robot_by_name("ur3"))
TOOL = Tool(ARM, (0.0, 0.0, 0.05, 0.0, 0.0, 0.1))
HOME = (0.0, -1.4, -1.9, -1.4, 1.57, 0.3)  # the tool points down, far from singularities
START = TOOL.pose(HOME)


def at(x, y, z, rx=0.0, ry=0.0, rz=0.0):
    """A pose relative to the starting one, in its axes."""
    return pose_trans(START, (x, y, z, rx, ry, rz))


def line(start, goal, near=HOME, **limits):
    return move_tool(PoseLine(start, goal), near, TOOL, **({"a": 1.2, "v": 0.25} | limits))


def run_to_end(generator, q=HOME, scale=1.0, limit=4000):
    """All targets until the generator is done, the first included."""
    targets = [JointTarget(tuple(q), ZERO6)]
    while not generator.done:
        targets.append(generator.step(targets[-1], DT, scale))
        assert len(targets) < limit
    return targets


def follow_when_open(move, legs, q=HOME, scale=1.0, limit=4000):
    """Run a move; each leg follows in the cycle in which the move opens, as in a script."""
    targets = [JointTarget(tuple(q), ZERO6)]
    outcomes = []
    legs = list(legs)
    while not move.done:
        targets.append(move.step(targets[-1], DT, scale))
        if legs and move.open and not move.done:
            outcomes.append(move.follow(legs.pop(0)))
        assert len(targets) < limit
    return targets, outcomes


def positions(targets):
    return np.array([TOOL.pose(t.q)[:3] for t in targets])


def tool_velocities(targets):
    return np.array([TOOL.twist(t.q, t.qd)[:3] for t in targets])


def tool_accelerations(targets):
    """Norms of the change of the tool's velocity from cycle to cycle [m/s^2]."""
    return np.linalg.norm(np.diff(tool_velocities(targets), axis=0), axis=1) / DT


def distance_to_polyline(points, corners):
    """For each point the distance to the nearest of the straight segments between corners [m]."""
    best = np.full(len(points), np.inf)
    for a, b in itertools.pairwise(corners):
        a, way = np.array(a), np.subtract(b, a)
        share = np.clip((points - a) @ way / max(way @ way, 1e-30), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(points - a - share[:, None] * way, axis=1))
    return best


def run_cycles(motion, n):
    """The targets of n cycles of an ArmMotion."""
    return [motion.step(DT, 1.0) for _ in range(n)]


def renew(motion, command, n):
    """Run an ArmMotion for n cycles, in each of which the command is renewed."""
    for _ in range(n):
        command.is_renewed = True
        motion.step(DT, 1.0)


class Swing:
    """Displaces the tool along base z, smoothly from rest."""

    tool = TOOL

    def __init__(self, reach=0.02, rate=2.0):
        self.time, self.reach, self.rate = 0.0, reach, rate

    def displace(self, tool_pose, dt):
        self.time += dt
        lift = self.reach * (1.0 - math.cos(self.rate * self.time))
        return (tool_pose[0], tool_pose[1], tool_pose[2] + lift, *tool_pose[3:])


class RecordedMove(Move):
    """A move that records the legs that joined it."""

    def __init__(self, leg):
        super().__init__(leg)
        self.legs = [leg]

    def _join(self, leg):
        joined = super()._join(leg)
        if joined:
            self.legs.append(leg)
        return joined


def run_chain(makers, q=HOME, limit=20000):
    """Run moves one after the other as a program does: each in the cycle in which the one before returns.

    Args:
        makers: each makes a leg for joint angles and tool pose at its start.
        q: joint angles at the beginning.
        limit: most cycles.

    Returns:
        All targets, the executed legs, and the result of each `follow`.
    """
    targets = [JointTarget(tuple(q), ZERO6)]
    makers, legs, outcomes, first = list(makers), [], [], None
    while makers or first is not None:
        last = targets[-1]
        move = RecordedMove(first or makers.pop(0)(last.q, TOOL.pose(last.q)))
        refused = first is not None
        while not move.done:
            while (
                makers
                and not refused
                and not move.done
                and move.open
                and move.leg.r > 0
                and move.n_joined < 4
            ):
                outcomes.append(move.follow(makers[0](move.leg.goal, move.leg.goal_pose)))
                refused = outcomes[-1] is Follow.REFUSED
                if not refused:
                    makers.pop(0)
                    move.n_joined += outcomes[-1] is Follow.SKIPPED
            targets.append(move.step(targets[-1], DT, 1.0))
            assert len(targets) < limit
        first = move.left_out if refused else None
        legs += move.legs
    return targets, legs, outcomes
