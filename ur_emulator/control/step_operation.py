"""Operations that take no cycle or several, done in steps (see `servers.steps`); `wait_until` and `at`."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from protocol.primary.messages import RequestedType
from protocol.ur_types import ProgramState, RobotMode, SafetyMode
from ur_emulator.commands.operation import CommandOperation, Operation, R_co, parameter
from ur_emulator.control.box_state import BoxState, is_steady, take_state
from ur_emulator.controller.events import LogAdded
from ur_emulator.errors import ArgumentError, WaitTimeoutError

if TYPE_CHECKING:
    from ur_emulator.controller.command import Result
    from ur_emulator.controller.controller import Controller
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


# --- `wait_until`, and its conditions: each parameter with the present value in the box


def _has_popup(controller: Controller) -> bool:
    operator = controller.state.operator
    return bool(operator.shown) or any(r.kind is RequestedType.NONE for r in operator.requests)


def _has_question(controller: Controller) -> bool:
    return any(r.kind is not RequestedType.NONE for r in controller.state.operator.requests)


CONDITIONS: dict[str, Callable[[Controller], object]] = {
    "robot_mode": lambda controller: RobotMode(controller.snapshot.robot_mode).name,
    "safety_mode": lambda controller: SafetyMode(controller.snapshot.safety_mode).name,
    "program_state": lambda controller: ProgramState(controller.snapshot.runtime_state).name,
    "steady": is_steady,
    "popup": _has_popup,
    "question": _has_question,
}


class WaitUntil(StepOperation[BoxState]):
    """Wait until all conditions hold at the end of a cycle, and return the state then.

    In lockstep time stands still while nothing goes on: what would only come with time does not come. With
    `time`, it passes until then.
    The program state is still STOPPED right after a port was sent a program.

    Raises:
        WaitTimeoutError: they did not all hold in time.
        RefusedError: `time` is more than an hour ahead.
    """

    time: float | None = parameter("the time of the robot, as in `state`, is reached", "s", 0.0, default=None)
    robot_mode: str | None = parameter(
        "the robot mode is this", choices=tuple(RobotMode.__members__), default=None
    )
    safety_mode: str | None = parameter(
        "the safety mode is this", choices=tuple(SafetyMode.__members__), default=None
    )
    program_state: str | None = parameter(
        "the program state is this", choices=tuple(ProgramState.__members__), default=None
    )
    steady: bool | None = parameter("the arm stands still, or not", default=None)
    popup: bool | None = parameter("a popup is shown, or none", default=None)
    question: bool | None = parameter("a program waits for an answer, or none does", default=None)
    log: str | None = parameter("an entry of the log contains this", default=None)
    after: int = parameter("entries of the log that do not count", low=0, default=0)
    timeout: float = parameter("give up after so long in real time", "s", 0.0, 3600.0, default=10.0)
    result: ClassVar[str] = "the state, as `state` gives it"
    is_logged: ClassVar[bool] = False

    def steps(self, context: Context) -> Steps[Any]:
        """Look after every cycle."""
        wanted = {name: value for name in CONDITIONS if (value := getattr(self, name)) is not None}
        if not wanted and self.log is None and self.time is None:
            raise ArgumentError("wait_until needs a condition, such as program_state STOPPED or steady true")
        log, controller = context.access.log, context.access.controller
        end = context.clock() + self.timeout
        after, seen = self.after, self.log is None
        begin = 0 if self.time is None else controller.generation.tick_at(self.time)
        context.access.wake_until(begin)
        while True:
            if not seen:
                seen = any(str(self.log) in entry.text for entry in log.since(after))
                after = max(after, log.count)
            missing = _unmet(controller, wanted) + ([] if seen else [f"no log entry with {self.log!r}"])
            if controller.snapshot.tick < begin:
                missing.append(f"time is {controller.snapshot.timestamp:g} s, not {self.time:g} s")
            if not missing:
                return take_state(controller)
            if context.clock() >= end:
                raise WaitTimeoutError(f"waited {self.timeout:g} s in vain: {', '.join(missing)}")
            yield


def _unmet(controller: Controller, wanted: dict[str, Any]) -> list[str]:
    """Return, for people, what does not hold."""
    values = {name: CONDITIONS[name](controller) for name in wanted}
    return [
        f"{name} is {value}, not {wanted[name]}" for name, value in values.items() if value != wanted[name]
    ]


# --- `at`: an operation at an exact time of the robot


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
