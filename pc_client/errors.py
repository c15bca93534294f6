"""What can go wrong on the PC side. Each message is one line: what was given, what is allowed, what to do."""

import logging

LOG = logging.getLogger("pc_client")
"""How far an experiment is (debug, info), and warnings: on standard error where nobody sets up logging."""

RECORDED = "%s: recorded"
"""The step that ends a run."""


class ClientError(Exception):
    """Root of all errors that a user of the PC client may meet."""


class MovementError(ClientError):
    """A movement file, or the parameters of a movement, make no sense."""


class UnknownMovementError(MovementError):
    """The library has no movement of that name."""


class ControllerError(ClientError):
    """The numbers of a controller, or its file, make no sense."""


class CellError(ClientError):
    """The file of an arm's surroundings and tool makes no sense."""


class PlanningError(ClientError):
    """A path leaves the reach or the limits of the arm; nothing has moved.

    Attributes:
        sample: index of the offending sample of the path, or None.
        joint: index 0..5 of the offending joint, or None.
    """

    def __init__(self, message: str, *, sample: int | None = None, joint: int | None = None) -> None:
        super().__init__(message)
        self.sample = sample
        self.joint = joint


class DriverError(ClientError):
    """The robot cannot be reached, or the stream to it broke."""


class UnknownHostError(DriverError):
    """The name or address of the robot is not known, so nothing there can be asked."""


class RobotStoppedError(DriverError):
    """The robot stopped by itself: protective stop, emergency stop or a program error."""


class GainMarginError(DriverError):
    """The gains are too large for the delay of the loop; no movement has begun.

    Attributes:
        margin: the gain margin, a factor.
        delay: the identified loop delay [s].
    """

    def __init__(self, message: str, *, margin: float, delay: float) -> None:
        super().__init__(message)
        self.margin = margin
        self.delay = delay


class InterruptedByUserError(ClientError):
    """The user ended it before it was done; the message says what is kept."""


class RecordingError(ClientError):
    """A recording cannot be written or read."""


class SweepError(ClientError):
    """The configuration of a sweep makes no sense, or its folder cannot be used."""


LONGEST_LINE = 1000
"""Most characters of a message that are shown: what was given may be a whole file."""


def one_line(error: BaseException | str) -> str:
    """A message on one line that no terminal obeys: control characters escaped, cut at `LONGEST_LINE`."""
    text = " ".join((error if isinstance(error, str) else full_message(error)).split())
    text = text if len(text) <= LONGEST_LINE else f"{text[: LONGEST_LINE - 3]}..."
    return printable(text)


def printable(text: str) -> str:
    """The text with all characters escaped that are not printed but obeyed; line breaks and tabs stay."""
    return "".join(c if c.isprintable() or c in "\n\t" else repr(c)[1:-1] for c in text)


def full_message(error: BaseException) -> str:
    """The message of an error and what was added to it later; a note that says it again replaces it."""
    text = str(error)
    for note in getattr(error, "__notes__", ()):
        text = note if note.startswith(text) else f"{text}; {note}"
    return text
