"""The network of one box: it carries out the requests of the machine and hands over what arrives."""

from collections.abc import Callable, Iterable

from ur_emulator.budgets import BUDGETS
from ur_emulator.host.runtime.barrier import Report
from ur_emulator.host.runtime.event_loop import EventLoop
from ur_emulator.host.script_network.modbus_units import ModbusClient
from ur_emulator.host.script_network.sockets import Buffers, OutgoingConnection, ScriptConnection
from ur_emulator.host.script_network.xmlrpc import XmlRpcClient
from ur_emulator.machine.controller.io.network import (
    Arrival,
    CallProcedure,
    CloseServer,
    CloseSocket,
    Network,
    OpenSocket,
    Request,
    SendBytes,
)

_LOCAL = ("127.0.0.1", "localhost")


class LoopNetwork:
    """Opens connections in a loop: the only place from which a box connects to others.

    Attributes:
        own_ports: host and number of each port of the box, by the number at which a robot has it: what a
            program reaches at 127.0.0.1.
    """

    def __init__(
        self,
        loop: EventLoop,
        network: Network,
        period_s: float,
        arrive: Callable[[Arrival], None],
        report: Report,
        own_address: str = "",
    ) -> None:
        """Prepare; nothing is opened.

        Args:
            network: of the machine.
            arrive: takes what comes from outside.
            report: gets errors of ours and what they have ended.
            own_address: where to call from, if a peer can be reached from there; "" leaves it open. A robot
                calls from the address at which it is called, and clients that listen for it check that.
        """
        self._network = network
        self._arrive = arrive
        self.own_ports: dict[int, tuple[str, int]] = {}
        self._buffers = Buffers(loop, report, own_address)
        self._sockets: dict[int, ScriptConnection] = {}
        self._modbus = ModbusClient(loop, self.open, period_s, arrive, report)
        self._remotes = XmlRpcClient(loop, self.open, arrive, report)

    @property
    def holds_back(self) -> bool:
        """Whether a peer waits until the script has read what has come."""
        return bool(self._buffers.full)

    def carry_out(self, requests: Iterable[Request]) -> None:
        """Do what the machine asks for after a cycle; read on where there is room again."""
        for request in requests:
            match request:
                case SendBytes(number, data):
                    self._sockets[number].send(data)
                case OpenSocket(number, host, port):
                    opened = ScriptConnection(self._buffers, number, self._network, self._arrive)
                    self._sockets[number] = opened
                    self._connect(opened, host, port)
                case CloseSocket(number):
                    self._sockets.pop(number).drop()
                case CallProcedure():
                    self._remotes.call(request)
                case CloseServer(number):
                    self._remotes.close_server(number)
                case _:
                    self._modbus.carry_out(request)
        for connection in tuple(self._buffers.full):
            connection.read_on()

    def open(self, host: str, port: int) -> OutgoingConnection:
        """Begin to connect to `host`:`port`, for the box itself."""
        connection = OutgoingConnection(self._buffers)
        self._connect(connection, host, port)
        return connection

    def close(self) -> None:
        """Close everything, whatever the programs are doing."""
        self._modbus.close()
        self._remotes.close()
        self._buffers.close()
        for connection in tuple(self._buffers.connections):
            connection.close()

    def _connect(self, connection: OutgoingConnection, host: str, port: int) -> None:
        if len(host) > BUDGETS.host_length:
            connection.refuse(f"{len(host)} characters given: a host has up to {BUDGETS.host_length}")
        elif len(self._buffers.connections) >= BUDGETS.outgoing_connections:
            connection.refuse(f"the box has {BUDGETS.outgoing_connections} connections, close one first")
        elif host in _LOCAL and port in self.own_ports:
            connection.is_own = True
            connection.begin(*self.own_ports[port])
        else:
            connection.begin(host, port)
