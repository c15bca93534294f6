"""An RG2 or RG6 of OnRobot: one state, which clients reach by XML-RPC, registers, or words by tool outputs.

It is busy from a command until it is at its width or presses; a grip is detected while it presses, and while
it has closed to less than 5 mm. Calls and words replace a command, registers do not. Arms turn at one speed.

A word has 17 bits, the highest first: tool output 0 high for a cycle, output 1 with the inverse of the bit,
then output 0 low for one: `0x8000 | 0x4000 for the second | 4 (width [mm] + steps of force * (1 + opening))`.
Tool input 0 is the grip, input 1 high while it is not busy, analogue input 2 the angle of the arms.
Source: reference `grippers.md` 3 and 6; what is chosen: docs/fidelity.md.
"""

from collections.abc import Sequence
from math import asin, cos, pi

from ur_emulator.machine.controller.io.lines import TOOL, InputOutput, ToolLine
from ur_emulator.machine.plant.hand import FingerCommand, FingerState
from ur_emulator.machine.tools.gripper import Gripper
from ur_hil.tools import ToolModel

FIRST_UNIT = 65  # of Modbus, of a gripper that is alone; two are the next ones
# Bits of the status, from the lowest.
STATUS = ("busy", "grip_detected", "s1_pushed", "s1_triggered", "s2_pushed", "s2_triggered", "safety_failed")

_CLOSED = 5.0  # mm; jaws that have closed to less read as a grip
_LEAST_BUSY = 0.1  # s; programs look for it within 20 cycles
_OFF = 1.0  # s without supply, of a power cycle
_PAUSE = 0.1  # s; a longer one between two bits ends a word
_CURRENT = 0.2  # A while it moves; the screw holds by itself
_GRIP, _STOP, _GRIP_OFFSET = 1, 8, 16


