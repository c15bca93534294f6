"""ProgramRequests: what programs and clients ask of the box in a cycle, until the box has done it."""

from __future__ import annotations


class ProgramRequests:
    """Stops that wait for their place in the cycle."""

    __slots__ = ("_power_off", "_protective_stop")

    def __init__(self) -> None:
        self._protective_stop = self._power_off = False

    def protective_stop(self) -> None:
        """Ask for a protective stop at the end of this cycle."""
        self._protective_stop = True

    def power_off(self) -> None:
        """Ask for the power to be cut once the scripts of this cycle have run."""
        self._power_off = True

    def take_protective_stop(self) -> bool:
        """Return whether a protective stop was asked for, and forget it."""
        asked, self._protective_stop = self._protective_stop, False
        return asked

    def take_power_off(self) -> bool:
        """Return whether a power off was asked for, and forget it."""
        asked, self._power_off = self._power_off, False
        return asked
