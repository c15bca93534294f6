"""ControllerState: the parts of a controller, each with its own methods to change it.

The record itself is frozen. Scripts, commands and ports get the parts that they act on.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from protocol.ur_types import SoftwareVersion
from ur_emulator.machine.controller.arm_dynamics import ArmDynamics
from ur_emulator.machine.controller.client_inputs import ClientInputs
from ur_emulator.machine.controller.clock import Clock
from ur_emulator.machine.controller.compliance import Compliance
from ur_emulator.machine.controller.electrics import EnergyMeter
from ur_emulator.machine.controller.events import EventQueue, ProgramRequests
from ur_emulator.machine.controller.force_sense import ForceSense
from ur_emulator.machine.controller.interpreter_queue import InterpreterQueue
from ur_emulator.machine.controller.io.configuration import IoConfiguration
from ur_emulator.machine.controller.io.encoders import Encoders
from ur_emulator.machine.controller.io.lines import InputOutput
from ur_emulator.machine.controller.io.modbus_signals import ModbusSignals
from ur_emulator.machine.controller.io.registers import MapMemory, Registers
from ur_emulator.machine.controller.io.watchdogs import Watchdogs
from ur_emulator.machine.controller.past_cycles import PastCycles
from ur_emulator.machine.controller.pendant import Pendant
from ur_emulator.machine.controller.robot_mode import RobotModeMachine
from ur_emulator.machine.controller.safety.inputs import EnablingDevice, OperationalModeChoice
from ur_emulator.machine.controller.safety.safety_state import SafetyState, limits_of
from ur_emulator.machine.controller.safety.speed_scaling import SpeedScaling
from ur_emulator.machine.controller.settings import ErrorSettings, PlanningSettings, ToolSettings
from ur_emulator.machine.controller.world_model import WorldModel
from ur_emulator.machine.kinematics.arm_model import ArmModel
from ur_emulator.machine.models.robot_model import RobotModel, Vector6
from ur_emulator.machine.motion.arm_motion import ArmMotion
from ur_emulator.machine.tools import SUPPLY, make_grippers
from ur_emulator.machine.tools.gripper import Gripper
from ur_hil.tools import ToolModel


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerState:
    """The parts of one controller.

    Attributes:
        arm: kinematics of the arm, with the calibration that the controller knows.
        seed: of everything random in the box.
        clock: control cycles, and those of programs.
        motion: targets of the joints, and the thread that moves them.
        place_arm: puts the resting arm at joint angles [rad]; False where it would touch something.
        mode: robot mode, and the modes that lead to another one.
        safety: causes of safety modes, and the mode that they lead to.
        operational: who has chosen which operational mode, and what it allows.
        enabling_device: the three-position enabling device.
        speed: speed slider, and the limits of a safety mode that has some.
        dynamics: the model of the arm with that payload.
        planning: how programs want their moves to be planned.
        world: named frames.
        io_configuration: which inputs act, which outputs follow the program.
        client_inputs: last values of the RTDE inputs that are no registers.
        watchdogs: of the running program over RTDE inputs.
        modbus: signals of other units that programs have added.
        modbus_map: words of the robot's own Modbus map.
        force_sense: zero and history of the wrench.
        pendant: what programs ask of the operator, and the buttons that are pressed.
        interpreter: statements that arrive for the running program.
        error_settings: what programs have set up about errors.
        requests: stops that programs and clients have asked for in this cycle.
        past: snapshot of the last cycle, and joint positions before it.
        events: messages of this cycle, in order, for ports and log.
        grippers: the controllers of the tools on the flange.
    """

    robot: RobotModel
    arm: ArmModel
    seed: int
    clock: Clock
    motion: ArmMotion
    place_arm: Callable[[Vector6], bool]
    mode: RobotModeMachine
    safety: SafetyState
    operational: OperationalModeChoice
    enabling_device: EnablingDevice
    speed: SpeedScaling
    tool: ToolSettings
    energy: EnergyMeter
    dynamics: ArmDynamics
    planning: PlanningSettings
    world: WorldModel
    io: InputOutput
    registers: Registers
    io_configuration: IoConfiguration
    client_inputs: ClientInputs
    watchdogs: Watchdogs
    encoders: Encoders
    modbus: ModbusSignals
    modbus_map: MapMemory
    compliance: Compliance
    force_sense: ForceSense
    pendant: Pendant
    interpreter: InterpreterQueue
    error_settings: ErrorSettings
    requests: ProgramRequests
    past: PastCycles
    events: EventQueue
    grippers: tuple[Gripper, ...]


def make_state(
    robot: RobotModel,
    arm: ArmModel,
    seed: int,
    clock: Clock,
    motion: ArmMotion,
    mode: RobotModeMachine,
    place_arm: Callable[[Vector6], bool],
    version: tuple[int, int],
    tools: Sequence[ToolModel],
) -> ControllerState:
    """Return the parts of a controller, made in the order in which they need each other."""
    io, registers, speed, operational = InputOutput(), Registers(), SpeedScaling(), OperationalModeChoice()
    rules = robot.generation.limits
    safety = SafetyState(limits_of(robot), has_programs_in_recovery=rules.has_programs_in_recovery)
    past, tool = PastCycles(clock.generation), ToolSettings()
    modbus, watchdogs = ModbusSignals(clock.period_s), Watchdogs(clock.period_s)
    io_configuration = IoConfiguration(io, registers, modbus)
    has_tool_line = bool(tools) and robot.generation.software(SoftwareVersion(*version)).has_tool_line
    grippers = make_grippers(tools, clock.period_s, has_tool_line)
    if grippers:
        # As the installations of their makers do.
        io.tool_voltage = SUPPLY
        io.tool_line = grippers[0].line
    return ControllerState(
        robot=robot,
        arm=arm,
        seed=seed,
        clock=clock,
        motion=motion,
        place_arm=place_arm,
        mode=mode,
        safety=safety,
        operational=operational,
        enabling_device=EnablingDevice(),
        speed=speed,
        tool=tool,
        dynamics=ArmDynamics(robot, arm.dh, tool),
        planning=PlanningSettings(),
        world=WorldModel(lambda: arm.fk(motion.target.q), tool),
        energy=EnergyMeter(clock.generation),
        io=io,
        registers=registers,
        io_configuration=io_configuration,
        client_inputs=ClientInputs(io, registers, speed, watchdogs, clock),
        watchdogs=watchdogs,
        encoders=Encoders(),
        modbus=modbus,
        modbus_map=MapMemory(version),
        compliance=Compliance(motion, mode, safety, operational, io_configuration, past, robot),
        force_sense=ForceSense(clock.generation, tool),
        pendant=Pendant(),
        interpreter=InterpreterQueue(),
        error_settings=ErrorSettings(),
        requests=ProgramRequests(),
        past=past,
        events=EventQueue(),
        grippers=grippers,
    )