class OnRobotGripper(Gripper):
    """A gripper; widths in mm."""

    line = ToolLine(is_enabled=True, parity=2)
    is_at_modbus = True

    def __init__(self, tool: ToolModel, period: float, unit: int = FIRST_UNIT) -> None:
        super().__init__(tool, period, unit)
        assert tool.linkage is not None
        self.linkage = tool.linkage
        self._offset = self._tip = 1e3 * tool.linkage.tip
        # The last command, and the time since it.
        self._closes = self._has_grip = False
        self._since = self._first_depth = 0.0
        # Registers 0 to 2; bits of a word that have come, and the time since the last of them.
        self._targets = [0, 0, 0]
        self._bits, self._was_high, self._pause = "", False, 0.0
        self._has_inputs = unit != FIRST_UNIT + 2
        self._off = 0.0  # time that is left without supply

    def grip(self, width: float, force: float, offset: float | None = None) -> None:
        """Go to a width between the fingertips, or between the metal tips with an `offset` of 0."""
        gap = width + 2.0 * ((self._offset if offset is None else offset) - self._tip)
        target, (weak, strong) = min(self.tool.stroke, max(0.0, 1e-3 * gap)), self.tool.force
        self._command = FingerCommand(target, 0.0, min(strong, max(weak, force)))
        self.is_busy, self._has_grip, self._since = True, False, 0.0
        self._closes, self._first_depth = target < self._fingers.width, self.values()["depth"]

    def stop(self) -> None:
        """Stay there; what it holds it goes on to hold."""
        self._command, self.is_busy = None, False

    def set_offset(self, thickness: float) -> None:
        """Set the thickness of the fingertips."""
        self._offset = min(100.0, max(-100.0, thickness))

    def cycle_power(self) -> None:
        """Turn the supply off for a moment."""
        self._off, self.is_busy = _OFF, True

    @property
    def _angle(self) -> float:
        metal = self._fingers.width + 2e-3 * self._tip
        # A file may have a stroke that is longer than its arms.
        return asin(min(0.99, (metal - self.linkage.root) / (2.0 * self.linkage.arm)))

    def values(self) -> dict[str, float]:
        """What `rg_get_...` answers while it has power, by name."""
        speed, angle, arm = self._fingers.speed, self._angle, self.linkage.arm
        depth = 1e3 * arm * (1.0 - cos(angle))
        bits = dict.fromkeys(STATUS, False) | {"busy": self.is_busy, "grip_detected": self._has_grip}
        return {
            "width": 1e3 * self._fingers.width + 2.0 * (self._tip - self._offset),
            "depth": depth,
            "relative_depth": depth - self._first_depth,
            "angle": angle,
            "angle_speed": speed / (2.0 * arm * cos(angle)),
            "speed": 1e3 * speed,
            "fingertip_offset": self._offset,
            "status": sum(bit << i for i, bit in enumerate(bits.values())),
            **bits,
        }

    def summary(self) -> dict[str, float]:
        """The width between its fingertips [m], and its state."""
        status = self.values()["status"] if self.has_power else -1
        return {"unit": self.unit, "width": self._fingers.width, "status": status}

    def read_registers(self, address: int, count: int) -> list[int]:
        """Read registers, in 0.1 mm; LookupError also without power."""
        if not self.has_power:
            raise LookupError
        values, offset = self.values(), 10.0 * self._offset
        registers = dict.fromkeys(range(0x0100, 0x0120), 0.0) | {
            0x0102: offset,
            0x0107: 10.0 * values["depth"],
            0x0108: 10.0 * values["relative_depth"],
            0x010B: 10.0 * values["width"] + 2.0 * offset,
            0x010C: values["status"],
            0x0113: 10.0 * values["width"],
        }
        return [round(registers[address + i]) & 0xFFFF for i in range(count)]

    def write_registers(self, address: int, values: Sequence[int]) -> None:
        """Write force, width and command from 0 on, or the offset; LookupError also without power."""
        end = address + len(values)
        if not self.has_power or (end > 3 and (address, end) != (0x0407, 0x0408)):
            raise LookupError
        if end > 3:
            self.set_offset(0.1 * (values[0] - (values[0] >> 15 << 16)))
            return
        self._targets[address:end] = values
        force, width, command = self._targets
        if end == 3 and command == _STOP:
            self.stop()
        elif end == 3 and command in (_GRIP, _GRIP_OFFSET) and not self.is_busy:
            self.grip(0.1 * width, 0.1 * force, 0.0 if command == _GRIP else None)

    def step(self, fingers: FingerState, has_power: bool, io: InputOutput) -> FingerCommand | None:
        """Advance by a cycle."""
        self._fingers, self._off = fingers, max(0.0, self._off - self._period)
        if (has_power and not self._off) is not self.has_power:
            self.has_power, self._has_grip = not self.has_power, False
            self.stop()
        if self.has_power:
            self._read_bit(io.read_digital_out(TOOL.first), io.read_digital_out(TOOL.first + 1))
        else:
            self.is_busy = self._off > 0.0
        self.supply_current = _CURRENT if self.is_busy and self.has_power else 0.0
        if self._command is not None:
            self._command = self._command._replace(speed=self.tool.speed[1] * cos(self._angle))
            self._look(self._command.width)
        if self._has_inputs:
            inputs = self._has_grip | (self.has_power and not self.is_busy) << 1
            io.digital_in = io.digital_in & ~TOOL.mask | inputs << TOOL.first
            voltage = 0.026 + 2.976 * (self._angle + self.linkage.least_angle) / (0.5 * pi)
            io.tool_analog_in[0].set_ratio(0.1 * voltage * self.has_power)
        return self._command

    def _read_bit(self, is_high: bool, inverse: bool) -> None:
        rises, self._was_high = is_high and not self._was_high, is_high
        self._pause = 0.0 if rises else self._pause + self._period
        self._bits = ("" if self._pause > _PAUSE else self._bits) + "10"[inverse] * rises
        if len(self._bits) == 17:
            word, self._bits = int(self._bits, 2), ""
            self._has_inputs = bool(word & 0x4000) is (self.unit == FIRST_UNIT + 2)
            if self._has_inputs:
                opening = round(1e3 * self.tool.stroke + 2.0 * self._tip)
                steps, width = divmod((word & 0x3FFF) // 4, 1 + opening)
                self.grip(width, steps * self.linkage.force_step, 0.0)

    def _look(self, target: float) -> None:
        self._since += self._period
        stands, reached = self._stands, self._is_at(target)
        presses = abs(self._fingers.share) > 0.95 and not reached
        if stands and (reached or presses) and self._since >= _LEAST_BUSY:
            self.is_busy = False
        is_closed = self._closes and self.values()["width"] < _CLOSED
        self._has_grip = not self.is_busy and stands and (presses or is_closed)
