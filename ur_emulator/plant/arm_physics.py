"""ArmPhysics: one arm in MuJoCo, the forces on it, and the state of one cycle before.

The hinges are the motor side of the gears.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from ur_emulator.models.mjcf import FLANGE
from ur_emulator.models.robot_model import DhRow, RobotModel
from ur_emulator.plant.drives import Drives
from ur_emulator.plant.friction import Presliding
from ur_emulator.plant.loads import Loads
from ur_emulator.plant.obstacles import Obstacles
from ur_emulator.plant.physics import JointServos, ServoGains, build_physics, contact_wrench
from ur_emulator.plant.sensors import REC_Q, REC_QD

_RUNAWAY = 100.0  # rad/s; no joint turns that fast, the simulation has diverged


class ArmPhysics:
    """The moving arm.

    Args:
        robot: the type of arm.
        dh: its six true rows.
        mass_scale: six factors on the link masses.
        gains: of the joint servos.
        substep: physics time step [s].
        presliding: angle over which friction follows a reversal [rad]; 0: friction is MuJoCo's, without a
            memory of the path.

    Attributes:
        model: of MuJoCo.
        data: its state.
        q: motor positions (6,) [rad].
        qd: motor speeds (6,) [rad/s].
        torque: of the drives in the last sub-step (6,) [Nm].
        flange_position: (3,) in the base frame [m], at the start of the last sub-step.
        flange_rotation: (3, 3), likewise.
        loads: payload and push at the flange.
        obstacles: around the arm.
        servos: of the joints.
    """

    def __init__(
        self,
        robot: RobotModel,
        dh: Sequence[DhRow],
        mass_scale: Sequence[float],
        gains: ServoGains,
        substep: float,
        presliding: float,
    ) -> None:
        self.model = model = build_physics(robot, dh, mass_scale, gains, substep)
        self.data = data = mujoco.MjData(model)
        self._before = mujoco.MjData(model)
        # Views into MuJoCo's memory: one attribute lookup each, once.
        self.q: NDArray[np.float64] = data.qpos
        self.qd: NDArray[np.float64] = data.qvel
        self.torque: NDArray[np.float64] = data.actuator_force
        self._ctrl: NDArray[np.float64] = data.ctrl
        self._raw: NDArray[np.float64] = data.sensordata
        self._frictionloss: NDArray[np.float64] = model.dof_frictionloss
        self._presliding: Presliding | None = None
        if presliding:
            self._presliding = Presliding(presliding, self.q, data.qfrc_applied)
            self._frictionloss[:] = 0.0
        site: int = model.site(FLANGE).id
        self.flange_position: NDArray[np.float64] = data.site_xpos[site]
        self.flange_rotation: NDArray[np.float64] = data.site_xmat[site].reshape(3, 3)
        self.loads = Loads(model, data)
        self.obstacles = Obstacles(model, data.qpos)
        self.servos = JointServos(model)

    @property
    def n_contacts(self) -> int:
        """Number of contact points of the arm with itself, its base or the table."""
        return int(self.data.ncon)

    @property
    def has_diverged(self) -> bool:
        """Whether the simulation has diverged."""
        return not self.qd.dot(self.qd) < _RUNAWAY**2

    @property
    def contact_wrench(self) -> NDArray[np.float64]:
        """True contact wrench of table and base on the arm (6,), at the flange in base axes [N, Nm]."""
        return contact_wrench(self.model, self.data, self.flange_position)

    def place(self, q: NDArray[np.float64]) -> None:
        """Put the motors at q (6,) [rad], at rest."""
        mujoco.mj_resetData(self.model, self.data)
        self.q[:] = q
        if self._presliding is not None:
            self._presliding.reset()

    def stop(self) -> None:
        """Stand still at once, wherever the arm is."""
        self.qd[:] = 0.0
        mujoco.mj_kinematics(self.model, self.data)

    def touches(self, q: Sequence[float]) -> bool:
        """Return whether the arm would touch itself, its base, the table or an obstacle at q (6,) [rad]."""
        data = mujoco.MjData(self.model)
        data.qpos[:] = q
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_collision(self.model, data)
        return int(data.ncon) > 0

    def run(self, drives: Drives, capture_at: int, captured: NDArray[np.float64]) -> None:
        """Advance by the sub-steps of a cycle.

        Args:
            drives: of the joints.
            capture_at: number of the sub-step whose raw sensors are wanted, which they are at its beginning;
                the number of sub-steps: those of the last one, with positions and speeds at its end.
            captured: takes them, see `sensors.REC_SIMULATED`.
        """
        model, data, ctrl, step = self.model, self.data, self._ctrl, mujoco.mj_step
        friction = self._presliding
        if friction is None:
            self._frictionloss[:] = drives.coulomb
        self.servos.bias[:] = drives.bias
        if self.loads.is_unexpected:
            self.loads.apply()
        for row in drives.control:
            ctrl[:] = row
            if friction is not None:
                friction.apply(drives.coulomb)
            step(model, data)
            if not capture_at:
                captured[:] = self._raw
            capture_at -= 1
        if not capture_at:
            captured[:] = self._raw
            captured[REC_Q] = self.q
            captured[REC_QD] = self.qd

    def store_state(self) -> None:
        """Store the present state for `restore_state`."""
        mujoco.mj_copyData(self._before, self.model, self.data)
        if self._presliding is not None:
            self._presliding.store()

    def restore_state(self) -> None:
        """Return to the stored state."""
        mujoco.mj_copyData(self.data, self.model, self._before)
        if self._presliding is not None:
            self._presliding.restore()
