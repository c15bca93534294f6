"""The tools on the flange in MuJoCo: housing, and two fingers with one drive and their pads, or a cup.

Both fingers move on slides, joined so that they mirror each other, instead of on the maker's linkage: the
width of a Robotiq gripper is then linear in its position, as all clients take it to be (docs/fidelity.md).
The drive is a velocity servo whose force is limited: it moves with its speed until it is stopped, and presses
with its limit from then on. Its screw holds by itself when there is no power. A cup is MuJoCo's adhesion: it
pulls at what it touches.
"""

from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ur_emulator.machine.models.mjcf import LINKS, PAYLOAD
from ur_hil.tools import ToolModel

_SIDES = ("left", "right")

_FINGER_MASS = 0.05  # kg, of each finger; part of the tool's mass
_THICKNESS = 0.004  # m, of a pad

_GEAR_INERTIA = 1.0  # kg; mass of the drive as a finger feels it; assumed, a screw makes it large
_SERVO = 500.0  # N s/m; force of the drive for an error of its speed
_SERVO_RATE = 60.0  # 1/s; rate at which a lasting error of the speed raises the force; to its limit in .25 s
_APPROACH = 0.02  # s; time constant with which the drive slows down before its target; assumed

# Hard enough that a pad gives .2 mm where 200 N squeeze a body of 200 g: at the coarser contacts of the arm
# the body would sink in by centimetres, since MuJoCo's contacts give by mass.
_PAD_CONTACT: dict[str, Any] = {
    "solref": (0.004, 1.0),
    "solimp": (0.95, 0.995, 0.001, 0.5, 2.0),
    "priority": 1,
    "condim": 4,
}

_LIP = 0.003  # m; distance over which the lip of a cup seals; assumed
# Friction over normal impedance: with 1 what is held creeps out of the pads. Source: MuJoCo's own hands.
_IMPEDANCE_RATIO = 10.0


class FingerState(NamedTuple):
    """The fingers after a cycle; a cup has only the last.

    Attributes:
        width: between the pads [m].
        speed: of the width [m/s]; negative while they close.
        share: force of the drive as a share of its limit, negative while it closes; of a cup 1 while it is on
            something, else 0.
    """

    width: float
    speed: float
    share: float


class FingerCommand(NamedTuple):
    """What the drive of the fingers does: go to a width [m] with a speed [m/s], pressing with a force [N]."""

    width: float
    speed: float
    force: float


def add_tool(spec: mujoco.MjSpec, tool: ToolModel, number: int) -> None:
    """Add a tool to an arm whose flange is where its payload is; `number` makes its names its own."""
    name = f"tool_{number}"
    payload, turn = spec.body(PAYLOAD), np.zeros(4)
    mujoco.mju_mulQuat(turn, payload.quat, np.array(tool.quaternion))
    hand = spec.body(LINKS[5]).add_body(name=name, pos=payload.pos, quat=turn)
    hand.explicitinertial = True
    hand.mass = tool.mass - (2.0 * _FINGER_MASS if tool.stroke else 0.0)
    hand.ipos = tool.cog
    hand.inertia = tool.inertia
    across, along = tool.pad
    end = tool.length - along - (0.03 if tool.stroke else 0.0)
    radius = min(tool.body, 0.5 * end)
    hand.add_geom(
        name=f"{name}_housing",
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=[0.0, 0.0, radius, 0.0, 0.0, max(end - radius, radius + 1e-3)],
        size=[radius, 0.0, 0.0],
        mass=0.0,
    )
    spec.option.impratio = _IMPEDANCE_RATIO
    if tool.stroke:
        _add_fingers(spec, hand, tool, name)
        return
    cup = hand.add_body(name=f"{name}_cup", pos=[0.0, 0.0, tool.length - 0.5 * along])
    cup.add_geom(
        name=f"{name}_cup",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[across, 0.5 * along, 0.0],
        mass=0.0,
        friction=[tool.friction, 0.005, 0.0001],
        margin=_LIP,
        gap=_LIP,
        **_PAD_CONTACT,
    )
    suction = spec.add_actuator(name=name, target=f"{name}_cup", trntype=mujoco.mjtTrn.mjTRN_BODY)
    suction.ctrllimited = True
    suction.ctrlrange = [0.0, tool.force[1]]


