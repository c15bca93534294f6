"""ProgramRequests: stops and pauses that scripts or clients request, until the controller makes them."""

from __future__ import annotations


class ProgramRequests:
    """Requests that wait for their place in the cycle."""

    __slots__ = ("_pause", "_power_off", "_protective_stop")

    def __init__(self) -> None:
        self._protective_stop = self._power_off = self._pause = False

    def protective_stop(self) -> None:
        """Request a protective stop at the end of this cycle."""
        self._protective_stop = True

    def power_off(self) -> None:
        """Request that the power is cut once the scripts of this cycle have run."""
        self._power_off = True

    def pause(self) -> None:
        """Request that the primary program is paused once the scripts of this cycle have run."""
        self._pause = True

    def take_pause(self) -> bool:
        """Return whether a pause was requested, and clear the request."""
        asked, self._pause = self._pause, False
        return asked

    def take_protective_stop(self) -> bool:
        """Return whether a protective stop was requested, and clear the request."""
        asked, self._protective_stop = self._protective_stop, False
        return asked

    def take_power_off(self) -> bool:
        """Return whether a power off was requested, and clear the request."""
        asked, self._power_off = self._power_off, False
        return asked
