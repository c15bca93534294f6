"""Builtins for popups and requests for values. A client answers instead of an operator."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from typing import Any

from protocol.primary.messages import RequestedType
from ur_emulator.controller.events import EventQueue, PopupShown, ValueRequested
from ur_emulator.controller.operator import Answer, Operator, OperatorRequest
from urscript.run.waits import Blocked
from urscript.values import log_form

_KINDS = {
    "boolean": RequestedType.BOOLEAN,
    "integer": RequestedType.INTEGER,
    "float": RequestedType.FLOAT,
    "string": RequestedType.STRING,
}


def operator_functions(operator: Operator, events: EventQueue) -> Mapping[str, Callable[..., Any]]:
    """Return the builtins for popups and requests."""

    def wait_for(request: OperatorRequest) -> Generator[Blocked, None, Answer | None]:
        try:
            yield Blocked(lambda: request.is_answered, outside=True)
        finally:
            operator.withdraw(request)  # the program may have been stopped meanwhile
        return request.answer

    def popup(
        thread: object, s: Any, title: str, warning: bool, error: bool, blocking: bool
    ) -> Generator[Blocked, None, None]:
        text = log_form(s)
        if not blocking:
            operator.show(text)
            events.append(PopupShown(title, text, warning, error, blocking))
            return
        request = operator.ask(RequestedType.NONE, text)
        events.append(PopupShown(title, text, warning, error, blocking, request.request_id))
        yield from wait_for(request)

    def requester(kind: RequestedType) -> Callable[..., Generator[Blocked, None, Answer | None]]:
        def request_value(thread: object, text: str) -> Generator[Blocked, None, Answer | None]:
            request = operator.ask(kind, text)
            events.append(ValueRequested(request.request_id, kind, text))
            return (yield from wait_for(request))

        return request_value

    return {
        "popup": popup,
        **{f"request_{name}_from_primary_client": requester(kind) for name, kind in _KINDS.items()},
    }
