"""The network of one box: the only place from which it connects to others."""

from ur_emulator.budgets import BUDGETS
from ur_emulator.host.runtime.barrier import Report
from ur_emulator.host.runtime.event_loop import EventLoop
from ur_emulator.host.script_network.modbus_units import ModbusClient, ModbusLink
from ur_emulator.host.script_network.sockets import Buffers, ScriptConnection
from ur_emulator.host.script_network.xmlrpc import XmlRpcClient, XmlRpcServer
from ur_emulator.machine.controller.io.modbus_signals import UnitAddress

_LOCAL = ("127.0.0.1", "localhost")


class LoopNetwork:
    """Opens connections in a loop (see `scripting.network.Network`).

    Attributes:
        own_ports: host and number of each port of the box, by the number at which a robot has it: what a
            program reaches at 127.0.0.1.
    """

    def __init__(self, loop: EventLoop, period_s: float, report: Report, own_address: str = "") -> None:
        """Prepare; nothing is opened.

        A robot calls from the address at which it is called (`own_address`), and clients that listen for it
        check that. `report` gets errors of ours and what they have ended.
        """
        self._loop = loop
        self._report = report
        self._own_address = own_address
        self.own_ports: dict[int, tuple[str, int]] = {}
        self._buffers = Buffers(loop, report)
        self._modbus = ModbusClient(loop, self.open, period_s, report)
        self._remotes = XmlRpcClient(loop, self.open, report)

    def open(self, host: str, port: int) -> ScriptConnection:
        """Begin to connect to `host`:`port`."""
        own = self.own_ports.get(port) if host in _LOCAL else None
        connection = ScriptConnection(
            self._loop, self._buffers, self._report, self._own_address, is_own=own is not None
        )
        if len(host) > BUDGETS.host_length:
            connection.refuse(f"{len(host)} characters given: a host has up to {BUDGETS.host_length}")
        elif len(self._buffers.connections) < BUDGETS.outgoing_connections:
            connection.begin(*(own or (host, port)))
        else:
            connection.refuse(f"the box has {BUDGETS.outgoing_connections} connections, close one first")
        return connection

    def remote_server(self, url: str) -> XmlRpcServer:
        """Return an XML-RPC server; nothing is connected before its first call."""
        return XmlRpcServer(self._remotes, url)

    def modbus_unit(self, address: UnitAddress) -> ModbusLink:
        """Return the connection to a Modbus unit."""
        return self._modbus.unit(address)

    def close(self) -> None:
        """Close everything, whatever the programs are doing."""
        self._modbus.close()
        self._remotes.close()
        self._buffers.close()
        for connection in tuple(self._buffers.connections):
            connection.close()
