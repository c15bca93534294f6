"""The arm in space at the end of a cycle: computed when somebody reads it, at most once.

Most cycles of a box without clients, and all that a program does in joint space, need none of it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from protocol.pose import rotvec_to_matrix
from ur_emulator.machine.kinematics.arm_model import ArmModel, CartesianState, moved_wrench
from ur_emulator.machine.models.robot_model import Vector3, Vector6, six

# Time from a state to those that accelerations are the differences of [s].
_STEP = 1e-3


@dataclass(slots=True, eq=False)
class ArmInSpace:
    """What follows from the joints of one cycle; the result does not depend on when it is read.

    Args:
        arm: the controller's kinematics.
        target_joints: angles and speeds of the joints' set-point, (6,) each.
        qdd: accelerations of the set-point [rad/s^2], (6,).
        actual_joints: measured angles and speeds.
        wrench_at_flange: from which all others follow, base axes [N, Nm].
        tcp: tool centre point in the flange frame; None for the flange itself.
        force_at_flange: the reported wrench is that at the flange, wherever the TCP is.
    """

    arm: ArmModel
    _target_joints: tuple[Vector6, Vector6]
    _qdd: Vector6
    _actual_joints: tuple[Vector6, Vector6]
    wrench_at_flange: Vector6
    _tcp: Sequence[float] | None
    _force_at_flange: bool
    _target: CartesianState | None = field(default=None, init=False)
    _actual: CartesianState | None = field(default=None, init=False)

    @property
    def target(self) -> CartesianState:
        """Pose, twist and elbow at the target."""
        if self._target is None:
            self._target = self.arm.state(*self._target_joints, self._tcp)
        return self._target

    @property
    def actual(self) -> CartesianState:
        """Pose, twist and elbow at the measured joints."""
        if self._actual is None:
            self._actual = self.arm.state(*self._actual_joints, self._tcp)
        return self._actual

    @property
    def target_acceleration(self) -> Vector6:
        """Acceleration of the TCP at the target, base axes [m/s^2, rad/s^2]."""
        return self._acceleration(*self._target_joints)

    @property
    def actual_acceleration(self) -> Vector6:
        """Acceleration of the TCP at the measured joints, which accelerate as the target does."""
        return self._acceleration(*self._actual_joints)

    def target_base_wrench(self, gravity: Vector3, mass: float, cog: Vector3) -> Vector6:
        """Return what holds the base of the arm at the target, base axes at its origin [N, Nm].

        `gravity` [m/s²] is what a resting arm is held up with, base axes; `mass` [kg] and `cog` [m] are those
        of the payload, in the flange frame.
        """

        def momentum(q: list[float], qd: list[float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            of_arm, moment = self.arm.momentum(q, qd)
            payload = self.arm.state(q, qd, (*cog, 0.0, 0.0, 0.0))
            place, linear = np.array(payload.tcp_pose[:3]), mass * np.array(payload.tcp_speed[:3])
            return of_arm + np.concatenate((linear, np.cross(place, linear))), moment + mass * place

        (before, _), (after, _) = (momentum(*joints) for joints in self._around(*self._target_joints))
        _, moment = momentum(*map(list, self._target_joints))
        weight = (self.arm.mass + mass) * np.array(gravity)
        held = np.concatenate((weight, np.cross(moment, gravity)))
        return six(((after - before) / (2.0 * _STEP) + held).tolist())

    def _acceleration(self, q: Vector6, qd: Vector6) -> Vector6:
        before, after = (self.arm.state(*joints, self._tcp).tcp_speed for joints in self._around(q, qd))
        return six([(b - a) / (2.0 * _STEP) for a, b in zip(before, after, strict=True)])

    def _around(self, q: Vector6, qd: Vector6) -> Iterator[tuple[list[float], list[float]]]:
        """Angles and speeds shortly before and after these, with the target's accelerations."""
        for h in (-_STEP, _STEP):
            yield (
                [a + h * (v + 0.5 * h * acc) for a, v, acc in zip(q, qd, self._qdd, strict=True)],
                [v + h * acc for v, acc in zip(qd, self._qdd, strict=True)],
            )

    @property
    def reported_force(self) -> Vector6:
        """The wrench that clients and programs see, base axes [N, Nm]."""
        return self.wrench_at_flange if self._force_at_flange else self.tcp_force

    @property
    def tcp_force(self) -> Vector6:
        """The wrench at the tool centre point, base axes [N, Nm]."""
        if self._tcp is None:
            return self.wrench_at_flange
        actual = self.actual
        return moved_wrench(self.wrench_at_flange, actual.flange_position, actual.tcp_pose)

    def in_flange_axes(self, wrench: Vector6, mass: float, cog: Vector3, gravity: Vector3) -> Vector6:
        """Return a wrench at the flange [N, Nm] with the weight of the payload, along the axes of the flange.

        `wrench` is without the weight, in base axes, as `gravity` [m/s²], which points upwards; `cog` [m] is
        in the flange frame.
        """
        rotation = rotvec_to_matrix(self.arm.fk(self._actual_joints[0])[3:])
        weight = -mass * (rotation.T @ gravity)
        force, moment = rotation.T @ wrench[:3] + weight, rotation.T @ wrench[3:] + np.cross(cog, weight)
        return six([*force.tolist(), *moment.tolist()])

    def __eq__(self, other: object) -> bool:
        """True when everything that can be read is the same."""
        if not isinstance(other, ArmInSpace):
            return NotImplemented
        return (self.target, self.actual, self.tcp_force) == (other.target, other.actual, other.tcp_force)

    def __hash__(self) -> int:
        return hash((self._target_joints, self._actual_joints))
