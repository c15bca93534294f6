"""Bytes on their way to the file of a recording: a thread of its own writes them.

Whoever makes the bytes never waits for the disk and gets no error from it: the first one is kept.
"""

from __future__ import annotations

import errno
from collections.abc import Callable
from pathlib import Path
from queue import Full, Queue
from threading import Thread
from typing import Protocol

MOST_WAITING = 120
"""Chunks that may wait for a disk that stands still: a minute at 125 Hz, 15 s at 500 Hz, 15 MB."""


class RawFile(Protocol):
    """The part of an unbuffered binary file that is used."""

    def write(self, data: memoryview, /) -> int | None:
        """Write some of the data and return how many bytes."""

    def close(self) -> None:
        """Close the file."""


Opener = Callable[[Path], RawFile]


def open_unbuffered(path: Path) -> RawFile:
    """Open for writing without Python's own buffer: what `write` returned is out of this process."""
    return open(path, "wb", buffering=0)


class Outbox:
    """A stream that takes all bytes at once.

    Args:
        file: where they go.

    Attributes:
        error: the first one of the file, or that it is too slow; nothing is written from then on to `close`.
    """

    def __init__(self, file: RawFile) -> None:
        self.error: OSError | None = None
        self._file = file
        self._made: list[bytes] = []  # since the last chunk was posted
        self._n_taken = 0
        self._posted: Queue[bytes | None] = Queue(MOST_WAITING)
        self._left = memoryview(b"")  # what the file did not take
        self._thread = Thread(target=self._work, name="recording", daemon=True)

    def write(self, data: bytes) -> int:
        """Take bytes."""
        self._made.append(data)
        self._n_taken += len(data)
        return len(data)

    def tell(self) -> int:
        """Return the number of all bytes taken: the place of the next one in the file."""
        return self._n_taken

    def flush(self) -> None:
        """Do nothing; `post` hands the bytes on."""

    def start(self) -> None:
        """Write what was taken so far, then start the thread.

        Raises:
            OSError: the file does not take it, and is closed.
        """
        try:
            self._write(self._take())
        except OSError:
            self._file.close()
            raise
        self._thread.start()

    def post(self) -> None:
        """Give the thread what was taken since the last call; keep it if there is an error, or no room."""
        if self.error is None:
            chunk = self._take()
            try:
                self._posted.put_nowait(chunk)
            except Full:
                self._made.append(chunk)
                self.error = OSError(errno.EIO, f"the disk is too slow, {MOST_WAITING} chunks wait for it")

    def close(self) -> None:
        """Write all that waits, also after an error: a disk may have been cleared; close the file.

        Raises:
            OSError: the file takes no more.
        """
        self._posted.put(None)
        self._thread.join()
        try:
            self._write(self._take())
        finally:
            self._file.close()

    def _take(self) -> bytes:
        chunk = b"".join(self._made)
        self._made.clear()
        return chunk

    def _work(self) -> None:
        while (chunk := self._posted.get()) is not None:
            try:
                self._write(chunk, trying=self.error is None)
            except OSError as error:
                self.error = error

    def _write(self, chunk: bytes, *, trying: bool = True) -> None:
        """Write a chunk after what is left of those before it."""
        self._left = memoryview(bytes(self._left) + chunk)
        while trying and self._left:
            n_written = self._file.write(self._left)
            if not n_written:
                raise OSError(errno.EIO, "the file takes no more bytes")
            self._left = self._left[n_written:]
