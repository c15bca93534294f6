"""What can go wrong inside the control box.

Every message is one line: what was given, what is allowed, what to do. Errors of URScript programs are
not here: they belong to the program (`urscript.errors`), not to the box.
"""

_LONGEST_TEXT = 500


class EmulatorError(Exception):
    """Root of all errors that a user of the emulator may meet."""


class ModelError(EmulatorError):
    """A robot or fidelity name is unknown, or a table of numbers makes no arm."""


class KinematicsError(EmulatorError):
    """An argument of the controller's kinematics makes no sense (shape, not a number)."""


class PlantError(EmulatorError):
    """The physics cannot go on.

    Attributes:
        cycle: number of the control cycle, counted from the last reset, that failed; None before the first.
    """

    def __init__(self, message: str, *, cycle: int | None = None) -> None:
        super().__init__(message)
        self.cycle = cycle


class ProgramFileError(EmulatorError):
    """A program or installation file cannot be used; its text, which may quote the file, stays short."""

    def __init__(self, message: str) -> None:
        super().__init__(" ".join(message.splitlines())[:_LONGEST_TEXT])


class FileMissingError(ProgramFileError):
    """There is no such program or installation file among those that the box may use."""


class UndefinedError(ProgramFileError):
    """Something in a program or installation is not filled in, not taught, or names what is not there."""


class UnknownNodeError(ProgramFileError):
    """A program has a node, or something in a node, for which no script is known."""


class ControlError(EmulatorError):
    """An operation of the control API was not done."""


class ArgumentError(ControlError):
    """An operation was given something that it does not take."""


class RefusedError(ControlError):
    """The state of the box stands against an operation."""


class WaitTimeoutError(RefusedError, TimeoutError):
    """What was waited for did not come in time."""


class WorkerError(RefusedError):
    """A task was not done: the process for it could not be started, or has ended before."""


class NotRunningError(ControlError):
    """The box does not run, or it ended before the operation was done."""

    ENDED = "the box has ended: operations need one that runs"

    def __init__(self, message: str = ENDED) -> None:
        super().__init__(message)


class PortError(EmulatorError):
    """A TCP port of the box cannot be opened."""


class PortPermissionError(PortError):
    """A TCP port of the box is one that this user may not open."""
