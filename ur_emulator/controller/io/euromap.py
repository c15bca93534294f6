"""The Euromap67 interface to an injection moulding machine, as state: no machine is connected."""

from __future__ import annotations

from dataclasses import dataclass

# Signals in each direction: two words of the Modbus map (protocol notes, section 9).
N_EUROMAP = 32


@dataclass(slots=True)
class Euromap:
    """Words of the machine's and the robot's signals, signal 0 in the lowest bit."""

    inputs: int = 0
    outputs: int = 0

    def read_input(self, port: int) -> bool:
        """Return a signal of the machine."""
        return bool(self.inputs >> port & 1)

    def read_output(self, port: int) -> bool:
        """Return a signal of the robot."""
        return bool(self.outputs >> port & 1)

    def write_output(self, port: int, value: bool) -> None:
        """Switch a signal of the robot."""
        mask = 1 << port
        self.outputs = self.outputs | mask if value else self.outputs & ~mask
