"""All that a control cycle reads and writes, in one place.

The controller owns the one instance; the script functions of a running program get it to act on.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from ur_emulator.controller.compliance.compliance import Compliance
from ur_emulator.controller.compliance.external_sensor import ExternalSensor
from ur_emulator.controller.compliance.force_sense import ForceSense
from ur_emulator.controller.error_settings import ErrorSettings
from ur_emulator.controller.events import Event
from ur_emulator.controller.io.configuration import IoConfiguration
from ur_emulator.controller.io.encoders import Encoders
from ur_emulator.controller.io.lines import InputOutput
from ur_emulator.controller.io.registers import Registers
from ur_emulator.controller.io.watchdogs import Watchdogs
from ur_emulator.controller.modbus.map_memory import PortMemory
from ur_emulator.controller.modbus.signals import ModbusSignals
from ur_emulator.controller.operator import Operator
from ur_emulator.controller.robot_mode import RobotModeMachine
from ur_emulator.controller.safety.safety_state import SafetyState
from ur_emulator.controller.safety.speed_limiter import SpeedLimiter
from ur_emulator.controller.snapshot import Snapshot
from ur_emulator.kinematics.arm_model import ArmModel
from ur_emulator.models.robot_generation import RobotGeneration
from ur_emulator.models.robot_model import ZERO6, RobotModel, Vector3, Vector6
from ur_emulator.motion.arm_motion import ArmMotion

# How far back a script may ask for joint positions [s]; the real buffer's length is not known.
HISTORY_TIME = 1.0


@dataclass(slots=True)
class Payload:
    """What the controller believes to hang at the flange: mass [kg], centre of gravity [m] in its frame.

    `at_tcp`: the centre of gravity was never given; it is the TCP, wherever that will be.
    `inertia`: as stated, Ixx Iyy Izz Ixy Ixz Iyz [kg m^2]; it is only reported.
    """

    mass: float = 0.0
    cog: Vector3 = (0.0, 0.0, 0.0)
    at_tcp: bool = False
    inertia: Vector6 = ZERO6


@dataclass(slots=True)
class ControllerState:
    """The mutable state of one control box.

    Attributes:
        robot: numbers of the arm.
        arm: the controller's (calibrated) kinematics.
        generation: of the robot.
        period_s: duration of a control cycle [s].
        seed: of everything random in the box.
        motion: where the joints are asked to go, and by whom.
        mode: robot mode and its way.
        safety: safety mode.
        limiter: keeps joint speeds below those of a safety mode that limits them; None in the others.
        buttons: of the pendant that are pressed, as in RobotStatusBits.
        snapshot: state at the end of the last cycle; what scripts see as "actual" during this one.
        events: what was said since the last cycle ended, in order.
        speed_slider: 0..1.
        force_mode_damping: as scripts have set it, for a force mode to come; 0..1.
        force_mode_gain_scaling: likewise, 0..2.
        stop_requested: a script or a client asked for a protective stop in this cycle.
        q_history: measured joint positions of the last cycles, the newest first.
        client_inputs: last values of RTDE inputs that are no registers, by name.
        wants_script_line: somebody reads the line that the program executes.
        steady_cycles: for how many cycles the target has stood still.
        tick: number of the cycle.
        program_tick: cycles that primary programs have had; it stands still while one is paused.
        io_configuration: which inputs act, which outputs follow the program.
        watchdogs: of the running program over RTDE inputs.
        external_sensor: takes the place of the estimated wrench while it is enabled.
        encoders: of conveyors.
        ports: own memory of the Modbus map.
        modbus: signals of other units that programs have added.
        operator: what programs ask of the operator.
        error_settings: what programs have said about errors.
        power_off_requested: a script asked for it in this cycle.
        compliance: force mode, and who guides the arm by hand.
        force_sense: zero and recent past of the wrench.
        place_arm: puts the resting arm at joint angles [rad]; False where it would touch something.
    """

    robot: RobotModel
    arm: ArmModel
    generation: RobotGeneration
    seed: int
    motion: ArmMotion
    mode: RobotModeMachine
    period_s: float = field(init=False)
    snapshot: Snapshot = field(init=False)
    safety: SafetyState = field(default_factory=SafetyState)
    limiter: SpeedLimiter | None = None
    buttons: int = 0
    registers: Registers = field(default_factory=Registers)
    io: InputOutput = field(default_factory=InputOutput)
    payload: Payload = field(default_factory=Payload)
    gravity: Vector3 = (0.0, 0.0, 9.82)
    tcp_offset: Vector6 = ZERO6
    speed_slider: float = 1.0
    force_mode_damping: float = 0.0
    force_mode_gain_scaling: float = 1.0
    steady_cycles: int = 0
    tick: int = 0
    program_tick: int = 0
    stop_requested: bool = False
    wants_script_line: bool = False
    client_inputs: dict[str, Any] = field(default_factory=dict)
    q_history: deque[Vector6] = field(init=False)
    events: list[Event] = field(default_factory=list)
    modbus: ModbusSignals = field(init=False)
    io_configuration: IoConfiguration = field(init=False)
    watchdogs: Watchdogs = field(init=False)
    external_sensor: ExternalSensor | None = None
    encoders: Encoders = field(default_factory=Encoders)
    ports: PortMemory = field(default_factory=PortMemory)
    operator: Operator = field(default_factory=Operator)
    error_settings: ErrorSettings = field(default_factory=ErrorSettings)
    power_off_requested: bool = False
    compliance: Compliance = field(default_factory=Compliance)
    force_sense: ForceSense = field(init=False)
    place_arm: Callable[[Vector6], bool] = field(init=False)

    def __post_init__(self) -> None:
        self.period_s = self.generation.period_s
        self.q_history = deque(maxlen=self.generation.cycles(HISTORY_TIME))
        self.force_sense = ForceSense(self.generation)
        self.modbus = ModbusSignals(self.period_s)
        self.io_configuration = IoConfiguration(self.io, self.registers, self.modbus)
        self.watchdogs = Watchdogs(self.period_s)

    @property
    def time(self) -> float:
        """Seconds since controller start, at the end of this cycle."""
        return self.generation.seconds(self.tick)
