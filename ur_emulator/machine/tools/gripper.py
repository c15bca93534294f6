"""What the controllers of all tools have in common: supply, registers, and what they see of fingers."""

from abc import ABC, abstractmethod
from collections.abc import Sequence

from protocol import modbus, modbus_rtu
from ur_emulator.machine.controller.io.lines import InputOutput, ToolLine
from ur_emulator.machine.plant.hand import FingerCommand, FingerState
from ur_hil.tools import ToolModel

_REACHED = 0.0003  # m; a target this near is reached: less than a count of the finest gripper
_RESTS = 0.002  # m/s; slower than this the fingers stand


class Gripper(ABC):
    """The controller of a tool; `step` is its cycle. Ports read it; what clients change are commands.

    Attributes:
        line: settings of the serial line with which it is reached.
        is_at_modbus: the robot's Modbus server passes on what is for its unit.
        unit: its address on the serial line; 0: it is on none.
        has_cable: its supply comes from the control box, not from the tool connector.
        has_power: it has its supply.
        is_busy: it moves, or has not yet taken what clients have set.
        supply_current: what it takes from the tool connector [A].
    """

    line = ToolLine(is_enabled=True)
    is_at_modbus = False

    def __init__(self, tool: ToolModel, period: float, unit: int, *, has_cable: bool = False) -> None:
        """Begin without power; `period` is the cycle [s]."""
        self.tool, self.unit, self.has_cable = tool, unit, has_cable
        self.has_power = self.is_busy = False
        self.supply_current = 0.0
        self._period = period
        self._fingers = FingerState(tool.stroke, 0.0, 0.0)
        self._command: FingerCommand | None = None

    @abstractmethod
    def step(self, fingers: FingerState, has_power: bool, io: InputOutput) -> FingerCommand | None:
        """Advance by a cycle.

        Args:
            fingers: after the last cycle; `share` is 1 where a cup is on an object.
            has_power: the connector or the cable has 24 V, and no stop has cut them.
            io: lines that drive some tools, and those that they drive.

        Returns:
            What the drive does; None: it holds where it is, as its screw does without power.
        """

    @abstractmethod
    def summary(self) -> dict[str, float]:
        """What people want to know of it."""

    @property
    def _stands(self) -> bool:
        return abs(self._fingers.speed) < _RESTS

    def _is_at(self, width: float) -> bool:
        return abs(self._fingers.width - width) <= _REACHED

    # --- registers, of tools on a serial line

    def read_registers(self, address: int, count: int) -> list[int]:
        """Read registers; LookupError if one of them does not exist."""
        raise LookupError

    def write_registers(self, address: int, values: Sequence[int]) -> None:
        """Write registers; LookupError if one of them does not exist."""
        raise LookupError

    def answer(self, pdu: bytes) -> bytes:
        """Do a request of Modbus, and return the answer."""
        code, both = modbus.ExceptionCode, pdu[0] == modbus.ModbusFunction.READ_WRITE_REGISTERS
        values: Sequence[int] = ()
        try:
            requests = modbus_rtu.decode_read_write(pdu)[::-1] if both else (modbus.decode_request(pdu),)
            for request in requests:
                if request.function.is_bits:
                    raise modbus.ModbusRequestError(code.ILLEGAL_FUNCTION)
                if request.function.is_read:
                    values = self.read_registers(request.address, request.count)
                else:
                    self.write_registers(request.address, request.values)
            return bytes((pdu[0], *modbus.encode_answer(request, values)[1:]))
        except modbus.ModbusRequestError as error:
            wrong = error.code
        except LookupError:
            wrong = code.ILLEGAL_DATA_ADDRESS if self.has_power else code.SLAVE_DEVICE_FAILURE
        return modbus.encode_exception(pdu[0], wrong)
