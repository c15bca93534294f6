"""Socket builtins: the program is the TCP client. Reads block their thread only; a failure is a return value.

Timeouts are robot time, counted in cycles. Shapes of the results after a failure: URScript manual CB3 3.15,
socket_read_binary_integer and related builtins ([0, -1, -1, ...], [0, nan, nan, ...], "").
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Generator, Mapping
from typing import Any

from ur_emulator.controller.clock import Clock
from ur_emulator.controller.events import EventQueue, LogAdded
from ur_emulator.scripting.network import Network, ScriptSocket
from urscript.errors import ScriptRuntimeError
from urscript.run.waits import CHECKPOINT, Blocked
from urscript.values import log_form

# socket_open gives up after this [s of robot time]. Source: URScript manual, socket_open.
OPEN_TIMEOUT = 2.0
# Longest text that a string read returns [bytes]. Source: later edition of the manual, socket_read_string.
MAX_STRING = 1024
# Longest text without an end [bytes]: beyond it the read fails and the bytes are dropped.
MAX_INBOX = 1 << 20

Function = Callable[..., Any]


class ProgramSockets:
    """The named sockets of one program."""

    def __init__(self, clock: Clock, events: EventQueue, network: Network) -> None:
        self._clock = clock
        self._events = events
        self._network = network
        self._sockets: dict[str, ScriptSocket] = {}

    def close_all(self) -> None:
        """Close every socket; the program has ended."""
        for socket in self._sockets.values():
            socket.close()
        self._sockets.clear()

    def functions(self) -> Mapping[str, Function]:
        """Return the socket builtins by URScript name."""
        return {
            "socket_open": self._open,
            "socket_close": self._close,
            "socket_read_binary_integer": self._read_binary_integer,
            "socket_read_byte_list": self._read_byte_list,
            "socket_read_ascii_float": self._read_ascii_float,
            "socket_read_line": self._read_line,
            "socket_read_string": self._read_string,
            "socket_send_byte": self._send_byte,
            "socket_send_int": self._send_int,
            "socket_send_string": self._send_string,
            "socket_send_line": self._send_line,
            "socket_set_var": self._set_var,
            "socket_get_var": self._get_var,
        }

    # --- opening, closing, sending

    def _open(self, thread: object, address: str, port: int, name: str) -> Generator[Blocked, None, bool]:
        old = self._sockets.pop(name, None)
        if old is not None:
            old.close()
        # Stored before it is open: a program that is killed meanwhile closes it.
        socket = self._sockets[name] = self._network.open(address, int(port))
        expired = self._timer(OPEN_TIMEOUT)
        if socket.is_connecting:
            yield Blocked(lambda: not socket.is_connecting or expired(), outside=True)
        if not socket.is_open or socket.is_connecting:
            # Source: log of a real controller; "refused" is ours.
            reason = "Connection timed out" if socket.is_connecting else "Connection refused"
            text = f"Not able to open socket [{name}] to host: {address} at port: {port}: {reason}"
            self._events.append(LogAdded("Program", text))
            socket.close()
            if self._sockets.get(name) is socket:
                del self._sockets[name]
            return False
        return True

    def _close(self, thread: object, name: str) -> None:
        socket = self._sockets.pop(name, None)
        if socket is not None:
            socket.close()

    def _send(self, name: str, data: bytes) -> bool:
        socket = self._sockets.get(name)
        return socket is not None and socket.send(data)

    def _send_byte(self, thread: object, value: int, name: str) -> bool:
        return self._send(name, bytes([int(value) & 0xFF]))

    def _send_int(self, thread: object, value: float, name: str) -> bool:
        if not (math.isfinite(value) and -(2**31) <= value < 2**31):
            raise ScriptRuntimeError(f"socket_send_int: {value:g} does not fit into 32 bits")
        return self._send(name, struct.pack(">i", int(value)))

    def _send_string(self, thread: object, text: Any, name: str) -> bool:
        return self._send(name, log_form(text).encode("latin-1", "replace"))

    def _send_line(self, thread: object, text: Any, name: str) -> bool:
        return self._send(name, log_form(text).encode("latin-1", "replace") + b"\n")

    def _set_var(self, thread: object, variable: str, value: int, name: str) -> None:
        self._send(name, f"SET {variable} {log_form(value)}\n".encode("latin-1", "replace"))

    # --- reading

    def _timer(self, timeout: float) -> Callable[[], bool]:
        """Return a function: has the program run for `timeout` seconds? Never, if it is not above 0."""
        if not timeout > 0.0:
            return lambda: False
        clock = self._clock
        end = clock.program_tick + math.ceil(timeout / clock.period_s)
        return lambda: clock.program_tick >= end

    def _take(
        self, name: str, timeout: float, find: Callable[[bytearray], int]
    ) -> Generator[Blocked, None, bytes | None]:
        """Wait until `find` sees a message in the inbox (its length, or 0) and take it; None on failure."""
        socket = self._sockets.get(name)
        if socket is None:
            return None
        inbox = socket.inbox
        size = find(inbox)
        if not size and socket.is_open:
            expired = self._timer(timeout)
            yield Blocked(
                lambda: bool(find(inbox)) or not socket.is_open or len(inbox) > MAX_INBOX or expired(),
                outside=True,
            )
            size = find(inbox)
        else:
            yield CHECKPOINT
        if not size:
            if len(inbox) > MAX_INBOX:
                inbox.clear()
            return None
        data = bytes(inbox[:size])
        del inbox[:size]
        return data

    def _read_numbers(
        self, name: str, timeout: float, number: int, code: str, width: int
    ) -> Generator[Blocked, None, list[int]]:
        """Wait for big-endian numbers; a stream of commands passes here every cycle.

        Args:
            name: of the socket.
            timeout: [s]; not above 0: none.
            number: how many.
            code: of one of them for `struct`.
            width: its bytes.
        """
        socket, clock, size = self._sockets.get(name), self._clock, width * number
        failed = [0] + [-1] * number
        if socket is None:
            return failed
        inbox = socket.inbox
        # Nothing to read is nothing that could come: it ends with the time-out.
        enough = min(size, MAX_INBOX + 1) if size > 0 else MAX_INBOX + 1
        if len(inbox) < enough and socket.is_open:
            end = clock.program_tick + math.ceil(timeout / clock.period_s) if timeout > 0.0 else math.inf
            yield Blocked(
                lambda: len(inbox) >= enough or not socket.is_open or clock.program_tick >= end, outside=True
            )
        else:
            yield CHECKPOINT
        if not 0 < size <= len(inbox):
            if len(inbox) > MAX_INBOX:
                inbox.clear()
            return failed
        data = bytes(inbox[:size])
        del inbox[:size]
        return [number, *struct.unpack(f">{number}{code}", data)]

    def _read_binary_integer(
        self, thread: object, number: float, name: str, timeout: float
    ) -> Generator[Blocked, None, list[int]]:
        return self._read_numbers(name, timeout, int(number), "i", 4)

    def _read_byte_list(
        self, thread: object, number: float, name: str, timeout: float
    ) -> Generator[Blocked, None, list[int]]:
        return self._read_numbers(name, timeout, int(number), "B", 1)

    def _read_ascii_float(
        self, thread: object, number: float, name: str, timeout: float
    ) -> Generator[Blocked, None, list[float]]:
        number = int(number)
        data = yield from self._take(name, timeout, lambda inbox: inbox.find(b")") + 1)
        failed: list[float] = [0, *([math.nan] * number)]
        if data is None:
            return failed
        inside = data.decode("latin-1").rpartition("(")[2].rstrip(")")
        try:
            values = [float(part) for part in inside.split(",")]
        except ValueError:
            return failed
        return [number, *values] if len(values) == number else failed

    def _read_line(self, thread: object, name: str, timeout: float) -> Generator[Blocked, None, str]:
        data = yield from self._take(name, timeout, lambda inbox: inbox.find(b"\n") + 1)
        return "" if data is None else data.decode("latin-1").removesuffix("\n").removesuffix("\r")

    def _read_string(
        self, thread: object, name: str, prefix: str, suffix: str, interpret_escape: bool, timeout: float
    ) -> Generator[Blocked, None, str]:
        start, end = (_delimiter(text, interpret_escape) for text in (prefix, suffix))

        def find(inbox: bytearray) -> int:
            begin = inbox.find(start) if start else 0
            if begin < 0:
                return 0
            begin += len(start)
            if not end:
                return min(len(inbox), begin + MAX_STRING) if len(inbox) > begin else 0
            stop = inbox.find(end, begin)
            return stop + len(end) if stop >= 0 else 0

        data = yield from self._take(name, timeout, find)
        if data is None:
            return ""
        text = data[data.find(start) + len(start) :] if start else data
        return (text.removesuffix(end) if end else text)[:MAX_STRING].decode("latin-1")

    def _get_var(self, thread: object, variable: str, name: str) -> Generator[Blocked, None, int]:
        self._send(name, f"GET {variable}\n".encode("latin-1", "replace"))
        data = yield from self._take(name, OPEN_TIMEOUT, lambda inbox: inbox.find(b"\n") + 1)
        words = b"" if data is None else data
        try:
            answered, value = words.decode("latin-1").split()
            return int(value) if answered == variable else 0
        except ValueError:
            return 0


def _delimiter(text: str, interpret_escape: bool) -> bytes:
    """Return a prefix or suffix as bytes: leading blanks do not count, escapes only if asked for."""
    text = text.lstrip(" ")
    if interpret_escape:
        text = text.replace("\\n", "\n").replace("\\r", "\r").replace("\\t", "\t")
    return text.encode("latin-1", "replace")
