"""Questions to the dashboard server: one line out, one line back. An absent server is no error."""

from __future__ import annotations

from pc_client.driver.transport import Network, Transport
from pc_client.errors import DriverError

CONNECT_TIMEOUT = 2.0
REPLY_TIMEOUT = 60.0
"""A server that takes the connection answers within milliseconds; one that is stopped is waited for, or the
recording would call the serial number unknown."""

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
    """
    try:
        connection = network.connect(host, port, CONNECT_TIMEOUT)
    except DriverError:
        return {}
    answers: dict[str, str] = {}
    try:
        lines = _Lines(connection)
        if _GREETING not in (lines.read() or ""):
            return {}
        for question in questions:
            connection.send(question.encode("latin-1") + b"\n")
            answer = lines.read()
            if answer is None:
                break
            answers[question] = answer
        connection.send(b"quit\n")
    except DriverError:
        pass  # what was answered until then is still true
    finally:
        connection.close()
    return answers


class _Lines:
    """Cuts a connection's bytes into lines."""

    def __init__(self, connection: Transport) -> None:
        self._connection = connection
        self._pending = b""

    def read(self) -> str | None:
        """The next line, or None when none comes."""
        while b"\n" not in self._pending:
            data = self._connection.receive(REPLY_TIMEOUT)
            if not data:
                return None
            self._pending += data
        line, _, self._pending = self._pending.partition(b"\n")
        return line.decode("latin-1").strip()
