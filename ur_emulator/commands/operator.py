"""What the operator does at the screen: answer questions, close popups; and popups that clients show."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from protocol.primary.messages import RequestedType
from ur_emulator.commands.operation import CommandOperation, parameter
from ur_emulator.controller.command import Box, Result
from ur_emulator.controller.events import PopupShown
from ur_emulator.controller.operator import Answer
from ur_emulator.errors import RefusedError


class AnswerRequest(CommandOperation):
    """Answer a question of a program."""

    value: Answer = parameter("of the type that was asked for")
    id: int | None = parameter(
        "number of the question; the oldest that fits if left out", low=1, default=None
    )
    result: ClassVar[str] = "`id`: number of the question, and `tick`"

    def apply(self, box: Box) -> Result:
        operator = box.state.operator
        asked = [r for r in operator.requests if r.kind is not RequestedType.NONE]
        answered = operator.answer(self.value, self.id)
        if answered is None:
            questions = ", ".join(f"{r.request_id} ({r.kind.name.lower()}): {r.text}" for r in asked)
            raise RefusedError(
                f"{self.value!r} answers no question: {f'asked is {questions}' if asked else 'none is open'}"
            )
        return {"id": answered}


class ClosePopup(CommandOperation):
    """Press the button of all popups."""

    def apply(self, box: Box) -> None:
        box.state.operator.close_popups()


@dataclass(frozen=True, slots=True)
class ShowPopup:
    """Show a popup that does not block a program; it stays until it is closed."""

    text: str

    def apply(self, box: Box) -> None:
        box.state.operator.show(self.text)
        box.state.events.append(PopupShown("Popup", self.text, False, False, False))
