"""Samples of a path of the tool in joint angles, taken before the tool moves, and the speed that they allow.

Near a singularity a slow tool needs fast joints. So the path is sampled, more densely where the joint speeds
change much, and each part of it gets the greatest speed at which the joints keep their limits. The tool slows
down before the singularity. At the singularity itself it keeps a least speed, and the safety system stops the
arm, as a real one does.
"""

from itertools import pairwise
from math import ceil
from typing import NamedTuple

from ur_emulator.machine.models.robot_model import RobotModel, Vector6, six
from ur_emulator.machine.motion.path import PosePath
from ur_emulator.machine.motion.tool import Tool

# Distance of samples [m], the greatest number before refinement, and the greatest number of bisections.
_SPACING, _MOST, _HALVINGS = 0.025, 40, 6
# Greatest number of samples of a path.
_LIMIT = 200
# An interval is bisected where a joint is faster than this share of its limit, and its speed in the middle
# differs from the mean of both ends by more than this share of the greatest one.
_FAST, _ROUGH = 0.4, 0.1
# Also where a joint is further than this from the angle that its speeds predict [rad]: it may have changed to
# another solution of the inverse kinematics, which does not happen in the small steps of a cycle.
_GREATEST_JUMP = 0.1
# Greatest extrapolation of a joint angle as a start for the inverse kinematics [rad].
_FARTHEST = 0.5

# Share of the joints' rated speed that a move of the tool may use; the rest is a margin between samples.
JOINT_SPEED_SHARE = 0.97
# Greatest acceleration of a joint on a curved path [rad/s^2]. Chosen: twice that of an emergency stop.
JOINT_ACCELERATION = 40.0
# Least speed to which the tool slows down for the joints [m/s]. Chosen.
LEAST_SPEED = 0.001


class Sample(NamedTuple):
    """A point of a path in joint space.

    Attributes:
        s: path length of the tool [m].
        q: joint angles [rad].
        slope: their derivative with respect to s [rad/m].
        aspect: `Tool.aspect` there.
    """

    s: float
    q: Vector6
    slope: Vector6
    aspect: bool


class Limits(NamedTuple):
    """Constant limits on a part of a path, in units of the path.

    Attributes:
        end: where the part ends; it begins where the one before it ends.
        speed: greatest one.
        bounds: pairs (a, b): the acceleration along the path is at most a - b v^2, for all of them.
    """

    end: float
    speed: float
    bounds: tuple[tuple[float, float], ...]


def sample_path(path: PosePath, tool: Tool, near: Vector6, speed: float) -> tuple[Sample, ...]:
    """Sample a path up to the first point that the arm cannot reach.

    `near` are the joint angles at the beginning [rad], `speed` is that of the tool [m/s].
    """
    samples: list[Sample] = []
    if path.length > 0.0 and _take(samples, path, tool, 0.0, near):
        parts = min(_MOST, max(1, ceil(path.length / _SPACING)))
        for k in range(1, parts + 1):
            end = path.length if k == parts else path.length * k / parts
            if not _extend(samples, path, tool, end, speed, _HALVINGS):
                break
    return tuple(samples)


def reaches_end(samples: tuple[Sample, ...], end: float, robot: RobotModel) -> bool:
    """Return whether the arm can follow a path up to its end.

    It cannot where a joint would be too fast even at the least speed: at a singularity, or at the end of a
    joint's range, where the inverse kinematics gives an angle one turn away.
    """
    return (
        bool(samples)
        and samples[-1].s >= end
        and not any(
            LEAST_SPEED * abs(q - p) > most * (b.s - a.s)
            for a, b in pairwise(samples)
            for p, q, most in zip(a.q, b.q, robot.qd_max, strict=True)
        )
    )


def joint_limits(samples: tuple[Sample, ...], robot: RobotModel) -> tuple[Limits, ...]:
    """Return the limits of the joints between the samples of a path."""
    found: list[Limits] = []
    for a, b in pairwise(samples):
        length = b.s - a.s
        speed, fastest, bend = float("inf"), 0.0, 0.0
        for k, most in enumerate(robot.qd_max):
            u, w = a.slope[k], b.slope[k]
            rate = max(abs(u), abs(w), abs(_middle(a, b, k, length)))
            if rate > 0.0:
                speed = min(speed, JOINT_SPEED_SHARE * most / rate)
            fastest = max(fastest, rate)
            bend = max(bend, abs(w - u) / length)
        if bend > 0.0:
            speed = min(speed, (JOINT_ACCELERATION / bend) ** 0.5)
        speed = max(speed, LEAST_SPEED)
        # Where the least speed is too fast, the plan still needs some acceleration.
        bend = min(bend, 0.9 * JOINT_ACCELERATION / speed**2)
        scale = 1.0 / max(fastest, 1e-6)
        found.append(Limits(b.s, speed, ((JOINT_ACCELERATION * scale, bend * scale),)))
    return tuple(found)


def _extend(
    samples: list[Sample], path: PosePath, tool: Tool, end: float, speed: float, halvings: int
) -> bool:
    """Sample up to `end`; False if the arm cannot reach a point before it."""
    last = samples[-1]
    if not _take(samples, path, tool, end, last.q):
        return False
    if halvings > 0 and len(samples) < _LIMIT and _is_rough(last, samples[-1], tool.arm.robot, speed):
        samples.pop()
        middle = 0.5 * (last.s + end)
        return _extend(samples, path, tool, middle, speed, halvings - 1) and _extend(
            samples, path, tool, end, speed, halvings - 1
        )
    return True


def _take(samples: list[Sample], path: PosePath, tool: Tool, s: float, near: Vector6) -> bool:
    pose, twist = path.at(s)
    if samples:
        last = samples[-1]
        length = s - last.s
        if max(map(abs, last.slope)) * length <= _FARTHEST:
            near = six([q + length * slope for q, slope in zip(last.q, last.slope, strict=True)])
    q = tool.joints(pose, near)
    if q is None:
        return False
    samples.append(Sample(s, q, tool.rates(q, twist), tool.aspect(q)))
    return True


def _is_rough(a: Sample, b: Sample, robot: RobotModel, speed: float) -> bool:
    # Close to a singularity the denser samples keep the arm on its side of it.
    if a.aspect != b.aspect:
        return True
    length = b.s - a.s
    for k, most in enumerate(robot.qd_max):
        u, w, middle = a.slope[k], b.slope[k], _middle(a, b, k, length)
        rate, off = max(abs(u), abs(w), abs(middle)), abs(middle - 0.5 * (u + w))
        if (speed * rate > _FAST * most and off > _ROUGH * rate) or off * length > _GREATEST_JUMP:
            return True
    return False


def _middle(a: Sample, b: Sample, joint: int, length: float) -> float:
    """Return the slope half-way between two samples, if the joint follows a cubic."""
    return 1.5 * (b.q[joint] - a.q[joint]) / length - 0.25 * (a.slope[joint] + b.slope[joint])
