"""ArmPhysics: one arm in MuJoCo, the forces on it, and the state of one cycle before.

The model is that of `physics_model.py`; the drives give `ctrl` and `bias` of its servos.
"""

from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from ur_emulator.machine.models.fidelity import Fidelity, random_stream
from ur_emulator.machine.models.mjcf import FLANGE, LINKS
from ur_emulator.machine.models.robot_model import DhRow, RobotModel, Vector3
from ur_emulator.machine.models.things import BodyShape, Contact
from ur_emulator.machine.plant.drives import Drives, ServoGains
from ur_emulator.machine.plant.friction import Presliding
from ur_emulator.machine.plant.hand import Cup, Hand
from ur_emulator.machine.plant.loads import Loads
from ur_emulator.machine.plant.physics_model import compile_physics, physics_spec
from ur_emulator.machine.plant.scene import OBSTACLE, Scene
from ur_emulator.machine.plant.sensors import REC_Q, REC_QD
from ur_emulator.machine.plant.shapes import BY_GEOM, SHAPES, DrawnBox, collide, pose_of
from ur_hil.tools import ToolModel

# MuJoCo's Coulomb friction is a soft constraint, see `compile_physics`. In freedrive a joint would creep
# with it. There the friction holds, up to its size.
_STICTION_SOLIMP = (0.999, 0.999, 0.001, 0.5, 2.0)

# Chosen: bounds a wrench at a singularity, and changes it by 1 % where the least singular value of the
# Jacobian is .047; recordings of a real UR3 go there and show no damping.
_DAMPING = 0.005**2 * np.eye(6)
_RUNAWAY = 100.0  # rad/s; no joint turns that fast, the simulation has diverged


# What stays when the model is compiled anew, by the sizes of its arrays, in which the arm comes first: what
# is set in the model, and of its state what `recompile` drops and the next step needs.
_SET_LATER = {
    "nbody": ("body_mass", "body_ipos", "body_inertia", "body_iquat"),
    "nv": ("dof_solimp", "dof_solref", "dof_frictionloss"),
    "nu": ("actuator_gainprm", "actuator_biasprm", "actuator_forcerange"),
}
_STATE = {
    "nbody": ("xipos",),
    "nsite": ("site_xpos", "site_xmat"),
    "nv": ("qacc_warmstart",),
    "nu": ("actuator_force",),
}


