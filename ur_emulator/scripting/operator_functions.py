"""Builtins that speak to the operator: popups, requests for values. A client answers in their place."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from typing import Any

from protocol.primary.messages import RequestedType
from ur_emulator.controller.events import PopupShown, ValueRequested
from ur_emulator.controller.operator import Answer, OperatorRequest
from ur_emulator.controller.state import ControllerState
from urscript.builtins.text import wire_text
from urscript.run.waits import Blocked

_KINDS = {
    "boolean": RequestedType.BOOLEAN,
    "integer": RequestedType.INTEGER,
    "float": RequestedType.FLOAT,
    "string": RequestedType.STRING,
}


def operator_functions(state: ControllerState) -> Mapping[str, Callable[..., Any]]:
    """Return the builtins bound to one controller."""

    def wait_for(request: OperatorRequest) -> Generator[Blocked, None, Answer | None]:
        try:
            yield Blocked(lambda: request.is_answered, outside=True)
        finally:
            state.operator.withdraw(request)  # the program may have been stopped meanwhile
        return request.answer

    def popup(
        thread: object, s: Any, title: str, warning: bool, error: bool, blocking: bool
    ) -> Generator[Blocked, None, None]:
        text = wire_text(s)
        if not blocking:
            state.operator.show(text)
            state.events.append(PopupShown(title, text, warning, error, blocking))
            return
        request = state.operator.ask(RequestedType.NONE, text)
        state.events.append(PopupShown(title, text, warning, error, blocking, request.request_id))
        yield from wait_for(request)

    def requester(kind: RequestedType) -> Callable[..., Generator[Blocked, None, Answer | None]]:
        def request_value(thread: object, text: str) -> Generator[Blocked, None, Answer | None]:
            request = state.operator.ask(kind, text)
            state.events.append(ValueRequested(request.request_id, kind, text))
            return (yield from wait_for(request))

        return request_value

    return {
        "popup": popup,
        **{f"request_{name}_from_primary_client": requester(kind) for name, kind in _KINDS.items()},
    }
