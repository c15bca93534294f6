"""Plant: one arm with its drives and sensors, advanced a control cycle at a time.

A cycle is: target -> controller's model torque -> command path (delay, interpolation, lag) -> joint servos and
physics in sub-steps -> a record of true values -> sensors. The plant knows nothing of programs, modes or
safety; it holds what it is told or raises `PlantError`. It reads no clock, and its only chance comes from the
seed: equal seeds and equal targets give bit-identical states.

Angles: the physics' hinge is the motor side of the gear, which the drive holds; the joint itself is there plus
the gear's transmission error. Links move with the hinge, the error of 0.1 mrad is left out of collisions.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import isfinite

import mujoco
import numpy as np
from numpy.typing import NDArray

from ur_emulator.errors import PlantError
from ur_emulator.models.calibration import calibrated_dh, draw_calibration
from ur_emulator.models.fidelity import Fidelity
from ur_emulator.models.mjcf import FLANGE, GRAVITY, LINKS
from ur_emulator.models.random_streams import random_stream
from ur_emulator.models.robot_model import RobotModel, Vector3, Vector6
from ur_emulator.plant.command_path import CommandPath
from ur_emulator.plant.friction import Friction
from ur_emulator.plant.gear import GearRipple
from ur_emulator.plant.inverse_dynamics import InverseDynamics
from ur_emulator.plant.payload import check_payload, set_payload_body
from ur_emulator.plant.physics import (
    N_RAW,
    RAW_ACCELERATION,
    ServoGains,
    build_physics,
)
from ur_emulator.plant.plant_state import JointTarget, PlantState
from ur_emulator.plant.sensors import (
    N_RECORD,
    OUT_ACCELERATION,
    OUT_CURRENT,
    OUT_Q,
    OUT_QD,
    OUT_VOLTAGE,
    OUT_WRENCH,
    REC_Q,
    REC_QD,
    REC_WRENCH,
    Sensors,
    Thermometers,
)

SUBSTEP_US = 2000
"""Physics time step [µs]; must divide the control cycle."""

_INTEGRAL_TIME = 0.12  # s; the outer joint loop removes what friction and model errors leave
_TRIM_MAX = 0.003  # rad; its reach, about 15 Nm at the base
_RUNAWAY = 100.0  # rad/s; no joint turns that fast, the simulation has diverged
_ZERO: Vector6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Plant:
    """An arm on a table.

    Starts at the robot's home pose with its brakes on.

    Args:
        robot: type of the arm.
        fidelity: how imperfect it is.
        seed: which one of all such arms; fixes calibration, gear phases, delays and noise.
        period_s: control cycle [s], a whole multiple of 2 ms.

    Attributes:
        calibration: the factory calibration of this arm, for the controller's kinematics.
        dead_time: the delay drawn for this box, from the start of a cycle to the drives acting on it [s].

    Raises:
        PlantError: when the cycle is not a whole multiple of the physics step.
    """

    def __init__(self, robot: RobotModel, fidelity: Fidelity, seed: int, period_s: float = 0.008) -> None:
        period_us = round(period_s * 1e6)
        if period_us <= 0 or period_us % SUBSTEP_US:
            raise PlantError(
                f"control cycle of {period_s} s given: a whole multiple of {SUBSTEP_US} µs is needed"
            )
        self.robot = robot
        self.fidelity = fidelity
        self.seed = seed
        self.period_s = period_us * 1e-6
        self.calibration = draw_calibration(fidelity, seed)
        self._n_substeps = period_us // SUBSTEP_US
        substep = SUBSTEP_US * 1e-6

        spread = fidelity.dead_time_spread * float(random_stream(seed, "delay").uniform())
        dead_substeps = int((fidelity.dead_time + spread) / substep + 1e-9)
        self.dead_time = dead_substeps * substep
        self._path = CommandPath(self._n_substeps, substep, dead_substeps, fidelity.drive_lag)

        mass_scale = 1.0 + fidelity.mass_error * random_stream(seed, "masses").standard_normal(6)
        self._gains = ServoGains.of(robot)
        self._model = build_physics(
            robot, calibrated_dh(robot, self.calibration), mass_scale.tolist(), self._gains, substep
        )
        self._data = mujoco.MjData(self._model)
        data = self._data
        self._qpos: NDArray[np.float64] = data.qpos
        self._qvel: NDArray[np.float64] = data.qvel
        self._ctrl: NDArray[np.float64] = data.ctrl
        self._raw: NDArray[np.float64] = data.sensordata
        self._force: NDArray[np.float64] = data.actuator_force
        self._frictionloss: NDArray[np.float64] = self._model.dof_frictionloss
        self._flange_link: int = self._model.body(LINKS[5]).id
        self._flange_site: int = self._model.site(FLANGE).id

        self._dynamics = InverseDynamics(robot, self.calibration)
        self._friction = Friction(robot, fidelity, seed)
        self._gear = GearRipple(robot, fidelity, seed)
        self._sensors = Sensors(robot, fidelity, seed, self.period_s)
        self._thermometers = Thermometers(self.period_s)

        # The measurement is taken in this sub-step of a cycle and reported this many cycles later.
        age_substeps = max(1, round(fidelity.feedback_age / substep))
        self._capture_at = -age_substeps % self._n_substeps
        self._records: deque[NDArray[np.float64]] = deque(maxlen=1 + (age_substeps - 1) // self._n_substeps)

        self._tau_limits = robot.tau_max
        self._per_torque = 1.0 / np.array(robot.torque_constant)
        self._trim_gain = self.period_s / _INTEGRAL_TIME
        self._target = np.zeros((3, 6))
        self._ones = np.ones(18)
        self._table = np.zeros((self._n_substeps, 6))
        self._table_work = np.zeros((self._n_substeps, 6))
        self._captured = np.zeros(N_RAW)
        self._trim = np.zeros(6)
        self._error = np.zeros(6)
        self._work = np.zeros(6)
        self._wrench = np.zeros(6)
        self._push: NDArray[np.float64] | None = None
        self._push_point: NDArray[np.float64] | None = None
        self.reset(robot.home_q)

    # --- state for tests and for the control API ---

    @property
    def q_true(self) -> NDArray[np.float64]:
        """True joint angles (6,) now [rad]; no real controller knows them."""
        self._gear.evaluate(self._qpos)
        return self._qpos + self._gear.error

    @property
    def qd_true(self) -> NDArray[np.float64]:
        """True joint speeds (6,) now [rad/s]."""
        self._gear.evaluate(self._qpos)
        return self._qvel * (1.0 + self._gear.slope)

    @property
    def n_contacts(self) -> int:
        """Number of contact points of the arm with itself, its base or the table."""
        return int(self._data.ncon)

    def reset(self, q: Sequence[float]) -> None:
        """Put the arm at rest at q (6,) [rad], brakes on; payload, push and random streams stay.

        Raises:
            PlantError: when q is not six finite numbers.
        """
        angles = np.array(q, dtype=np.float64)
        if angles.shape != (6,) or not np.isfinite(angles).all():
            raise PlantError(f"joint angles {list(q)} given: six finite numbers are needed")
        self.cycle = 0
        mujoco.mj_resetData(self._model, self._data)
        self._qpos[:] = self._gear.motor_position(angles)
        self._target_current: list[float] = [0.0] * 6
        self._target_moment: list[float] = [0.0] * 6
        self._sensors.reset()
        self._engage_brakes()
        self._records.extend([self._rest_record] * (self._records.maxlen or 1))
        self._state: PlantState | None = None

    def set_payload(self, mass: float, cog: Vector3) -> None:
        """Hang a payload on the flange and declare it to the controller.

        Args:
            mass: [kg].
            cog: centre of gravity in the flange frame [m].

        Raises:
            PlantError: when the mass is negative or a number is not finite.
        """
        check_payload(mass, cog)
        set_payload_body(self._model, mass, cog)
        self._dynamics.set_payload(mass, cog)

    def push(self, force: Sequence[float], point: Sequence[float] | None = None) -> None:
        """Push the flange from now on; a zero force ends it.

        Args:
            force: (3,) in base axes [N].
            point: where it acts, in the flange frame [m]; None for the flange's origin.

        Raises:
            PlantError: when a number is not finite.
        """
        force_base = np.array(force, dtype=np.float64)
        at = np.zeros(3) if point is None else np.array(point, dtype=np.float64)
        if force_base.shape != (3,) or at.shape != (3,) or not np.isfinite([force_base, at]).all():
            raise PlantError(
                f"push of {list(force)} N given: three finite numbers are needed, point likewise"
            )
        self._push = force_base if force_base.any() else None
        self._push_point = at
        if self._push is None:
            self._data.xfrc_applied[self._flange_link] = 0.0
            self._wrench[:] = 0.0

    # --- the cycle ---

    def step(self, target: JointTarget | None) -> None:
        """Advance one control cycle.

        Args:
            target: set-point for the end of this cycle; the drives act on it from the beginning of the cycle
                plus the dead time. None puts or keeps the brakes on: the joints stand still.

        Raises:
            PlantError: when the target is not finite or the simulation diverges; the plant needs a reset then.
        """
        self._state = None
        self.cycle += 1
        if target is None:
            if not self._braked:
                self._engage_brakes()
            self._records.append(self._rest_record)
            return
        if self._braked:
            self._release_brakes()
        self._command(target)
        if self._push is not None:
            self._apply_push()
        model, data, table, ctrl, capture_at = (
            self._model,
            self._data,
            self._table,
            self._ctrl,
            self._capture_at,
        )
        saturated_before = self._saturated_now
        for i in range(self._n_substeps):
            ctrl[:] = table[i]
            mujoco.mj_step(model, data)
            if i == capture_at:
                self._captured[:] = self._raw
        speed_squared = float(np.dot(self._qvel, self._qvel))
        if not speed_squared < _RUNAWAY**2:
            raise PlantError(
                f"the simulation diverged in cycle {self.cycle}: joint speeds {self._qvel.tolist()} rad/s; "
                "reset the plant and check the targets",
                cycle=self.cycle,
            )
        forces: list[float] = self._force.tolist()
        self._saturated_now = False
        for force, limit in zip(forces, self._tau_limits, strict=True):
            if force >= limit or force <= -limit:
                self._saturated_now = True
        self._saturated = saturated_before and self._saturated_now
        self._record_cycle()

    def sense(self) -> PlantState:
        """Read the sensors; asking again before the next step gives the same state."""
        if self._state is None:
            reading = self._sensors.read(self._records[0])
            current = reading[OUT_CURRENT]
            self._thermometers.step(current)
            np.multiply(self._force, self._per_torque, out=self._work)
            self._state = PlantState(
                tuple(reading[OUT_Q]),
                tuple(reading[OUT_QD]),
                tuple(current),
                tuple(reading[OUT_VOLTAGE]),
                tuple(reading[OUT_ACCELERATION]),
                tuple(reading[OUT_WRENCH]),
                self._thermometers.reading,
                tuple(self._target_current),
                tuple(self._target_moment),
                tuple(self._work.tolist()),
                self._saturated,
                tuple(self._error.tolist()),
            )
        return self._state

    def _command(self, target: JointTarget) -> None:
        """Turn the target into the control table of this cycle."""
        path, gains, knot = self._path, self._gains, self._target
        q, qd, qdd = knot
        q[:] = target.q
        qd[:] = target.qd
        qdd[:] = target.qdd
        if not isfinite(np.dot(knot.ravel(), self._ones)):
            raise PlantError(
                f"target {target} in cycle {self.cycle}: finite numbers are needed", cycle=self.cycle
            )
        moment = self._dynamics.evaluate(q, qd, qdd)
        self._target_moment = moment.tolist()
        self._friction.evaluate(self._qvel, qd)
        self._frictionloss[:] = self._friction.coulomb
        # The third signal of the command path is torque, in place of the acceleration that it came from.
        np.add(moment, self._friction.compensation, out=qdd)
        np.multiply(qdd, self._per_torque, out=self._work)
        self._target_current = self._work.tolist()
        path.advance(knot)
        table, work = self._table, self._table_work
        np.add(path.q, self._trim, out=table)
        np.multiply(table, gains.kp, out=table)
        np.multiply(path.qd, gains.kv, out=work)
        np.add(table, work, out=table)
        np.add(table, path.tau, out=table)

    def _record_cycle(self) -> None:
        """Keep the true values of this cycle for the sensors, and trim the servos by what they left."""
        gear, captured = self._gear, self._captured
        gear.evaluate(captured[REC_Q])
        record = np.empty(N_RECORD)
        record[:N_RAW] = captured
        record[REC_Q] += gear.error
        np.multiply(gear.slope, captured[REC_QD], out=self._work)
        record[REC_QD] += self._work
        record[REC_WRENCH] = self._wrench
        self._records.append(record)
        error, work = self._error, self._work
        np.subtract(self._path.q_final, self._qpos, out=error)
        np.subtract(error, gear.error, out=error)
        if not self._saturated_now:
            np.multiply(error, self._trim_gain, out=work)
            np.add(work, self._trim, out=work)
            np.maximum(work, -_TRIM_MAX, out=work)
            np.minimum(work, _TRIM_MAX, out=self._trim)

    def _apply_push(self) -> None:
        """Bring the push to the body that MuJoCo wants it at, for the pose at the start of this cycle."""
        data = self._data
        position = data.site_xpos[self._flange_site]
        arm = data.site_xmat[self._flange_site].reshape(3, 3) @ self._push_point
        self._wrench[:3] = self._push
        self._wrench[3:] = np.cross(arm, self._push)
        from_com = position + arm - data.xipos[self._flange_link]
        data.xfrc_applied[self._flange_link, :3] = self._push
        data.xfrc_applied[self._flange_link, 3:] = np.cross(from_com, self._push)

    # --- brakes ---

    def _engage_brakes(self) -> None:
        """Stand still at once, wherever the arm is."""
        self._braked = True
        self._saturated = self._saturated_now = False
        self._qvel[:] = 0.0
        self._force[:] = 0.0
        self._error[:] = 0.0
        self._wrench[:] = 0.0
        self._target_current = [0.0] * 6
        self._target_moment = [0.0] * 6
        mujoco.mj_kinematics(self._model, self._data)
        record = np.zeros(N_RECORD)
        self._gear.evaluate(self._qpos)
        record[REC_Q] = self._qpos + self._gear.error
        up = self._data.site_xmat[self._flange_site].reshape(3, 3)[2]
        record[RAW_ACCELERATION] = GRAVITY * up
        self._rest_record = record

    def _release_brakes(self) -> None:
        """Take the load over from the brakes: the drives stand at the present pose with the model's torque."""
        self._braked = False
        q = self._rest_record[REC_Q]
        still = np.zeros(6)
        self._path.reset(q, self._dynamics.evaluate(q, still, still))
        # The servo holds the motor side; the trim starts as the gear's error of this pose.
        np.subtract(self._qpos, q, out=self._trim)
