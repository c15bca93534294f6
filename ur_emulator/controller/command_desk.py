"""What each command from outside does to the box: one line a command, refusals included.

Commands are frozen records (`commands`, `hands`, `wires`, `obstacles`, `safety_commands`); ports and control
API make them, the controller hands them over at the beginning of a cycle, in order of arrival.
"""

from __future__ import annotations

from protocol.primary_messages import ReportLevel
from protocol.ur_types import RobotMode
from ur_emulator.controller import commands as cmd
from ur_emulator.controller.client_inputs import write_inputs
from ur_emulator.controller.events import ErrorReported, PopupShown, ScriptFailed
from ur_emulator.controller.hands import GuideByHand, HangLoad, Push
from ur_emulator.controller.obstacles import AddObstacle, RemoveObstacle
from ur_emulator.controller.port_map import write_range
from ur_emulator.controller.robot_mode import ModeCommand
from ur_emulator.controller.safety_modes import ROW, SafetyEvent
from ur_emulator.controller.safety_system import SafetySystem
from ur_emulator.controller.state import ControllerState
from ur_emulator.controller.wires import SetAnalogInput, SetDigitalInput, set_wire
from ur_emulator.errors import PlantError
from ur_emulator.plant.plant import Plant
from ur_emulator.scripting.program_slot import ProgramSlot
from urscript import CompiledProgram


class CommandDesk:
    """Does what commands say, or says why not.

    Args:
        state: of the box.
        plant: the arm, for what hands and loads do to it.
        programs: what runs.
        safety: is asked before power, brakes and programs.
    """

    __slots__ = ("_plant", "_programs", "_push_left", "_safety", "_state")

    def __init__(
        self, state: ControllerState, plant: Plant, programs: ProgramSlot, safety: SafetySystem
    ) -> None:
        self._state = state
        self._plant = plant
        self._programs = programs
        self._safety = safety
        self._push_left = 0

    @property
    def is_pushing(self) -> bool:
        """True while a push lasts that ends by itself."""
        return self._push_left > 0

    def step(self) -> None:
        """Count a cycle of a push that lasts for a while; end it after the last."""
        self._push_left -= 1
        if not self._push_left:
            self._plant.push((0.0, 0.0, 0.0))

    def obey(self, command: cmd.Command) -> None:
        """Do what a command says."""
        state = self._state
        match command:
            case cmd.StartProgram(program):
                self._start(program)
            case cmd.StopProgram():
                self._programs.stop()
            case cmd.PauseProgram():
                self._programs.pause()
            case cmd.ResumeProgram():
                self._resume()
            case cmd.PowerOn():
                self._power(ModeCommand.POWER_ON)
            case cmd.PowerOff():
                self._safety.cut_power()
            case cmd.ReleaseBrakes():
                state.compliance.by_client = False
                self._power(ModeCommand.BRAKE_RELEASE)
            case cmd.UnlockProtectiveStop():
                self._safety.happen(SafetyEvent.UNLOCK)
            case cmd.RestartSafety():
                self._safety.happen(SafetyEvent.RESTART)
            case cmd.TriggerProtectiveStop():
                state.stop_requested = True
            case cmd.SetSpeedSlider(fraction):
                state.speed_slider = min(1.0, max(0.0, fraction))
            case cmd.WriteInputs(values):
                write_inputs(state, values)
            case cmd.WriteModbus():
                write_range(state, command.is_coils, command.first, command.values)
            case cmd.AnswerRequest(value, request_id):
                state.operator.answer(value, request_id)
            case cmd.ClosePopup():
                state.operator.close_popups()
            case cmd.ShowPopup(text):
                state.operator.show(text)
                state.events.append(PopupShown("Popup", text, False, False, False))
            case GuideByHand():
                state.compliance.guide(by_client=True)
            case Push(force, point, duration):
                self._plant.push(force, point)
                self._push_left = 0 if duration is None else round(duration / state.period_s)
                if duration is not None and not self._push_left:
                    self._plant.push((0.0, 0.0, 0.0))
            case HangLoad(mass, cog):
                self._plant.hang(mass, cog)
            case AddObstacle(name, shape, size, pose):
                try:
                    self._plant.put_obstacle(name, shape, size, pose)
                except PlantError as error:
                    self._inform(str(error))
            case RemoveObstacle(name):
                self._plant.remove_obstacle(name)
            case SetDigitalInput() | SetAnalogInput():
                set_wire(state.io, command)
            case _:
                self._safety.obey(command)

    def _power(self, command: ModeCommand) -> None:
        """Give the joints power or open their brakes, if the safety system lets them have it."""
        mode = self._state.safety.mode
        if ROW[mode].may_have_power:
            self._state.mode.command(command)
        else:
            self._inform(f"{command.value} refused: the robot is in {mode.name}: {ROW[mode].way_out}")

    def _start(self, program: CompiledProgram) -> None:
        """Start a program if the box is in a state to run one; say so if it is not."""
        obstacle = self._obstacle()
        if obstacle:
            text = f"program {program.name} not started: {obstacle}"
            self._state.events.append(ScriptFailed(1, 1, text))
        else:
            self._programs.start(program)

    def _resume(self) -> None:
        """Let a paused program go on if the box is in a state to run one; say so if it is not."""
        if not self._programs.is_paused:
            return
        obstacle = self._obstacle()
        if obstacle:
            self._inform(f"program {self._programs.name} stays paused: {obstacle}")
        else:
            self._programs.resume()

    def _obstacle(self) -> str:
        """Return why no program may move the arm now; "" if one may."""
        state = self._state
        if state.safety.is_stopped:
            safety = state.safety.mode
            return f"the robot is in {safety.name}, it must be RUNNING: {ROW[safety].way_out}"
        mode = state.mode.mode
        return "" if mode is RobotMode.RUNNING else f"the robot is in {mode.name}, it must be RUNNING"

    def _inform(self, text: str) -> None:
        self._state.events.append(ErrorReported(0, 0, ReportLevel.INFO, text))
