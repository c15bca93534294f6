"""What a box is doing, as people want to read it: names instead of numbers, lists instead of bits."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import atan2, hypot, pi
from typing import TYPE_CHECKING

from protocol.primary.messages import RequestedType
from protocol.ur_types import JointMode, ProgramState, RobotMode, SafetyMode, SafetyStatus
from ur_emulator.machine.controller.io.lines import DIGITAL_GROUPS
from ur_emulator.machine.models.robot_model import Vector3, Vector6
from ur_emulator.machine.models.things import BodyShape, Contact, ThingNow

if TYPE_CHECKING:
    from ur_emulator.host.served_box import ServedBox
    from ur_emulator.machine.controller.controller import Controller
    from ur_emulator.machine.controller.safety.boundaries import SafetyPlane

# Slower than this counts as standing still [rad/s]: more than what the sensors make of an arm at rest.
STANDING_SPEED = 0.01

Levels = dict[str, tuple[bool, ...]]


@dataclass(frozen=True, slots=True)
class Question:
    """A question of a program.

    Attributes:
        id: its number, for `answer`.
        kind: type of the answer: BOOLEAN, INTEGER, FLOAT or STRING, for which URScript has functions.
        text: what is asked.
    """

    id: int
    kind: str
    text: str


@dataclass(frozen=True, slots=True)
class BoxState:
    """The state of a box at the end of a cycle; SI units, base frame.

    Attributes:
        tick: number of the cycle.
        time: seconds since controller start.
        robot_mode: a name that `wait_until` lists, such as RUNNING.
        safety_mode: a name that `wait_until` lists, such as NORMAL.
        safety_status: the same, or which of the safeguards of an e-Series box stops it.
        operational_mode: NONE, MANUAL or AUTOMATIC; of a CB3 NONE.
        remote_control: clients may command the box; those of a CB3 always may.
        program_state: a name that `wait_until` lists, such as PLAYING.
        program: name of the program that runs, "" without one.
        joint_modes: of the six joints, such as RUNNING, IDLE or POWER_OFF.
        steady: nothing moves the arm and it stands still.
        q: measured joint angles, base to wrist 3 [rad].
        qd: measured joint speeds [rad/s].
        target_q: where the joints are asked to be [rad].
        tcp_pose: measured [m, rotation vector in rad].
        tcp_speed: measured [m/s, rad/s].
        tcp_force: estimated wrench at the TCP [N, Nm].
        speed: the speed slider, 0 to 1.
        payload: mass that the controller believes in [kg].
        payload_cog: its centre of gravity in the flange frame [m].
        digital_inputs: levels of the groups standard (8), configurable (8) and tool (2).
        digital_outputs: as digital_inputs.
        analog_inputs: of the box [V or A].
        analog_outputs: of the box [V or A].
        tool_analog_inputs: [V or A].
        tool_voltage: supply of the tool [V].
        obstacles: names of those that were added.
        things: what can be moved around the arm.
        shapes: of all that stands around the arm and hangs on its flange, and safety planes; to be drawn.
        contacts: points in which bodies press on each other, also two things or the pads of a tool.
        grippers: of each tool: width between the pads [m]; SID, STA, OBJ and FLT of a Robotiq gripper, unit
            and status of one of OnRobot; the vacuum of a cup as a share of the full one.
        popups: texts of the popups on the screen.
        questions: of programs, which wait for an answer.
        clients: address and port of each, as "127.0.0.1:51234 at rtde 30004"; not those of the control API.
    """

    tick: int
    time: float
    robot_mode: str
    safety_mode: str
    safety_status: str
    operational_mode: str
    remote_control: bool
    program_state: str
    program: str
    joint_modes: tuple[str, ...]
    steady: bool
    q: Vector6
    qd: Vector6
    target_q: Vector6
    tcp_pose: Vector6
    tcp_speed: Vector6
    tcp_force: Vector6
    speed: float
    payload: float
    payload_cog: Vector3
    digital_inputs: Levels
    digital_outputs: Levels
    analog_inputs: tuple[float, ...]
    analog_outputs: tuple[float, ...]
    tool_analog_inputs: tuple[float, ...]
    tool_voltage: int
    obstacles: tuple[str, ...]
    things: tuple[ThingNow, ...]
    shapes: tuple[BodyShape, ...]
    contacts: tuple[Contact, ...]
    grippers: tuple[dict[str, float], ...]
    popups: tuple[str, ...]
    questions: tuple[Question, ...]
    clients: tuple[str, ...] = field(compare=False)  # ports of clients are others in each run


def is_steady(controller: Controller) -> bool:
    """Return whether nothing moves the arm and it stands still."""
    moves = controller.state.motion.is_moving
    return not moves and max(map(abs, controller.snapshot.actual_qd)) < STANDING_SPEED


def take_state(box: ServedBox) -> BoxState:
    """Return the state of a box; in the thread of its loop, or when it does not run."""
    controller = box.controller
    now, pendant, physics = controller.snapshot, controller.state.pendant, controller.plant.physics
    popups = tuple(r.text for r in pendant.requests if r.kind is RequestedType.NONE)
    return BoxState(
        tick=now.tick,
        time=now.timestamp,
        robot_mode=RobotMode(now.robot_mode).name,
        safety_mode=SafetyMode(now.safety_mode).name,
        safety_status=SafetyStatus(now.safety_status).name,
        operational_mode=controller.state.operational.mode.name,
        remote_control=bool(pendant.remote_period),
        program_state=ProgramState(now.runtime_state).name,
        program="" if now.runtime_state == ProgramState.STOPPED else now.program_name,
        joint_modes=tuple(JointMode(mode).name for mode in now.joint_mode),
        steady=is_steady(controller),
        q=now.actual_q,
        qd=now.actual_qd,
        target_q=now.target_q,
        tcp_pose=now.actual_tcp_pose,
        tcp_speed=now.actual_tcp_speed,
        tcp_force=now.actual_tcp_force,
        speed=now.target_speed_fraction,
        payload=now.payload,
        payload_cog=now.payload_cog,
        digital_inputs=_levels(now.actual_digital_input_bits),
        digital_outputs=_levels(now.actual_digital_output_bits),
        analog_inputs=now.analog_values[:2],
        analog_outputs=now.analog_values[2:4],
        tool_analog_inputs=now.analog_values[4:],
        tool_voltage=now.tool_output_voltage,
        obstacles=tuple(shape.name for shape in physics.scene.obstacles),
        things=tuple(map(physics.scene.state, physics.scene.names)),
        shapes=(*physics.shapes, *map(_shape_of, controller.state.safety.limits.boundaries.planes)),
        contacts=physics.contacts,
        grippers=tuple(gripper.summary() for gripper in controller.state.grippers),
        popups=(*pendant.shown, *popups),
        questions=tuple(
            Question(r.request_id, r.kind.name, r.text)
            for r in pendant.requests
            if r.kind is not RequestedType.NONE
        ),
        clients=tuple(client for listener in box.listeners for client in listener.clients),
    )


def _shape_of(plane: SafetyPlane) -> BodyShape:
    x, y, z = plane.normal
    across = hypot(x, y)
    angle = atan2(across, z) / across if across else pi * (z < 0.0)
    turn = (-y * angle, x * angle, 0.0) if across else (angle, 0.0, 0.0)  # takes z to the normal
    return BodyShape(plane.name, False, "safety plane", (), (*plane.position, *turn))


def _levels(word: int) -> Levels:
    return {
        name: tuple(bool(word >> bit & 1) for bit in group.bits) for name, group in DIGITAL_GROUPS.items()
    }
