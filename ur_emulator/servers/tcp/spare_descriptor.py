"""A spare descriptor: a process that has none left needs one to refuse a client."""

from __future__ import annotations

import os
import socket
from contextlib import suppress


class SpareDescriptor:
    """A descriptor that is released for a moment when all others are in use."""

    def __init__(self) -> None:
        self._descriptor: int | None = None

    def take(self) -> None:
        """Take a descriptor, if there is one; harmless if it is held already."""
        if self._descriptor is None:
            with suppress(OSError):
                self._descriptor = os.open(os.devnull, os.O_RDONLY)

    def refuse_client(self, listening: socket.socket) -> bool:
        """Accept the next client of a listening socket and close it at once.

        Returns:
            False if no client waits: without descriptors, the system does not look before it refuses.

        Raises:
            OSError: another thread or process took the descriptor first.
        """
        self.close()
        try:
            listening.accept()[0].close()
        except BlockingIOError:
            return False
        finally:
            self.take()
        return True

    def close(self) -> None:
        """Release the descriptor."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None
