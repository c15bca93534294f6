"""Drives: from the controller's target to the control of the joint servos in every sub-step.

The controller sends position, speed and the torque of its rigid-body model through the command path. A servo
gives

    tau = kp (control - q) - kv qd + bias,   control = q_set + lead qd_set + tau_set / kp + trim

with lead = kv / kp. The law itself lives in MuJoCo's actuators (`physics_model.py`); `control` comes from the
command path, the bias compensates friction at qd_set. `trim` is the slow outer loop: it integrates the error
at the joint's own encoder, so that gear error, wrong masses and remaining friction are compensated at rest.
It counts errors in whole dead bands (`Fidelity.servo_dead_band`): a smaller one stays, where friction holds
the joint.

In freedrive and in torque control there is no set-point.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, pi

import numpy as np
from numpy.typing import NDArray

from ur_emulator.errors import PlantError
from ur_emulator.machine.models.fidelity import REVERSAL_SPEED, Fidelity
from ur_emulator.machine.models.robot_model import ZERO6, JointRange, RobotModel, Vector6, six
from ur_emulator.machine.motion.generators import JointTarget, TorqueCommand
from ur_emulator.machine.plant.command_path import CommandPath
from ur_emulator.machine.plant.friction import Friction
from ur_emulator.machine.plant.inverse_dynamics import InverseDynamics

# Of the joint position loops: natural frequency [Hz], chosen: at 12 Hz an arm is further from its target than
# a real one; damping ratio.
SERVO_FREQUENCY, _SERVO_DAMPING = 25.0, 0.9


@dataclass(frozen=True, slots=True)
class ServoGains:
    """Gains of the joint servos.

    Attributes:
        kp: (6,) [Nm/rad].
        lead: kv / kp, the same for all joints since they are equally fast and damped [s].
    """

    kp: NDArray[np.float64]
    lead: float

    @property
    def kv(self) -> NDArray[np.float64]:
        """Gains in speed (6,) [Nm s/rad]."""
        return self.kp * self.lead

    @classmethod
    def of(cls, robot: RobotModel) -> ServoGains:
        """Gains that give the servos' frequency and damping at the layout inertia of a robot."""
        omega = 2.0 * pi * SERVO_FREQUENCY
        inertia = np.array(robot.servo_inertia)
        return cls(kp=omega**2 * inertia, lead=2.0 * _SERVO_DAMPING / omega)


# Freedrive: the torque of the drives while a person guides the arm by hand
#
# No joint holds a position. The drives carry the arm against gravity, as the controller's model with the
# declared payload knows it, take away a part of the friction, and push back near the limits of a joint's
# range and speed.
#
# Source: UR3/CB3 manual, chapter "Freedrive mode": close to limits of position and speed the user feels a
# repelling force that grows towards the limit and can be overcome. How strong it is, and how much of the
# friction is compensated, is not published and chosen here.

# Part of the modelled Coulomb friction that is compensated. With any error of the model (see `Friction`,
# 70 % at most) it is less than the true friction: a joint never moves by itself.
FRICTION_SHARE = 0.5
# The push back begins this far before the end of the range [rad], and at this part of the rated speed.
RANGE_MARGIN = 0.15
SPEED_MARGIN = 0.7
# It has grown to this part of the rated torque at the limit.
LIMIT_SHARE = 0.6
# The torque on a resting joint is only a part of that; it is full while the joint moves outwards at this
# speed [rad/s]. A spring alone would throw the arm back.
_REST_SHARE, _FULL_SPEED = 0.3, 0.1

_INTEGRAL_TIME = 0.12  # s; assumed: arms of this kind settle within a few tenths of a second
_TARGET_MAX = 1e6  # rad, rad/s, rad/s²; far above any real target, small enough for arithmetic


def check_target(target: JointTarget, cycle: int) -> None:
    """Raise PlantError for a target, of this cycle, that is not finite or far too large."""
    if not hypot(*target.q, *target.qd, *target.qdd) < _TARGET_MAX:
        raise PlantError(
            f"target {target} in cycle {cycle}: finite numbers below {_TARGET_MAX:g} are needed", cycle=cycle
        )


