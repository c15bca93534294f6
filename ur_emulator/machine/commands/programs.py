"""Commands for programs: the running one, the speed slider, its questions and popups, interpreter mode."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from protocol.primary.messages import RequestedType
from protocol.ur_types import ProgramState, RobotMode
from ur_emulator.errors import RefusedError
from ur_emulator.machine.commands.operation import CommandOperation, parameter
from ur_emulator.machine.controller.command import BoxParts, Result, refuse
from ur_emulator.machine.controller.events import PopupShown, ScriptFailed
from ur_emulator.machine.controller.pendant import Answer
from ur_emulator.machine.controller.safety.inputs import SafetyInput
from ur_emulator.machine.controller.safety.modes import ROW
from ur_emulator.machine.controller.safety.safety_state import ConfiguredLimits

if TYPE_CHECKING:
    from ur_emulator.machine.controller.state import ControllerState
    from urscript import CompiledProgram
    from urscript.compile.interpreter_mode import CompiledStatements

PROGRAM_RUNS = "a program runs, stop it first"


@dataclass(frozen=True, slots=True)
class StartProgram:
    """Run a compiled program; a primary program replaces the one that runs, a `sec` runs beside it.

    `loaded`: it comes from a file and was played; otherwise it came through a socket.
    """

    program: CompiledProgram
    pauses: bool = False
    loaded: bool = False

    def apply(self, box: BoxParts) -> None:
        obstacle = why_not_running(box.state)
        if obstacle:
            text = f"program {self.program.name} not started: {obstacle}"
            box.state.events.append(ScriptFailed(1, 1, text))
            raise RefusedError(text)
        box.programs.start(self.program, loaded=self.loaded)
        if self.pauses:
            box.programs.pause()


@dataclass(frozen=True, slots=True)
class SetUp:
    """Run what makes an installation effective; unlike a program it needs no power. Not while a program runs.

    `program` is a `sec`; `inputs` are pairs of configurable inputs (e-Series), in place of those before.
    """

    program: CompiledProgram
    limits: ConfiguredLimits
    inputs: Mapping[int, SafetyInput]

    def apply(self, box: BoxParts) -> None:
        if box.programs.is_running:
            raise RefusedError(PROGRAM_RUNS)
        box.safety.set_limits(self.limits)
        if box.state.robot.generation.has_operational_modes:
            box.safety.set_up_inputs(self.inputs)
        box.programs.start(self.program)


class StopProgram(CommandOperation):
    """End the program, if one runs."""

    def apply(self, box: BoxParts) -> None:
        box.programs.stop()


@dataclass(frozen=True, slots=True)
class EndPrograms:
    """End the secondary programs with an error, or, if there is none, the primary program."""

    text: str

    def apply(self, box: BoxParts) -> None:
        box.programs.end_for_memory(self.text)


@dataclass(frozen=True, slots=True)
class ReportLine:
    """Publish the line that the program executes, or do not: a client reads it."""

    is_read: bool

    def apply(self, box: BoxParts) -> None:
        box.programs.reports_line = self.is_read


class PauseProgram(CommandOperation):
    """Let the program stand still, and the arm come to rest on its path."""

    def apply(self, box: BoxParts) -> None:
        if not box.programs.is_running or box.programs.is_paused:
            raise RefusedError(f"there is no program to pause: the program state is {_program_state(box)}")
        box.programs.pause()


class ResumeProgram(CommandOperation):
    """Let a paused program go on."""

    def apply(self, box: BoxParts) -> None:
        if not box.programs.is_paused:
            raise RefusedError(f"there is no program to resume: the program state is {_program_state(box)}")
        obstacle = why_not_running(box.state)
        if obstacle:
            refuse(box.state, f"program {box.programs.name} stays paused: {obstacle}")
        box.programs.resume()


class SetSpeedSlider(CommandOperation):
    """Set the speed slider."""

    fraction: float = parameter("of full speed", low=0.0, high=1.0)

    def apply(self, box: BoxParts) -> None:
        box.state.speed.slider = self.fraction


def why_not_running(state: ControllerState) -> str:
    """Return why no program may move the arm now; "" if one may."""
    if not state.safety.lets_programs_run:
        safety = state.safety.status
        return f"the robot is in {safety.name}, it must be RUNNING: {ROW[safety].remedy}"
    mode = state.mode.mode
    return "" if mode is RobotMode.RUNNING else f"the robot is in {mode.name}, it must be RUNNING"


def _program_state(box: BoxParts) -> str:
    return ProgramState(box.state.past.snapshot.runtime_state).name


@dataclass(frozen=True, slots=True)
class AppendStatements:
    """Add a compiled line to interpreter mode; `epoch` is that of the queue when its names were taken."""

    statements: CompiledStatements
    epoch: int

    def apply(self, box: BoxParts) -> dict[str, int]:
        """Return its id; 0 if its names do not hold any more."""
        return {"id": box.state.interpreter.append(self.statements, self.epoch)}


@dataclass(frozen=True, slots=True)
class SkipStatements:
    """Drop the lines that have not begun."""

    def apply(self, box: BoxParts) -> None:
        box.state.interpreter.skip()


@dataclass(frozen=True, slots=True)
class AbortMove:
    """End a movej or movel of any program; the instruction returns."""

    def apply(self, box: BoxParts) -> None:
        box.state.motion.abort()


class AnswerRequest(CommandOperation):
    """Answer a question of a program."""

    value: Answer = parameter("of the type that was asked for")
    id: int | None = parameter(
        "number of the question; the oldest that fits if left out", low=1, default=None
    )
    result: ClassVar[str] = "`id`: number of the question, and `tick`"

    def apply(self, box: BoxParts) -> Result:
        pendant = box.state.pendant
        asked = [r for r in pendant.requests if r.kind is not RequestedType.NONE]
        answered = pendant.answer(self.value, self.id)
        if answered is None:
            questions = ", ".join(f"{r.request_id} ({r.kind.name.lower()}): {r.text}" for r in asked)
            raise RefusedError(
                f"{self.value!r} answers no question: {f'asked is {questions}' if asked else 'none is open'}"
            )
        return {"id": answered}


class ClosePopup(CommandOperation):
    """Press the button of all popups."""

    def apply(self, box: BoxParts) -> None:
        box.state.pendant.close_popups()


@dataclass(frozen=True, slots=True)
class ShowPopup:
    """Show a popup that does not block a program; it stays until it is closed."""

    text: str

    def apply(self, box: BoxParts) -> None:
        box.state.pendant.show(self.text)
        box.state.events.append(PopupShown("Popup", self.text, False, False, False))
