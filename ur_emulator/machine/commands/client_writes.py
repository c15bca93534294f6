"""Commands of clients that write: input variables of RTDE, the robot's Modbus map."""

from dataclasses import dataclass

from protocol.rtde.types import RtdeValue
from ur_emulator.machine.controller.command import BoxParts
from ur_emulator.machine.controller.modbus_map import can_write, write


@dataclass(frozen=True, slots=True)
class WriteInputs:
    """Write input variables of RTDE: pairs of name and value, in order; see `protocol.rtde.fields.INPUTS`."""

    values: tuple[tuple[str, RtdeValue], ...]

    def apply(self, box: BoxParts) -> None:
        box.state.client_inputs.write(self.values)


@dataclass(frozen=True, slots=True)
class WriteModbus:
    """Write neighbouring addresses of the robot's Modbus map; what cannot be written is left out.

    The values are 0 or 1 for coils, 0 to 65535 for registers; `first` is the lowest address.
    """

    is_coils: bool
    first: int
    values: tuple[int, ...]

    def apply(self, box: BoxParts) -> None:
        for address, value in enumerate(self.values, self.first):
            if can_write(self.is_coils, address):
                write(box.state, self.is_coils, address, value)
