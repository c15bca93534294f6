"""`wait_until`, and its conditions: each parameter with the present value in the box."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar

from protocol.primary.messages import RequestedType
from protocol.ur_types import ProgramState, RobotMode, SafetyMode
from ur_emulator.commands.parameters import parameter
from ur_emulator.control.box_state import BoxState, is_steady, take_state
from ur_emulator.control.step_operation import Context, StepOperation
from ur_emulator.errors import ArgumentError, WaitTimeoutError

if TYPE_CHECKING:
    from ur_emulator.controller.controller import Controller
    from ur_emulator.servers.steps import Steps


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
