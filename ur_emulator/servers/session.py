"""A client whose requests are answered in order, however many cycles each takes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import partial

from ur_emulator.errors import NotRunningError
from ur_emulator.realtime.barrier import guarded
from ur_emulator.servers.steps import StepRunner, Steps
from ur_emulator.servers.tcp.connection import Connection


class Session(ABC):
    """One client of a port.

    Attributes:
        connection: to the client.
        is_busy: its requests are being answered.
    """

    def __init__(self, connection: Connection, steps: StepRunner) -> None:
        """Prepare; nothing has arrived yet.

        Args:
            connection: to the client.
            steps: of the box.
        """
        self.connection = connection
        self.is_busy = False
        self._steps = steps

    def answer_requests(self) -> None:
        """Begin to answer what has arrived; harmless if that is under way."""
        if not self.is_busy:
            self.is_busy = True
            self._steps.start(self._serve(), partial(guarded, self.connection.failed, self._finished))

    @abstractmethod
    def _serve(self) -> Steps[None]:
        """Answer all requests that have arrived."""

    def _finished(self, _: None, error: Exception | None) -> None:
        """All are answered, or the box has ended, or an error of ours has ended the answering."""
        self.is_busy = False
        if isinstance(error, NotRunningError):
            self.connection.close()
        elif error is not None:
            self.connection.failed(error)
        elif self.connection.has_ended:
            self.connection.close_when_sent()
