"""The Modbus units that the programs of one box talk to: one connection each, advanced in the loop.

The loop calls them only while there are any.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

from ur_emulator.budgets import BUDGETS
from ur_emulator.controller.io.modbus_signals import UnitAddress
from ur_emulator.realtime.barrier import Report
from ur_emulator.realtime.event_loop import EventLoop
from ur_emulator.scripting.network import ScriptSocket
from ur_emulator.servers.modbus.link import ModbusLink


class ModbusClient:
    """All connections to Modbus units of one box."""

    def __init__(
        self,
        loop: EventLoop,
        connect: Callable[[str, int], ScriptSocket],
        period_s: float,
        report: Report,
    ) -> None:
        """Prepare; nothing is connected before there is a unit.

        Args:
            loop: advances the connections.
            connect: begins to connect to a host and port.
            period_s: control cycle [s].
            report: called with an error of ours and what it has ended.
        """
        self._loop = loop
        self._connect = connect
        self._period = period_s
        self._report = report
        self._links: dict[UnitAddress, ModbusLink] = {}

    def unit(self, address: UnitAddress) -> ModbusLink:
        """Return the connection to a unit, the same as long as it is in use."""
        link = self._links.get(address)
        if link is None:
            if not self._links:
                self._loop.add(self)
            elif len(self._links) >= BUDGETS.modbus_links:
                self._end_oldest_released()
            link = self._links[address] = ModbusLink(
                str(address), partial(self._connect, *address), self._period
            )
        link.is_released = False
        return link

    def advance(self, now: float) -> float:
        """Advance all connections; close those that were released and are idle."""
        next_time = math.inf
        for address, link in tuple(self._links.items()):
            next_time = min(next_time, link.advance(now))
            if link.is_released and link.is_idle:
                self._end(address)
        return next_time

    def failed(self, error: Exception) -> None:
        """Close all connections after an error of ours; programs see units that do not answer."""
        self._report("the connections to Modbus units are closed", error)
        for link in self._links.values():
            link.give_up("is not asked any more")
        self.close()

    def close(self) -> None:
        """Close all connections at once."""
        for address in tuple(self._links):
            self._end(address)

    def _end_oldest_released(self) -> None:
        for address, link in self._links.items():
            if link.is_released:
                self._end(address)
                return

    def _end(self, address: UnitAddress) -> None:
        self._links.pop(address).close()
        if not self._links:
            self._loop.remove(self)
