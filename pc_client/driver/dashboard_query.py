"""Questions to the dashboard server: one line out, one line back. An absent server is no error."""

from __future__ import annotations

from pc_client.driver.transport import Network, Transport
from pc_client.errors import DriverError
from protocol.patience import LONGEST_STEP, Patience

CONNECT_TIMEOUT = 2.0
REPLY_TIMEOUT = 60.0
"""A server that takes the connection answers within milliseconds; one that is stopped is waited for, or the
recording would call the serial number unknown."""

_LINE_TIMEOUT = 5.0
"""Once its first byte is there, the rest of a line comes within this [s]."""

LONGEST_LINE = 4096
"""Most bytes of a line; answers have less than a hundred."""

_GREETING = "Universal Robots Dashboard Server"


def ask_dashboard(network: Network, host: str, port: int, questions: tuple[str, ...]) -> dict[str, str]:
    """Ask what the dashboard server knows.

    Args:
        network: makes the connection.
        host: the robot.
        port: its dashboard port.
        questions: commands that only ask, e.g. `get serial number`.

    Returns:
        The answers that came; empty when there is no dashboard server.

    Raises:
        DriverError: the server sends what are no lines.
    """
    try:
        connection = network.connect(host, port, CONNECT_TIMEOUT)
    except DriverError:
        return {}
    answers: dict[str, str] = {}
    try:
        lines = _Lines(connection, network)
        if _GREETING not in (lines.read() or ""):
            return {}
        for question in questions:
            connection.send(question.encode("latin-1") + b"\n")
            answer = lines.read()
            if answer is None:
                break
            answers[question] = answer
        connection.send(b"quit\n")
    except _NoLineError:
        raise
    except DriverError:
        pass  # what was answered until then is still true
    finally:
        connection.close()
    return answers


class _NoLineError(DriverError):
    """What comes is no line."""


class _Lines:
    """Cuts a connection's bytes into lines."""

    def __init__(self, connection: Transport, network: Network) -> None:
        self._connection = connection
        self._network = network
        self._pending = b""

    def read(self) -> str | None:
        """The next line, or None when none comes.

        Raises:
            DriverError: the connection broke, or a line has no end.
        """
        begun = Patience()
        while b"\n" not in self._pending:
            late = bool(self._pending) and begun.spent(self._network.now()) > _LINE_TIMEOUT
            if late or len(self._pending) > LONGEST_LINE:
                raise _NoLineError(
                    f"the dashboard server sends {len(self._pending)} bytes without the end of a line; one "
                    f"has at most {LONGEST_LINE}, and comes within {_LINE_TIMEOUT:g} s: "
                    "is this a control box?"
                )
            data = self._connection.receive(LONGEST_STEP if self._pending else REPLY_TIMEOUT)
            if data == b"" or (data is None and not self._pending):
                return None
            self._pending += data or b""
        line, _, self._pending = self._pending.partition(b"\n")
        return line.decode("latin-1").strip()
