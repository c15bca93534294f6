"""JointLimits: ranges and speeds that the safety system keeps the joints in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ur_emulator.models.robot_model import RobotModel, Vector6, six


@dataclass(frozen=True, slots=True)
class JointLimits:
    """Limits of the joints.

    Attributes:
        q_min: lower ends of the ranges [rad].
        q_max: upper ends [rad].
        speed: at which the arm is stopped [rad/s].
        reduced_speed: allowed in reduced mode [rad/s].
        recovery_speed: allowed in recovery mode [rad/s].
    """

    q_min: Vector6
    q_max: Vector6
    speed: Vector6
    reduced_speed: Vector6
    recovery_speed: Vector6

    def within(
        self, q_min: Vector6 | None, q_max: Vector6 | None, speed: Vector6 | None, reduced: Vector6 | None
    ) -> JointLimits:
        """Return the limits with those of an installation, which cannot widen those of the arm."""
        top = self.speed if speed is None else _each(min, self.speed, speed)
        return JointLimits(
            self.q_min if q_min is None else _each(max, self.q_min, q_min),
            self.q_max if q_max is None else _each(min, self.q_max, q_max),
            top,
            _each(min, top, self.reduced_speed if reduced is None else reduced),
            self.recovery_speed,
        )


def limits_of(robot: RobotModel) -> JointLimits:
    """Return the limits of an arm whose installation sets none."""
    limits = robot.generation.limits
    return JointLimits(
        robot.q_min,
        robot.q_max,
        robot.qd_safety,
        six([limits.reduced_share * speed for speed in robot.qd_max]),
        (limits.recovery_speed,) * 6,
    )


def _each(choose: Callable[[float, float], float], a: Vector6, b: Vector6) -> Vector6:
    return six([choose(x, y) for x, y in zip(a, b, strict=True)])
