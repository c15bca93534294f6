"""Bytes that wait for the file of a recording: a failing disk raises no error in the code that makes them."""

from __future__ import annotations

import errno
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Protocol


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
    """A stream that takes all bytes at once and writes them when it is drained.

    Args:
        file: where they go.
    """

    def __init__(self, file: RawFile) -> None:
        self._file = file
        self._waiting: deque[memoryview] = deque()
        self._n_taken = 0

    def write(self, data: bytes) -> int:
        """Take bytes."""
        if data:
            self._waiting.append(memoryview(data))
        self._n_taken += len(data)
        return len(data)

    def tell(self) -> int:
        """Return the number of all bytes taken: the place of the next one in the file."""
        return self._n_taken

    def flush(self) -> None:
        """Do nothing; `drain` writes."""

    def drain(self) -> None:
        """Write to the file; what it does not take waits on.

        Raises:
            OSError: the file takes no more.
        """
        while self._waiting:
            n_written = self._file.write(self._waiting[0])
            if not n_written:
                raise OSError(errno.EIO, "the file takes no more bytes")
            self._waiting[0] = self._waiting[0][n_written:]
            if not self._waiting[0]:
                self._waiting.popleft()

    def close(self) -> None:
        """Close the file; errors as `drain`."""
        self._file.close()