class Drives:
    """The six drives and the controller's torque model that feeds them.

    A cycle is `command`, `advance`, `keep`, or for free joints `drive_freely` or `drive_by_torque` alone.

    Args:
        dynamics: the controller's torque model.
        joint_range: that freedrive keeps.

    Attributes:
        actual_speed: (6,) [rad/s], for the caller to fill before `advance`: it sets the true friction.
        control: n_substeps rows (6,), what to write to MuJoCo's `ctrl` before each sub-step of this cycle:
            angles for the servos [rad], torques while the joints are free [Nm].
        bias: torque of the servos beside their law in this cycle (6,) [Nm].
        q_final: set-point at the end of this cycle (6,) [rad].
        coulomb: true size of the Coulomb friction at the speeds last given (6,) [Nm].
        target_moment: rigid-body torque for the present target (6,) [Nm].
        target_current: current for the present target, friction included (6,) [A].
        expected_current: the same, as an array.
    """

    def __init__(
        self,
        robot: RobotModel,
        dynamics: InverseDynamics,
        joint_range: JointRange,
        fidelity: Fidelity,
        seed: int,
    ) -> None:
        self._dynamics, gains, generation = dynamics, ServoGains.of(robot), robot.generation
        self._range = joint_range
        self._strength = LIMIT_SHARE * np.array(robot.tau_max)
        self._free_speed = SPEED_MARGIN * np.array(robot.qd_max)
        self._braking_speed = (1.0 - SPEED_MARGIN) * np.array(robot.qd_max)
        self._period = period = generation.period_s
        self._path = path = CommandPath(
            generation.n_substeps,
            generation.substep_us * 1e-6,
            fidelity.drive_lag,
            fidelity.drive_damping,
            gains.lead,
            period / _INTEGRAL_TIME * (fidelity.servo_dead_band or 1.0),
        )
        self._friction = Friction(robot, fidelity, seed)
        self._kp = gains.kp
        self._per_kp = 1.0 / gains.kp
        self._per_torque = 1.0 / np.array(robot.torque_constant)
        # A servo that gives more than this at rest presses against something: more than a few parts in a
        # hundred of wrong masses, and friction where it holds the joint, can ask for.
        held = 1.0 if fidelity.friction_rise < REVERSAL_SPEED else 0.0
        self._pressing = (0.5 + held) * np.array(robot.coulomb)
        self._q, self._qd, self._qdd_then_deflection = path.newest
        self._moment = self._dynamics.torque
        self._work = np.zeros(6)
        self.expected_current = np.zeros(6)
        band = fidelity.servo_dead_band
        self._per_dead_band = np.full(6, 1.0 / band) if band else None
        self.control = list(path.control)
        self.actual_speed = path.speeds[0]
        self.bias = self._friction.compensation
        self.q_final = path.q_final
        self.coulomb = self._friction.coulomb
        self.target_moment = self.target_current = ZERO6

    def hold(self, q: NDArray[np.float64], q_motor: NDArray[np.float64]) -> None:
        """Hold the arm at rest: joints at q, motors at q_motor, (6,) each [rad]."""
        still = np.zeros(6)
        self._path.reset(q, self._dynamics.evaluate(q, still, still) * self._per_kp, q_motor)

    def follow_moving(self, target: JointTarget, q_motor: NDArray[np.float64]) -> None:
        """Follow a target that begins now, the motors being at q_motor (6,) [rad].

        The servo begins without a torque of its own: the difference of the motors from the set-point is
        trimmed, and then reduced as any other error.
        """
        q, qd = np.array(target.q), np.array(target.qd)
        moment = self._dynamics.evaluate(q, qd, np.zeros(6))
        self._path.reset(q - self._period * qd, moment * self._per_kp, q_motor, qd)

    def release(self) -> None:
        """Give no torque: the brakes hold the arm."""
        self.target_moment = self.target_current = ZERO6

    def command(self, target: JointTarget) -> None:
        """Set the target of this cycle, which `check_target` has let pass."""
        self._path.take(target)
        moment = self._dynamics.evaluate(self._q, self._qd, self._qdd_then_deflection)
        np.multiply(moment, self._per_kp, self._qdd_then_deflection)
        self.target_moment = six(moment.tolist())

    def advance(self) -> None:
        """Fill `control` and `q_final`, and what depends on friction: `bias`, `coulomb`, `target_current`."""
        self._path.advance()
        self._friction.evaluate(self._path.speeds)
        current = self.expected_current
        np.add(self._moment, self._friction.expected, current)
        np.multiply(current, self._per_torque, current)
        self.target_current = six(current.tolist())

    def keep(self, error: NDArray[np.float64] | None) -> None:
        """End the cycle; the servos are trimmed by the joints' error (6,) [rad] unless that is None."""
        if error is not None and self._per_dead_band is not None:
            error = np.multiply(error, self._per_dead_band, self._work)
            np.trunc(error, error)
        self._path.keep(error)

    def drive_freely(
        self, q: NDArray[np.float64], qd: NDArray[np.float64], extra: Vector6 | None = None
    ) -> None:
        """Fill `control` for an arm in freedrive.

        Args:
            q: angles of the joints (6,) [rad].
            qd: their speeds (6,) [rad/s].
            extra: torque that holds blocked axes [Nm].
        """
        gravity = self._let_go(q, qd)
        torque = gravity + FRICTION_SHARE * self._friction.dry_compensation - self._push_back(q, qd)
        if extra is not None:
            torque += extra
        self._give(torque, gravity)

    def _push_back(self, q: NDArray[np.float64], qd: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the torque against motion near the limits of freedrive (6,) [Nm]."""
        low, high = np.array(self._range.q_min) + RANGE_MARGIN, np.array(self._range.q_max) - RANGE_MARGIN
        beyond = np.maximum(q - high, 0.0) + np.minimum(q - low, 0.0)
        depth = np.clip(beyond / RANGE_MARGIN, -1.0, 1.0)
        outwards = np.clip(qd * np.sign(depth) / _FULL_SPEED, 0.0, 1.0)
        repelling = depth * np.abs(depth) * (_REST_SHARE + (1.0 - _REST_SHARE) * outwards)
        excess = np.maximum(np.abs(qd) - self._free_speed, 0.0) / self._braking_speed
        torque: NDArray[np.float64] = self._strength * (repelling + np.sign(qd) * excess)
        return torque

    def drive_by_torque(
        self, q: NDArray[np.float64], qd: NDArray[np.float64], command: TorqueCommand
    ) -> None:
        """Fill `control` for an arm in torque control, with joints at q (6,) [rad], qd (6,) [rad/s]."""
        moment = self._let_go(q, qd) + command.torque
        self._give(moment + self._friction.share(command.viscous, command.coulomb), moment)

    def _let_go(self, q: NDArray[np.float64], qd: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the torque that holds free joints; set their friction."""
        self._friction.evaluate(np.array([qd, qd, qd]))
        still = np.zeros(6)
        return self._dynamics.evaluate(q, still, still)

    def _give(self, torque: NDArray[np.float64], moment: NDArray[np.float64]) -> None:
        """Let the free joints have a torque (6,) in this cycle; moment (6,) is its part without friction."""
        self._path.control[:] = torque
        self.bias[:] = 0.0
        self.target_moment = six(moment.tolist())
        np.multiply(torque, self._per_torque, self.expected_current)
        self.target_current = six(self.expected_current.tolist())

    def are_pressing(self, q_motor: NDArray[np.float64]) -> bool:
        """True when a servo of a resting arm, motors at q_motor (6,) [rad], presses against an obstacle."""
        effort = self._kp * (self.q_final + self._path.trim - q_motor)
        return bool((np.abs(effort) > self._pressing).any())
