"""Port 54321: the serial line at the tool of an e-Series arm, as the maker's forwarder passes it on.

Bytes of Modbus RTU pass only while the tool has its supply and the line is set up as the gripper wants it;
the program or the installation does both (`set_tool_voltage`, `set_tool_communication`). One client at a time
has the line, the others wait. While a client of port 63352 is there, the software behind that port has it,
and this port is silent, as where both of the maker's packages are installed (reference `grippers.md` 2).

A gripper takes its time: an answer comes `_PACE` after its request. Otherwise a client that asks without a
pause would ask thousands of times a second.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from protocol import modbus, modbus_rtu
from ur_emulator.host.ports.robotiq import RobotiqPort
from ur_emulator.host.ports.session import Session, SessionPort
from ur_emulator.host.runtime.connection import Connection
from ur_emulator.host.served_box import ServedBox
from ur_emulator.host.steps import Steps
from ur_emulator.machine.controller.command import BoxParts, Result
from ur_emulator.machine.tools.onrobot import OnRobotGripper
from ur_emulator.machine.tools.robotiq import RobotiqGripper

_REQUEST_COST = 4
_PACE = 0.004  # s

_Gripper = RobotiqGripper | OnRobotGripper


class ToolLinePort(SessionPort["_LineSession"]):
    """Passes requests of Modbus RTU on to grippers."""

    def __init__(self, box: ServedBox, grippers: Sequence[_Gripper], software: RobotiqPort) -> None:
        """`software` is the other user of the line."""
        super().__init__(box)
        self._grippers = {gripper.unit: gripper for gripper in grippers}
        self._software = software

    def _begin(self, connection: Connection) -> "_LineSession":
        return _LineSession(connection, self._box, self)

    def has_line(self, connection: Connection) -> bool:
        """Whether a client has the line; what others send is lost."""
        return not self._software.has_clients and next(iter(self._sessions), None) is connection

    def gripper(self, unit: int) -> _Gripper | None:
        """The gripper that answers to a unit; None: nothing answers."""
        line = self._box.controller.state.io.tool_line
        gripper = self._grippers.get(unit)
        is_reached = gripper is not None and gripper.has_power and line[:4] == gripper.line[:4]
        return gripper if is_reached else None


@dataclass(frozen=True, slots=True)
class _Exchange:
    """A request on the line; None: a cycle in which it is on its way."""

    gripper: _Gripper
    pdu: bytes | None

    def apply(self, box: BoxParts) -> Result:
        return None if self.pdu is None else {"pdu": answer_registers(self.gripper, self.pdu)}


def answer_registers(gripper: _Gripper, pdu: bytes) -> bytes:
    """Return the answer of the gripper to a request."""
    try:
        if pdu[0] == modbus.ModbusFunction.READ_WRITE_REGISTERS:
            read, write = modbus_rtu.decode_read_write(pdu)
            gripper.write_registers(write.address, write.values)
            values = gripper.read_registers(read.address, read.count)
            return bytes((pdu[0], *modbus.encode_answer(read, values)[1:]))
        request = modbus.decode_request(pdu)
        if request.function.is_bits:
            raise modbus.ModbusRequestError(modbus.ExceptionCode.ILLEGAL_FUNCTION)
        if request.function.is_read:
            return modbus.encode_answer(request, gripper.read_registers(request.address, request.count))
        gripper.write_registers(request.address, request.values)
        return modbus.encode_answer(request)
    except modbus.ModbusRequestError as error:
        return modbus.encode_exception(pdu[0], error.code)
    except LookupError:
        code = modbus.ExceptionCode
        wrong = code.ILLEGAL_DATA_ADDRESS if gripper.has_power else code.SLAVE_DEVICE_FAILURE
        return modbus.encode_exception(pdu[0], wrong)


class _LineSession(Session):
    """A client."""

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
        gripper = self._port.gripper(frame.unit)
        if gripper is None:
            return _REQUEST_COST
        for _ in range(1, round(_PACE / self._box.controller.period_s)):
            yield from self._box.apply(_Exchange(gripper, None))
        result = yield from self._box.apply(_Exchange(gripper, frame.pdu))
        if self._port.has_line(self.connection) and self._port.gripper(frame.unit) is not None:
            answer = modbus_rtu.encode_rtu(frame.unit, result["pdu"])
            if not self.connection.send(answer):
                self.connection.close()
        return _REQUEST_COST
