"""StepOperation: an operation that takes no cycle or several, done in steps (see `servers.steps`)."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ur_emulator.commands.operation import Operation, R_co

if TYPE_CHECKING:
    from ur_emulator.servers.box_access import BoxAccess
    from ur_emulator.servers.programs.player import ProgramPlayer
    from ur_emulator.servers.steps import Steps


@dataclass(slots=True)
class Context:
    """What the steps of operations need.

    Attributes:
        access: to the box.
        player: loads and plays program files.
        clock: monotonic seconds.
        identity: returns the result of `identity`.
        make: makes an operation of the table from its name and arguments; raises ArgumentError.
    """

    access: BoxAccess
    player: ProgramPlayer
    clock: Callable[[], float]
    identity: Callable[[], dict[str, Any]]
    make: Callable[[str, Mapping[str, Any]], Operation[Any]]


class StepOperation(Operation[R_co]):
    """An operation that is done in steps."""

    @abstractmethod
    def steps(self, context: Context) -> Steps[Any]:
        """Do it; yield to wait for the next cycle.

        Returns:
            The result: an object that JSON can hold, or a dataclass.

        Raises:
            ControlError: it cannot be done, or not now.
        """
