"""One descriptor in reserve: a process that has none left cannot even turn a client away without it."""

from __future__ import annotations

import os
import socket
from contextlib import suppress


class Reserve:
    """A descriptor that is given up for a moment when all others are taken."""

    def __init__(self) -> None:
        self._descriptor: int | None = None

    def fill(self) -> None:
        """Take a descriptor, if there is one; harmless if it is held already."""
        if self._descriptor is None:
            with suppress(OSError):
                self._descriptor = os.open(os.devnull, os.O_RDONLY)

    def turn_away(self, listening: socket.socket) -> bool:
        """Accept the next client of a listening socket and close it at once.

        Returns:
            False if no client waits: without descriptors, the system does not look before it refuses.

        Raises:
            OSError: there is no descriptor for that: someone else took it.
        """
        self.close()
        try:
            listening.accept()[0].close()
        except BlockingIOError:
            return False
        finally:
            self.fill()
        return True

    def close(self) -> None:
        """Give the descriptor back."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None
