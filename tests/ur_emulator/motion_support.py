"""What the motion tests share: an arm, a place to move in, and a way to ride a generator to its end."""

import itertools

import numpy as np

from protocol.pose import pose_trans
from ur_emulator.kinematics.arm_model import ArmModel
from ur_emulator.models.robots import robot_by_name
from ur_emulator.motion.leg import move_tool
from ur_emulator.motion.path import PoseLine
from ur_emulator.motion.target import ZERO6, JointTarget
from ur_emulator.motion.tool import Tool

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


def ride(generator, q=HOME, scale=1.0, limit=4000):
    """All targets until the generator is done, the first included."""
    targets = [JointTarget(tuple(q), ZERO6)]
    while not generator.done:
        targets.append(generator.step(targets[-1], DT, scale))
        assert len(targets) < limit
    return targets


def follow_when_open(move, legs, q=HOME, scale=1.0, limit=4000):
    """Ride a move and let legs follow as a script would: in the cycle in which it opens."""
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
        share = np.clip((points - a) @ way / (way @ way), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(points - a - share[:, None] * way, axis=1))
    return best
