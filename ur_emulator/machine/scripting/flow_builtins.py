"""Builtins that hold a program up or end it: popups, requests for values, interpreter mode, errors.

A client of the control API answers instead of an operator.
"""

from collections.abc import Generator
from functools import partial
from typing import Any, NoReturn

from protocol.primary.messages import RequestedType
from ur_emulator.machine.controller.events import EventQueue, PopupShown, ProgramRequests, ValueRequested
from ur_emulator.machine.controller.interpreter_queue import InterpreterQueue
from ur_emulator.machine.controller.past_cycles import PastCycles
from ur_emulator.machine.controller.pendant import Answer, Pendant, PendantRequest
from ur_emulator.machine.controller.settings import ErrorSettings
from ur_emulator.machine.models.robot_model import six
from ur_emulator.machine.scripting.builtin_group import BuiltinGroup, builtin
from urscript.errors import ScriptRuntimeError
from urscript.run.host import EnterMode, HostFunction
from urscript.run.threads import ProgramHalted
from urscript.run.waits import NEXT_CYCLE, Blocked, Outside, Wait
from urscript.values import log_form


class PendantBuiltins(BuiltinGroup):
    """Popups and requests for values."""

    def __init__(self, pendant: Pendant, events: EventQueue) -> None:
        self._pendant = pendant
        self._events = events

    def functions(self) -> dict[str, HostFunction]:
        """Return the builtins."""
        kinds = (RequestedType.BOOLEAN, RequestedType.INTEGER, RequestedType.FLOAT, RequestedType.STRING)
        return super().functions() | {
            f"request_{kind.name.lower()}_from_primary_client": partial(self._request_value, kind)
            for kind in kinds
        }

    @builtin("popup")
    def _popup(
        self, thread: object, s: Any, title: str, warning: bool, error: bool, blocking: bool
    ) -> Generator[Blocked, None, None]:
        text = log_form(s)
        if not blocking:
            self._pendant.show(text)
            self._events.append(PopupShown(title, text, warning, error, blocking))
            return
        request = self._pendant.ask(RequestedType.NONE, text)
        self._events.append(PopupShown(title, text, warning, error, blocking, request.request_id))
        yield from self._wait_for(request)

    def _request_value(
        self, kind: RequestedType, thread: object, text: str
    ) -> Generator[Blocked, None, Answer | None]:
        request = self._pendant.ask(kind, text)
        self._events.append(ValueRequested(request.request_id, kind, text))
        return (yield from self._wait_for(request))

    def _wait_for(self, request: PendantRequest) -> Generator[Blocked, None, Answer | None]:
        try:
            yield Blocked(lambda: request.is_answered, Outside.OPERATOR)
        finally:
            self._pendant.withdraw(request)  # the program may have been stopped meanwhile
        return request.answer


class InterpreterBuiltins(BuiltinGroup):
    """Interpreter mode: begin it, end it, clear what it has added to the program."""

    def __init__(self, queue: InterpreterQueue) -> None:
        self._queue = queue

    @builtin("interpreter_mode")
    def _begin(self, thread: object, clear_queue_on_enter: bool, clear_on_end: bool) -> EnterMode:
        return partial(self._queue.enter, clear_queue=clear_queue_on_enter, clear_on_end=clear_on_end)

    @builtin("end_interpreter")
    def _end(self, thread: object) -> None:
        self._queue.is_ending = self._queue.is_on

    @builtin("clear_interpreter")
    def _clear(self, thread: object) -> None:
        if not self._queue.is_on:
            raise ScriptRuntimeError("clear_interpreter can only be called in interpreter mode")
        self._queue.is_clearing = True


class ErrorBuiltins(BuiltinGroup):
    """Errors and limits (most only keep a setting), `powerdown`, and the statement `pause`."""

    def __init__(self, settings: ErrorSettings, past: PastCycles, requests: ProgramRequests) -> None:
        self._settings = settings
        self._past = past
        self._requests = requests

    @builtin("pause_on_error_code")
    def _pause_on_error_code(self, thread: object, code: int, argument: int | None) -> None:
        self._settings.pause_codes.add((code, argument))

    @builtin("position_deviation_warning")
    def _position_deviation_warning(self, thread: object, enabled: bool, threshold: float) -> None:
        settings = self._settings
        settings.warns_of_deviation, settings.deviation_threshold = enabled, float(threshold)

    @builtin("set_safety_mode_transition_hardness")
    def _set_safety_mode_transition_hardness(self, thread: object, kind: int) -> None:
        self._settings.transition_hardness = kind

    @builtin("reset_revolution_counter")
    def _reset_revolution_counter(self, thread: object, q_near: Any) -> None:
        # A real box uses it when new safety settings limit a joint that had no limits: not here.
        given = None if q_near is None else six([float(x) for x in q_near])
        self._settings.revolution_reference = given or self._past.sensed.actual_q

    @builtin("high_holding_torque_enable")
    def _enable_high_holding_torque(self, thread: object) -> None:
        self._settings.holds_high = True

    @builtin("high_holding_torque_disable")
    def _disable_high_holding_torque(self, thread: object) -> None:
        self._settings.holds_high = False

    @builtin("protective_stop")
    def _protective_stop(self, thread: object) -> None:
        self._requests.protective_stop = True

    @builtin("powerdown")
    def _powerdown(self, thread: object) -> NoReturn:
        self._requests.power_off = True
        raise ProgramHalted

    @builtin("pause")
    def _pause(self, thread: object) -> Generator[Wait, None, None]:
        self._requests.pause = True
        yield NEXT_CYCLE
