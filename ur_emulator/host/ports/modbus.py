"""Port 502: the robot's Modbus map for Modbus TCP clients.

Reads are answered at once, from the state at the end of the last cycle. Writes are commands, answered after
the cycle in which they act; the next request of that client follows then, so that it reads what it has
written. A request with an address that does not exist, or a write to one that can only be read, is refused as
a whole with exception 2. The unit number is not used, except for those of OnRobot grippers at the tool.
Source: UR "Modbus server" article (docs/protocol/modbus.md); exceptions: Modbus application protocol.
"""

from protocol import modbus
from protocol.errors import RemoteProtocolError
from ur_emulator.host.ports.session import Session
from ur_emulator.host.runtime.connection import Connection
from ur_emulator.host.served_box import ServedBox
from ur_emulator.host.steps import Steps
from ur_emulator.machine.commands.client_writes import WriteModbus
from ur_emulator.machine.commands.grippers import ExchangeRegisters, OperateGrippers
from ur_emulator.machine.controller.modbus_map import MapAddressError, can_write, read_coil, read_register

# 2 in its register 0 turns the supply of grippers off and on. Source: reference `grippers.md` 3.2 (S1).
_CYCLE_POWER = {(63, modbus.encode_write(modbus.ModbusFunction(function), 0, [2])) for function in (6, 16)}
_READS = (modbus.ModbusFunction.READ_HOLDING_REGISTERS, modbus.ModbusFunction.READ_INPUT_REGISTERS)
# Units of work for a request, and how many values cost another one.
_REQUEST_COST, _VALUES_PER_UNIT = 4, 4


class ModbusSession(Session):
    """A client that sends Modbus requests."""

    def __init__(self, connection: Connection, box: ServedBox) -> None:
        super().__init__(connection, box)
        self._inbox = bytearray()

    def _take(self, data: bytes) -> None:
        self._inbox += data

    def _answer_next(self) -> Steps[int]:
        try:
            frame = modbus.take_frame(self._inbox)
        except RemoteProtocolError:
            self.connection.close()
            return 0
        if frame is None:
            return 0
        grippers = {g.unit: g for g in self._box.controller.state.grippers if g.is_at_modbus}
        gripper = grippers.get(frame.unit)
        if grippers and (frame.unit, frame.pdu) in _CYCLE_POWER:
            yield from self._box.apply(OperateGrippers(tuple(grippers), "cycle_power"))
            pdu = frame.pdu[:5]
        elif gripper is not None and frame.pdu[0] in _READS:
            pdu = gripper.answer(frame.pdu)
        elif gripper is not None:
            pdu = (yield from self._box.apply(ExchangeRegisters(frame.unit, frame.pdu)))["pdu"]
        else:
            pdu = yield from self._answer(frame.pdu)
        if not self.connection.send(modbus.encode_frame(frame.transaction, frame.unit, pdu)):
            self.connection.close()  # without its answer, a client takes the next one for it
        return _REQUEST_COST + len(pdu) // (2 * _VALUES_PER_UNIT)

    def _answer(self, pdu: bytes) -> Steps[bytes]:
        """Return the answer to a request; that to a write after the cycle in which it acts."""
        try:
            request = modbus.decode_request(pdu)
            if request.function.is_read:
                return modbus.encode_answer(request, self._read(request))
            is_bits, first = request.function.is_bits, request.address
            if not all(can_write(is_bits, first + i) for i in range(request.count)):
                raise modbus.ModbusRequestError(modbus.ExceptionCode.ILLEGAL_DATA_ADDRESS)
            yield from self._box.apply(WriteModbus(is_bits, first, request.values))
            return modbus.encode_answer(request)
        except MapAddressError:
            return modbus.encode_exception(pdu[0], modbus.ExceptionCode.ILLEGAL_DATA_ADDRESS)
        except modbus.ModbusRequestError as error:
            return modbus.encode_exception(pdu[0], error.code)

    def _read(self, request: modbus.ModbusRequest) -> list[int]:
        state = self._box.controller.state
        read = read_coil if request.function.is_bits else read_register
        return [int(read(state, request.address + i)) for i in range(request.count)]
