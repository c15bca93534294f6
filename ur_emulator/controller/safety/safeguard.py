"""A safeguard of the cell: open or closed, with a reset button or without."""

from __future__ import annotations


class Safeguard:
    """A safeguard.

    Attributes:
        is_stopping: it is open, or closed and not reset.
    """

    def __init__(self) -> None:
        self.is_stopping = False
        self._is_open = self._needs_reset = False

    def guard(self, is_open: bool) -> None:
        """Open or close it."""
        self._is_open = is_open
        self.is_stopping = is_open or (self.is_stopping and self._needs_reset)

    def require_reset(self, required: bool) -> None:
        """Set up whether closing is enough."""
        self._needs_reset = required
        self.guard(self._is_open)

    def reset(self) -> None:
        """Press its reset button."""
        self.is_stopping = self._is_open
