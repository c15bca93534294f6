"""Commands: what clients and people ask of the controller. They are applied in order as a cycle begins.

A command is any record that can be applied to the parts of a box; those that clients, people and tests use
are in `ur_emulator.machine.commands`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NoReturn, Protocol, runtime_checkable

from protocol.primary.messages import ReportLevel
from ur_emulator.errors import RefusedError
from ur_emulator.machine.controller.events import ErrorReported

if TYPE_CHECKING:
    from ur_emulator.machine.controller.program_runner import ProgramRunner
    from ur_emulator.machine.controller.safety_system import SafetySystem
    from ur_emulator.machine.controller.state import ControllerState
    from ur_emulator.machine.plant.arm_plant import ArmPlant

# Values that a command returns; most return none.
Result = Mapping[str, Any] | None
# The result of a command, or the error that has ended it: a `RefusedError` if it was refused.
Outcome = tuple[Result, Exception | None]
# Called in the cycle in which a command was applied, with its result, or with its refusal or another error.
Done = Callable[[Result, Exception | None], None]


class BoxParts(Protocol):
    """The parts of a box that commands act on; `safety` applies safety events to arm, program and power."""

    state: ControllerState
    plant: ArmPlant
    programs: ProgramRunner
    safety: SafetySystem


@runtime_checkable
class Command(Protocol):
    """Something that is done to a box at the beginning of a cycle."""

    def apply(self, box: BoxParts) -> Result:
        """Apply the command; RefusedError if the state of the box does not allow it."""


def outcome_of(command: Command, box: BoxParts) -> Outcome:
    """Apply a command; an error ends only the command, and its traceback holds nothing of the cycle."""
    try:
        return command.apply(box), None
    except Exception as error:
        return None, error


def refuse(state: ControllerState, text: str) -> NoReturn:
    """Refuse a command, and report to clients and log why it is not done."""
    state.events.append(ErrorReported(0, 0, ReportLevel.INFO, text))
    raise RefusedError(text)
