"""Lines for a terminal, a pipe or a file: who writes one never waits, whether or not somebody reads them."""

import os
import queue
import select
import threading
from contextlib import suppress
from typing import TextIO

from ur_emulator.budgets import BUDGETS

# How long `close` waits until all is written [s].
_PATIENCE = 0.2
# Lines written in one go.
_AT_ONCE = 100


class LineWriter:
    """Writes lines to a standard stream, in a thread of its own.

    The descriptor may be shared with the shell, so it stays as blocking as it is. The thread uses no lock of
    the stream: one that waits for a reader does not keep the process from its end.
    """

    def __init__(self, stream: TextIO | None, name: str) -> None:
        """Begin to write lines called `name`; without a stream (the process has none) all are dropped."""
        self._name = name
        self._n_lost = 0
        self._lines: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None
        if stream is not None:
            self._descriptor, self._encoding = stream.fileno(), stream.encoding
            self._thread = threading.Thread(target=self._run, name="line-writer", daemon=True)
            self._thread.start()

    def write(self, line: str) -> None:
        """Write a line, soon; it is lost when too many wait. In one thread only."""
        if self._thread is None:
            return
        if self._lines.qsize() >= BUDGETS.log_lines:
            self._n_lost += 1
            return
        self._tell_lost()
        self._put(line)

    def close(self) -> None:
        """Write what waits, if that goes within a fraction of a second."""
        if self._thread is not None:
            self._tell_lost()
            self._lines.put(None)
            self._thread.join(_PATIENCE)

    def _tell_lost(self) -> None:
        if self._n_lost:
            self._put(f"{self._n_lost} lines of {self._name} were lost: they were not read in time")
            self._n_lost = 0

    def _put(self, line: str) -> None:
        self._lines.put(f"{line}\n".encode(self._encoding, "backslashreplace"))

    # --- in the thread

    def _run(self) -> None:
        with suppress(OSError):  # there is no reader any more
            while (lines := self._next_lines()) is not None:
                self._write(lines)

    def _next_lines(self) -> bytes | None:
        """Wait for lines; return None at the end."""
        line = self._lines.get()
        if line is None:
            return None
        lines = [line]
        while len(lines) < _AT_ONCE and not self._lines.empty():
            if (line := self._lines.get()) is None:
                self._lines.put(None)
                break
            lines.append(line)
        return b"".join(lines)

    def _write(self, data: bytes) -> None:
        while data:
            try:
                data = data[os.write(self._descriptor, data) :]
            except BlockingIOError:  # somebody else has made it so
                select.select([], [self._descriptor], [])
