"""`at`: an operation at an exact time of the robot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

from ur_emulator.commands.operation import CommandOperation
from ur_emulator.commands.parameters import parameter
from ur_emulator.control.step_operation import Context, StepOperation
from ur_emulator.controller.events import LogAdded
from ur_emulator.errors import ArgumentError

if TYPE_CHECKING:
    from ur_emulator.controller.command import Result
    from ur_emulator.servers.steps import Steps


class At(StepOperation[int]):
    """Do an operation at an exact time of the robot: in the first cycle that ends then, or later.

    It returns at once, and the log says later what has become of the operation. In lockstep it is no reason
    for time to pass: several can be asked for, then a program or `wait_until` with `time` lets it pass.

    Raises:
        ArgumentError: there is no such operation, or it does not take these arguments.
        RefusedError: the time has passed, or too many operations wait.
    """

    time: float = parameter("time of the robot, as in `state`", "s", 0.0)
    operation: str = parameter("name of an operation that acts within one cycle, such as push")
    arguments: Mapping[str, Any] | None = parameter("its parameters by name", default=None)
    result: ClassVar[str] = "`tick`: the cycle in which it will be applied"

    def steps(self, context: Context) -> Steps[Any]:
        """Hand it to the box for its cycle."""
        yield from ()
        access, name = context.access, self.operation
        operation = context.make(name, dict(self.arguments or {}))
        if not isinstance(operation, CommandOperation):
            raise ArgumentError(f"{name} cannot be done at a time: it does not act within one cycle")

        def done(result: Result, error: Exception | None) -> None:
            end = "done" if error is None else f"refused: {error}"
            access.announce(LogAdded("Control", f"{name} at {self.time:g} s: {end}"))

        tick = access.controller.generation.tick_at(self.time)
        access.schedule(tick, operation, done)
        return {"tick": tick}