class ArmPhysics:
    """The moving arm.

    Its friction follows a reversal over an angle, or is MuJoCo's, without a memory of the path.

    Attributes:
        q: motor positions (6,) [rad].
        qd: motor speeds (6,) [rad/s].
        torque: of the drives in the last sub-step (6,) [Nm].
        flange_position: (3,) in the base frame [m], at the start of the last sub-step.
        flange_rotation: (3, 3), likewise.
        loads: payload and push at the flange.
        hands: fingers or cup of each tool.
        scene: what surrounds the arm.
        bias: torque of the servos beside their law (6,) [Nm].
    """

    def __init__(
        self,
        robot: RobotModel,
        dh: Sequence[DhRow],
        fidelity: Fidelity,
        seed: int,
        tools: Sequence[ToolModel] = (),
    ) -> None:
        mass_scale = 1.0 + fidelity.mass_error * random_stream(seed, "masses").standard_normal(6)
        self._spec = spec = physics_spec(robot, dh, mass_scale.tolist(), ServoGains.of(robot), tools)
        model = compile_physics(spec, fidelity.friction_rise)
        presliding = fidelity.friction_presliding
        self._sizes = {size: getattr(model, size) for size in (*_SET_LATER, *_STATE)}
        self._presliding = Presliding(presliding) if presliding else None
        self.loads = Loads(tools)
        self.scene = Scene(spec, self._recompile)
        self.hands = tuple(Hand(tool, i) if tool.stroke else Cup(i) for i, tool in enumerate(tools))
        self._bind(model, mujoco.MjData(model))
        for hand in self.hands:
            hand.open_half()
        if self._presliding is not None:
            self._presliding.reset()
            self._frictionloss[:] = 0.0
        self._servo_gain, self._servo_law = self._gain.copy(), self._law.copy()
        self._servo_solimp = self._solimp.copy()

    def _bind(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Take views into MuJoCo's memory: one attribute lookup each, once. The arm's six come first."""
        self.model, self.data = model, data
        self.q: NDArray[np.float64] = data.qpos[:6]
        self.qd: NDArray[np.float64] = data.qvel[:6]
        self.torque: NDArray[np.float64] = data.actuator_force[:6]
        self._ctrl: NDArray[np.float64] = data.ctrl[:6]
        self._raw: NDArray[np.float64] = data.sensordata
        self._frictionloss: NDArray[np.float64] = model.dof_frictionloss[:6]
        site: int = model.site(FLANGE).id
        self.flange_position: NDArray[np.float64] = data.site_xpos[site]
        self.flange_rotation: NDArray[np.float64] = data.site_xmat[site].reshape(3, 3)
        # Whether a body is a part of the arm: of the tree that begins with its first link.
        self._is_arm = model.body_rootid == model.body(LINKS[0]).id
        self._gain = model.actuator_gainprm[:6]
        self._law = model.actuator_biasprm[:6]
        self._solimp = model.dof_solimp[:6]
        self.bias: NDArray[np.float64] = self._law[:, 0]
        if self._presliding is not None:
            self._presliding.bind(self.q, data.qfrc_applied[:6])
        jacobian = np.zeros((6, model.nv))
        self._jacobian = (jacobian[:3], jacobian[3:], jacobian[:, :6], jacobian[:, :6].T)
        self._flange_site = site
        self.loads.bind(model, data)
        self.scene.bind(model, data)
        for hand in self.hands:
            hand.bind(model, data)
        self._has_sorted = False

    def _recompile(self) -> None:
        """Make the model anew after the scene has changed; what was set in the arm's part of it stays."""
        before = self.model
        model, data = self._spec.recompile(before, self.data)
        collide(model, data)
        for kept, old, new in ((_SET_LATER, before, model), (_STATE, self.data, data)):
            for size, fields in kept.items():
                n = self._sizes[size]
                for field in fields:
                    getattr(new, field)[:n] = getattr(old, field)[:n]
        mujoco.mj_setConst(model, mujoco.MjData(model))
        self._bind(model, data)

    @property
    def has_diverged(self) -> bool:
        """Whether the simulation has diverged."""
        return not self.qd.dot(self.qd) < _RUNAWAY**2

    @property
    def contact_wrench(self) -> NDArray[np.float64]:
        """True contact wrench of the surroundings on the arm (6,), at the flange in base axes [N, Nm].

        Contacts between two links of the arm do not count: they are internal forces.
        """
        model, data = self.model, self.data
        wrench = np.zeros(6)
        for i in range(data.ncon):
            contact = data.contact[i]
            first, second = (bool(self._is_arm[model.geom_bodyid[geom]]) for geom in contact.geom)
            if first == second:
                continue
            force = self._contact_force(i)
            fx, fy, fz = (-force if first else force).tolist()
            rx, ry, rz = (contact.pos - self.flange_position).tolist()
            wrench += (fx, fy, fz, ry * fz - rz * fy, rz * fx - rx * fz, rx * fy - ry * fx)
        return wrench

    def wrench_for(self, torque: NDArray[np.float64]) -> NDArray[np.float64]:
        """Wrench at the flange in base axes (6,) [N, Nm] that asks the joints for a torque (6,) [Nm].

        The least one, by a damped inverse.
        """
        linear, angular, arm, transposed = self._jacobian
        mujoco.mj_jacSite(self.model, self.data, linear, angular, self._flange_site)
        square, wrench = arm.dot(transposed) + _DAMPING, np.zeros(6)
        mujoco.mju_cholFactor(square, 0.0)
        mujoco.mju_cholSolve(wrench, square, arm.dot(torque))
        return np.negative(wrench, wrench)

    def _contact_force(self, contact: int) -> NDArray[np.float64]:
        """The force of a contact on its second body (3,) in the base frame [N]."""
        in_contact_frame = np.zeros(6)
        mujoco.mj_contactForce(self.model, self.data, contact, in_contact_frame)
        # The rows of `frame` are the axes of the contact.
        axes: NDArray[np.float64] = self.data.contact[contact].frame.reshape(3, 3)
        return axes.T @ in_contact_frame[:3]

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """All contact points with a force."""
        contacts = []
        for i in range(self.data.ncon):
            first, second = (self._name_of(geom) for geom in self.data.contact[i].geom.tolist())
            force = self._contact_force(i)
            if force.any():
                position = tuple(self.data.contact[i].pos.tolist())
                contacts.append(Contact(first, second, position, tuple(force.tolist())))
        return tuple(contacts)

    @property
    def shapes(self) -> tuple[BodyShape, ...]:
        """Shapes around the arm and on its flange, at the start of the last sub-step."""
        if not self._has_sorted:
            self._sort_shapes()
        data, shapes = self.data, [*self._fixed_shapes]
        for shape, (dx, dy, dz), at in self._sliding_shapes:
            q, (x, y, z, rx, ry, rz) = float(data.qpos[at]), shape.pose
            shapes.append(replace(shape, pose=(x + dx * q, y + dy * q, z + dz * q, rx, ry, rz)))
        for shape, geom, box in self._moving_shapes:
            shapes.append(replace(shape, pose=pose_of(*box.place(data, geom))))
        return (*shapes, *self.scene.obstacles)

    def _sort_shapes(self) -> None:
        """Look which shapes stay, which slide on the flange as fingers do, and which are free to move.

        Clients may ask for shapes as often as they like, so all that can be known before is.
        """
        self._has_sorted = True
        model, data = self.model, mujoco.MjData(self.model)
        mujoco.mj_kinematics(model, data)  # with fingers at 0
        site = model.site(FLANGE).id
        flange, to_flange = data.site_xpos[site], data.site_xmat[site].reshape(3, 3).T
        self._fixed_shapes: list[BodyShape] = []
        self._sliding_shapes: list[tuple[BodyShape, Vector3, int]] = []
        self._moving_shapes: list[tuple[BodyShape, int, DrawnBox]] = []
        for geom in range(model.ngeom):
            body, shape = model.body(model.geom_bodyid[geom]), BY_GEOM.get(int(model.geom_type[geom]))
            name = self._name_of(geom)
            if shape is None or body.name in LINKS or body.name.startswith(OBSTACLE) or name == "base":
                continue
            is_carried, box = bool(self._is_arm[body.id]), DrawnBox.of(model, geom)
            position, rotation = box.place(data, geom)
            if is_carried:
                position, rotation = to_flange @ (position - flange), to_flange @ rotation
            size = SHAPES[shape].from_mujoco(box.size)
            drawn = BodyShape(name, is_carried, shape, size, pose_of(position, rotation))
            carrier = model.body(model.body_weldid[body.id])
            joint = int(carrier.jntadr[0])
            if joint < 0 or carrier.name in LINKS:
                self._fixed_shapes.append(drawn)
            elif is_carried:
                axis = (to_flange @ data.xaxis[joint]).tolist()
                self._sliding_shapes.append((drawn, tuple(axis), int(model.jnt_qposadr[joint])))
            else:
                self._moving_shapes.append((drawn, geom, box))

    def _name_of(self, geom: int) -> str:
        """What people call the body of a shape: a link, a tool, an obstacle, a thing, the table."""
        model = self.model
        body: str = model.body(model.geom_bodyid[geom]).name
        return model.geom(geom).name or "base" if body == "world" else self.scene.name_of(body)

    def set_free(self, free: bool) -> None:
        """Free the joints, or return them to servo control.

        Free: the actuators give `ctrl` as torque, and friction holds resting joints.
        """
        self._gain[:, 0] = 1.0 if free else self._servo_gain[:, 0]
        self._law[:] = 0.0 if free else self._servo_law
        self._solimp[:] = _STICTION_SOLIMP if free else self._servo_solimp

    def place(self, q: NDArray[np.float64]) -> None:
        """Put the motors at q (6,) [rad], at rest; the fingers stay where they are."""
        beside = self.data.qpos[6:].copy()
        mujoco.mj_resetData(self.model, self.data)
        self.q[:] = q
        self.data.qpos[6:] = beside
        if self._presliding is not None:
            self._presliding.reset()

    def stop(self) -> None:
        """Stand still at once, wherever the arm is."""
        self.qd[:] = 0.0
        mujoco.mj_kinematics(self.model, self.data)

    def run(self, drives: Drives, capture_at: int, captured: NDArray[np.float64]) -> None:
        """Advance by the sub-steps of a cycle.

        Args:
            capture_at: number of the sub-step whose raw sensors are wanted, which they are at its beginning;
                the number of sub-steps: those of the last one, with positions and speeds at its end.
            captured: takes them, see `sensors.REC_SIMULATED`.
        """
        model, data, ctrl, step = self.model, self.data, self._ctrl, mujoco.mj_step
        friction = self._presliding
        if friction is None:
            self._frictionloss[:] = drives.coulomb
        self.bias[:] = drives.bias
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

    def run_beside(self, n_steps: int) -> None:
        """Advance fingers and things while the brakes hold the arm."""
        if self.model.nv == 6:
            return
        q = self.q.copy()
        for _ in range(n_steps):
            mujoco.mj_step(self.model, self.data)
            self.q[:] = q
            self.qd[:] = 0.0
