"""Builtins that hold a program up or end it: popups, requests for values, interpreter mode, errors.

A client of the control API answers instead of an operator.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from functools import partial
from typing import Any, NoReturn

from protocol.primary.messages import RequestedType
from ur_emulator.controller.events import EventQueue, PopupShown, ProgramRequests, ValueRequested
from ur_emulator.controller.interpreter_queue import InterpreterQueue
from ur_emulator.controller.past_cycles import PastCycles
from ur_emulator.controller.pendant import Answer, Pendant, PendantRequest
from ur_emulator.controller.settings import ErrorSettings
from ur_emulator.models.robot_model import six
from urscript.errors import ScriptRuntimeError
from urscript.run.host import EnterMode
from urscript.run.threads import ProgramHalted
from urscript.run.waits import NEXT_CYCLE, Blocked, Wait
from urscript.values import log_form

_KINDS = {
    "boolean": RequestedType.BOOLEAN,
    "integer": RequestedType.INTEGER,
    "float": RequestedType.FLOAT,
    "string": RequestedType.STRING,
}


def operator_functions(pendant: Pendant, events: EventQueue) -> Mapping[str, Callable[..., Any]]:
    """Return the builtins for popups and requests."""

    def wait_for(request: PendantRequest) -> Generator[Blocked, None, Answer | None]:
        try:
            yield Blocked(lambda: request.is_answered, outside=True)
        finally:
            pendant.withdraw(request)  # the program may have been stopped meanwhile
        return request.answer

    def popup(
        thread: object, s: Any, title: str, warning: bool, error: bool, blocking: bool
    ) -> Generator[Blocked, None, None]:
        text = log_form(s)
        if not blocking:
            pendant.show(text)
            events.append(PopupShown(title, text, warning, error, blocking))
            return
        request = pendant.ask(RequestedType.NONE, text)
        events.append(PopupShown(title, text, warning, error, blocking, request.request_id))
        yield from wait_for(request)

    def requester(kind: RequestedType) -> Callable[..., Generator[Blocked, None, Answer | None]]:
        def request_value(thread: object, text: str) -> Generator[Blocked, None, Answer | None]:
            request = pendant.ask(kind, text)
            events.append(ValueRequested(request.request_id, kind, text))
            return (yield from wait_for(request))

        return request_value

    return {
        "popup": popup,
        **{f"request_{name}_from_primary_client": requester(kind) for name, kind in _KINDS.items()},
    }


# --- interpreter mode: builtins that begin it, end it and clear what it has added to the program


def interpreter_functions(queue: InterpreterQueue) -> Mapping[str, Callable[..., Any]]:
    """Return the builtins.

    Args:
        queue: of the statements.
    """

    def interpreter_mode(thread: object, clear_queue_on_enter: bool, clear_on_end: bool) -> EnterMode:
        return partial(queue.enter, clear_queue=clear_queue_on_enter, clear_on_end=clear_on_end)

    def end_interpreter(thread: object) -> None:
        queue.end()

    def clear_interpreter(thread: object) -> None:
        if not queue.is_on:
            raise ScriptRuntimeError("clear_interpreter can only be called in interpreter mode")
        queue.clear()

    return {
        "interpreter_mode": interpreter_mode,
        "end_interpreter": end_interpreter,
        "clear_interpreter": clear_interpreter,
    }


# --- builtins about errors and limits (most only keep a setting), `powerdown`, and the statement `pause`


def error_functions(
    settings: ErrorSettings, past: PastCycles, requests: ProgramRequests
) -> Mapping[str, Callable[..., Any]]:
    """Return the builtins about errors, `powerdown` and `pause`."""

    def pause_on_error_code(thread: object, code: float, argument: float | None) -> None:
        settings.pause_on(int(code), None if argument is None else int(argument))

    def position_deviation_warning(thread: object, enabled: bool, threshold: float) -> None:
        settings.warn_of_deviation(enabled, float(threshold))

    def set_safety_mode_transition_hardness(thread: object, kind: float) -> None:
        settings.set_transition_hardness(int(kind))

    def reset_revolution_counter(thread: object, q_near: Any) -> None:
        # A real box uses it when new safety settings limit a joint that had no limits: not here.
        settings.set_revolution_reference(
            past.sensed.actual_q if q_near is None else six([float(x) for x in q_near])
        )

    def powerdown(thread: object) -> NoReturn:
        requests.power_off()
        raise ProgramHalted

    def pause(thread: object) -> Generator[Wait, None, None]:
        requests.pause()
        yield NEXT_CYCLE

    return {
        "pause": pause,
        "pause_on_error_code": pause_on_error_code,
        "position_deviation_warning": position_deviation_warning,
        "set_safety_mode_transition_hardness": set_safety_mode_transition_hardness,
        "reset_revolution_counter": reset_revolution_counter,
        "powerdown": powerdown,
        "high_holding_torque_enable": lambda thread: settings.set_high_holding_torque(True),
        "high_holding_torque_disable": lambda thread: settings.set_high_holding_torque(False),
    }
