"""ControllerState: the parts of a controller, each with its own methods to change it.

A part stays as long as the controller. Scripts, commands and ports get the parts that they act on.
"""

from collections.abc import Callable, Sequence
from typing import Final

from protocol.ur_types import RobotMode, SoftwareVersion
from ur_emulator.machine.controller.arm_dynamics import ArmDynamics
from ur_emulator.machine.controller.client_inputs import ClientInputs
from ur_emulator.machine.controller.clock import Clock
from ur_emulator.machine.controller.compliance import Compliance
from ur_emulator.machine.controller.electrics import EnergyMeter
from ur_emulator.machine.controller.events import EventQueue, ProgramRequests
from ur_emulator.machine.controller.force_sense import ForceSense
from ur_emulator.machine.controller.interpreter_queue import InterpreterQueue
from ur_emulator.machine.controller.io.configuration import IoConfiguration
from ur_emulator.machine.controller.io.encoders import Encoder
from ur_emulator.machine.controller.io.lines import InputOutput
from ur_emulator.machine.controller.io.modbus_signals import ModbusSignals
from ur_emulator.machine.controller.io.network import Network
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
from ur_emulator.machine.models.fidelity import Fidelity, dead_cycles
from ur_emulator.machine.models.robot_model import Vector6
from ur_emulator.machine.motion.arm_motion import ArmMotion
from ur_emulator.machine.tools import SUPPLY, make_grippers
from ur_hil.tools import ToolModel

# Controller time at start [s]: a public client library does not trust a controller clock below 40 s.
BOOT_TIME = 60.0


class ControllerState:
    """The parts of one controller, made in the order in which they need each other."""

    def __init__(
        self,
        arm: ArmModel,
        fidelity: Fidelity,
        seed: int,
        mode: RobotMode,
        version: tuple[int, int],
        tools: Sequence[ToolModel],
        place_arm: Callable[[Vector6], bool],
    ) -> None:
        """Make the parts; arguments as of `Controller`.

        Args:
            arm: its kinematics with the calibration that the controller knows.
            place_arm: puts the resting arm at joint angles [rad]; False where it would touch something.
        """
        robot, generation = arm.robot, arm.robot.generation
        period_s, limits = generation.period_s, generation.limits
        self.robot: Final = robot
        self.seed: Final = seed
        self.place_arm: Final = place_arm
        self.clock: Final = Clock(generation, generation.cycles(BOOT_TIME))
        # What this cycle has said, and the results of those before.
        self.events: Final = EventQueue()
        self.requests: Final = ProgramRequests()
        self.past: Final = PastCycles(generation)
        # The arm, what programs have declared of its tool, its dynamics with that, the targets of its joints.
        self.arm: Final = arm
        self.tool: Final = ToolSettings()
        self.dynamics: Final = ArmDynamics(robot, arm.dh, self.tool)
        self.motion: Final = ArmMotion(
            robot.home_q,
            robot.stop_deceleration,
            generation.run_up_time,
            dead_cycles(fidelity, seed, period_s),
        )
        if limits.brakes_within_torque:
            self.motion.braking = self.dynamics.greatest_deceleration
        self.speed: Final = SpeedScaling()
        self.planning: Final = PlanningSettings()
        self.world: Final = WorldModel(lambda: arm.fk(self.motion.target.q), self.tool)
        self.force_sense: Final = ForceSense(generation, self.tool)
        self.energy: Final = EnergyMeter(generation)
        self.error_settings: Final = ErrorSettings()
        # Modes, and who has chosen them.
        self.mode: Final = RobotModeMachine(mode, period_s)
        self.safety: Final = SafetyState(
            limits_of(robot), has_programs_in_recovery=limits.has_programs_in_recovery
        )
        self.operational: Final = OperationalModeChoice()
        self.enabling_device: Final = EnablingDevice()
        # Lines, registers, other units and the operator.
        self.io: Final = InputOutput()
        self.registers: Final = Registers()
        self.watchdogs: Final = Watchdogs(period_s)
        self.client_inputs: Final = ClientInputs(
            self.io, self.registers, self.speed, self.watchdogs, self.clock
        )
        self.encoders: Final = (Encoder(), Encoder())
        self.network: Final = Network()
        self.modbus: Final = ModbusSignals(period_s, self.network)
        self.modbus_map: Final = MapMemory(version)
        self.io_configuration: Final = IoConfiguration(self.io, self.registers, self.modbus)
        self.pendant: Final = Pendant()
        self.interpreter: Final = InterpreterQueue()
        self.compliance: Final = Compliance(
            self.motion, self.mode, self.safety, self.operational, self.io_configuration, self.past, robot
        )
        has_tool_line = bool(tools) and generation.software(SoftwareVersion(*version)).has_tool_line
        self.grippers: Final = make_grippers(tools, period_s, has_tool_line)
        if self.grippers:
            # As the installations of their makers do.
            self.io.tool_voltage = SUPPLY
            self.io.tool_line = self.grippers[0].line
