"""What programs ask of the operator: values, popups to be closed; and what the operator does at the pendant.

There is no person at the box: a client answers, by `AnswerRequest` and `ClosePopup`.
"""

from collections import deque
from dataclasses import dataclass

from protocol.primary.messages import RequestedType
from urscript.values import INT_MAX, INT_MIN, to_script_text

# Number of popups that are kept of those that do not block a program.
MAX_SHOWN = 20

Answer = bool | int | float | str


def _as_asked(kind: RequestedType, value: Answer) -> Answer | None:
    """Return an answer as the program gets it, None if its type is not the one that was asked for."""
    match kind, value:
        case RequestedType.BOOLEAN, bool():
            return value
        case ((RequestedType.INTEGER | RequestedType.FLOAT), bool()):
            return None
        case RequestedType.INTEGER, int() if INT_MIN <= value <= INT_MAX:
            return value
        case RequestedType.FLOAT, int() | float():
            return float(value)
        case RequestedType.STRING, str():
            return to_script_text(value)
    return None


@dataclass(slots=True)
class PendantRequest:
    """A question on the screen, numbered from 1; of kind NONE, a popup, which is to be closed."""

    request_id: int
    kind: RequestedType
    text: str
    answer: Answer | None = None
    is_answered: bool = False


class Pendant:
    """All open questions, the oldest first.

    Attributes:
        buttons: those of the pendant that are pressed, as in RobotStatusBits.
        remote_period: number of the present period of remote control, from 1; 0 in local control. A client
            may command the box while it is that of its connect. A CB3 has no other than the first.
    """

    def __init__(self) -> None:
        self.buttons = 0
        self.remote_period = self._n_periods = 1
        self._count = 0
        self._open: dict[int, PendantRequest] = {}
        self._shown: deque[str] = deque(maxlen=MAX_SHOWN)

    @property
    def requests(self) -> tuple[PendantRequest, ...]:
        """The questions that wait for an answer."""
        return tuple(self._open.values())

    @property
    def shown(self) -> tuple[str, ...]:
        """Texts of popups that do not block a program, the oldest first."""
        return tuple(self._shown)

    def press(self, button: int, pressed: bool) -> None:
        """Press a button of the pendant, a bit of RobotStatusBits, or release it."""
        self.buttons = self.buttons | button if pressed else self.buttons & ~button

    def set_remote_control(self, is_remote: bool) -> None:
        """Switch to remote control, or to local control."""
        if is_remote and not self.remote_period:
            self._n_periods += 1
        self.remote_period = self._n_periods if is_remote else 0

    def show(self, text: str) -> None:
        """Show a popup that does not block a program; it stays, also without power, until it is closed."""
        self._shown.append(text)

    def ask(self, kind: RequestedType, text: str) -> PendantRequest:
        """Put a question on the screen."""
        self._count += 1
        request = self._open[self._count] = PendantRequest(self._count, kind, text)
        return request

    def withdraw(self, request: PendantRequest) -> None:
        """Take a question off the screen, answered or not."""
        self._open.pop(request.request_id, None)

    def answer(self, value: Answer, request_id: int | None = None) -> int | None:
        """Answer a question, or the oldest; one that does not exist or wants another type stays as it is.

        Return the number of the question that was answered; None if none was.
        """
        for request in self.requests:
            if request_id in (None, request.request_id):
                answer = _as_asked(request.kind, value)
                if answer is not None:
                    request.answer = answer
                    self._finish(request)
                    return request.request_id
        return None

    def close_popups(self) -> None:
        """Press the button of every popup."""
        self._shown.clear()
        for request in self.requests:
            if request.kind is RequestedType.NONE:
                self._finish(request)

    def _finish(self, request: PendantRequest) -> None:
        request.is_answered = True
        self.withdraw(request)