def _add_fingers(spec: mujoco.MjSpec, hand: mujoco.MjsBody, tool: ToolModel, name: str) -> None:
    across, along = tool.pad
    fingers = [f"{name}_{side}" for side in _SIDES]
    for finger_name, side in zip(fingers, (1.0, -1.0), strict=True):
        finger = hand.add_body(name=finger_name, pos=[0.0, 0.0, tool.length])
        joint = finger.add_joint(
            name=finger_name,
            type=mujoco.mjtJoint.mjJNT_SLIDE,
            axis=[side, 0.0, 0.0],
            range=[0.0, 0.5 * tool.stroke],
        )
        joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
        joint.armature = _GEAR_INERTIA
        box = mujoco.mjtGeom.mjGEOM_BOX
        finger.add_geom(
            name=f"{finger_name}_pad",
            type=box,
            size=[0.5 * _THICKNESS, across, along],
            pos=[side * 0.5 * _THICKNESS, 0.0, 0.0],
            mass=_FINGER_MASS,
            friction=[tool.friction, 0.005, 0.0001],
            **_PAD_CONTACT,
        )
        back = 0.5 * (along + 0.03)
        finger.add_geom(
            type=box,
            size=[_THICKNESS, across, back],
            pos=[side * 2.0 * _THICKNESS, 0.0, along - back],
            mass=0.0,
        )
    couple = spec.add_equality(
        name=name,
        type=mujoco.mjtEq.mjEQ_JOINT,
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
        name1=fingers[0],
        name2=fingers[1],
    )
    couple.data[:2] = 0.0, 1.0
    couple.solref = _PAD_CONTACT["solref"]
    half_width = spec.add_tendon(name=name)
    for finger_name in fingers:
        half_width.wrap_joint(finger_name, 0.5)
    drive = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_TENDON)
    drive.gaintype = mujoco.mjtGain.mjGAIN_FIXED
    drive.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    drive.gainprm[0] = _SERVO
    drive.biasprm[2] = -_SERVO
    drive.forcelimited = True
    drive.forcerange = [-1.0, 1.0]
    spec.add_exclude(bodyname1=fingers[0], bodyname2=fingers[1])


class Hand:
    """The fingers of a tool that `add_tool` has added."""

    def __init__(self, tool: ToolModel, number: int) -> None:
        self._name = f"tool_{number}"
        self._stroke = tool.stroke
        self._raised = 0.0

    def bind(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Move in this model and its state from now on."""
        joint = model.joint(f"{self._name}_{_SIDES[0]}")  # that of the other finger follows
        q, v, drive = int(joint.qposadr[0]), int(joint.dofadr[0]), int(model.actuator(self._name).id)
        self._q: NDArray[np.float64] = data.qpos[q : q + 2]
        self._qd: NDArray[np.float64] = data.qvel[v : v + 2]
        self._speed: NDArray[np.float64] = data.ctrl[drive : drive + 1]
        self._force: NDArray[np.float64] = data.actuator_force[drive : drive + 1]
        self._limit: NDArray[np.float64] = model.actuator_forcerange[drive]
        self._most = float(self._limit[1])

    def open_half(self) -> None:
        """Put the fingers in the middle of their stroke, as they are found after power on."""
        self._q[:] = 0.25 * self._stroke

    @property
    def state(self) -> FingerState:
        """The fingers now."""
        first, second = self._q.tolist()
        first_speed, second_speed = self._qd.tolist()
        (force,) = self._force.tolist()
        return FingerState(first + second, first_speed + second_speed, force / self._most)

    def drive(self, command: FingerCommand | None, period: float) -> None:
        """Set what the drive does in the next cycle [s]; None: it holds, with the force that it has."""
        if command is None:
            if abs(float(self._force[0])) < 0.9 * self._most:
                self._speed[0] = self._raised = 0.0
            return
        first, second = self._q.tolist()
        first_speed, second_speed = self._qd.tolist()
        fastest, ahead = 0.5 * command.speed, 0.5 * (command.width - first - second) / _APPROACH
        wanted = min(fastest, max(-fastest, ahead))
        limit = 2.0 * command.force
        most = limit / _SERVO
        error = wanted - 0.5 * (first_speed + second_speed)
        if wanted * self._raised < 0.0:
            self._raised = 0.0  # lets go at once of what it has held
        self._raised = min(most, max(-most, self._raised + _SERVO_RATE * period * error))
        self._speed[0] = wanted + self._raised
        if limit != self._most:
            self._limit[:] = -limit, limit
            self._most = limit

    def place(self, command: FingerCommand | None, period: float) -> None:
        """Let the fingers be where the command leads them within a cycle [s]: nothing is in their way."""
        first, second = self._q.tolist()
        way = 0.0 if command is None else command.width - first - second
        most = 0.0 if command is None else command.speed * period
        moved = 0.5 * min(most, max(-most, way))
        self._q += moved
        self._qd[:] = moved / period


class Cup:
    """The suction cup of a tool that `add_tool` has added; methods as of `Hand`."""

    def __init__(self, number: int) -> None:
        self._name = f"tool_{number}"

    def bind(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Pull in this model and its state from now on."""
        drive = int(model.actuator(self._name).id)
        self._geom: int = model.geom(f"{self._name}_cup").id
        self._data = data
        self._force: NDArray[np.float64] = data.ctrl[drive : drive + 1]

    def open_half(self) -> None:
        """Do nothing: it has no fingers."""

    @property
    def state(self) -> FingerState:
        """Whether it is on something."""
        data = self._data
        touches = data.ncon > 0 and bool((data.contact.geom == self._geom).any())
        return FingerState(0.0, 0.0, float(touches))

    def drive(self, command: FingerCommand | None, period: float) -> None:
        """Pull with the force of the command in the next cycle."""
        self._force[0] = 0.0 if command is None else command.force

    def place(self, command: FingerCommand | None, period: float) -> None:
        """Do nothing: nothing is there to pull at."""
