"""Port 54321: the serial line at the tool of an e-Series arm, as the maker's forwarder passes it on.

Bytes of Modbus RTU pass only while the tool has its supply and the line is set up as the gripper wants it;
the program or the installation does both (`set_tool_voltage`, `set_tool_communication`). One client at a time
has the line, the others wait. While a client of port 63352 is there, the software behind that port has it,
and this port is silent, as where both of the maker's packages are installed (reference `grippers.md` 2).

A gripper takes its time: an answer comes `_PACE` after its request. Otherwise a client that asks without a
pause would ask thousands of times a second.
"""

from collections.abc import Sequence
from functools import partial

from protocol import modbus_rtu
from ur_emulator.host.ports.robotiq import RobotiqPort
from ur_emulator.host.ports.session import Session, SessionPort
from ur_emulator.host.runtime.connection import Connection
from ur_emulator.host.served_box import ServedBox
from ur_emulator.host.steps import Steps
from ur_emulator.machine.commands.grippers import ExchangeRegisters

_REQUEST_COST = 4
_PACE = 0.004  # s


class ToolLinePort(SessionPort["_LineSession"]):
    """Passes requests of Modbus RTU on to grippers."""

    def __init__(self, box: ServedBox, users: Sequence[RobotiqPort]) -> None:
        """Clients of the `users` have the line before those of this port."""
        super().__init__(box, partial(_LineSession, port=self))
        self._users = users

    def has_line(self, connection: Connection) -> bool:
        """Whether a client has the line; what others send is lost."""
        is_first = next(iter(self._sessions), None) is connection
        return is_first and not any(port.has_clients for port in self._users)

    def reaches(self, unit: int) -> bool:
        """Whether a gripper answers to a unit; otherwise nothing does."""
        state = self._box.controller.state
        line = state.io.tool_line[:4]
        return any(g.unit == unit and g.has_power and g.line[:4] == line for g in state.grippers)


class _LineSession(Session):
    def __init__(self, connection: Connection, box: ServedBox, port: ToolLinePort) -> None:
        super().__init__(connection, box)
        self._port = port
        self._inbox = bytearray()

    def _take(self, data: bytes) -> None:
        if self._port.has_line(self.connection):
            self._inbox += data
            del self._inbox[: -modbus_rtu.MOST_WAITING]

    def _answer_next(self) -> Steps[int]:
        frame = modbus_rtu.take_request(self._inbox)
        if frame is None:
            return 0
        if not self._port.reaches(frame.unit):
            return _REQUEST_COST
        for _ in range(1, round(_PACE / self._box.controller.period_s)):
            yield from self._box.apply(ExchangeRegisters(frame.unit, b""))
        result = yield from self._box.apply(ExchangeRegisters(frame.unit, frame.pdu))
        if self._port.has_line(self.connection) and self._port.reaches(frame.unit):
            answer = modbus_rtu.encode_rtu(frame.unit, result["pdu"])
            if not self.connection.send(answer):
                self.connection.close()
        return _REQUEST_COST
