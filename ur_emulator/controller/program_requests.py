"""ProgramRequests: stops that programs and clients request, until the controller carries them out."""

from __future__ import annotations


class ProgramRequests:
    """Requests that wait for their place in the cycle."""

    __slots__ = ("_power_off", "_protective_stop")

    def __init__(self) -> None:
        self._protective_stop = self._power_off = False

    def protective_stop(self) -> None:
        """Request a protective stop at the end of this cycle."""
        self._protective_stop = True

    def power_off(self) -> None:
        """Request that the power is cut once the scripts of this cycle have run."""
        self._power_off = True

    def take_protective_stop(self) -> bool:
        """Return whether a protective stop was requested, and clear the request."""
        asked, self._protective_stop = self._protective_stop, False
        return asked

    def take_power_off(self) -> bool:
        """Return whether a power off was requested, and clear the request."""
        asked, self._power_off = self._power_off, False
        return asked
