"""Configuration of lines and registers: actions of inputs, and outputs that follow the program.

Source: URScript manual CB3 3.15, module ioconfiguration.
"""

from dataclasses import dataclass, field
from enum import IntEnum

from ur_emulator.machine.controller.io.lines import CONFIGURABLE, STANDARD, TOOL, InputOutput, RunState, level
from ur_emulator.machine.controller.io.modbus_signals import ModbusSignals
from ur_emulator.machine.controller.io.network import DEFAULT_ACTION, FREEDRIVE_ACTION
from ur_emulator.machine.controller.io.registers import Registers


class OutputKind(IntEnum):
    """The groups of outputs that may follow the program."""

    STANDARD = 0
    CONFIGURABLE = 1
    TOOL = 2
    ANALOG = 3
    GP_BOOLEAN = 4
    GP_INTEGER = 5
    GP_FLOAT = 6
    EUROMAP = 7


_OUTPUTS = (STANDARD, CONFIGURABLE, TOOL)  # as the first three kinds
_INPUTS = {f"{group.name}_digital": group for group in _OUTPUTS}


@dataclass(slots=True)
class IoConfiguration:
    """What programs have configured; it stays when they end.

    `input_actions` are those of (group, index) where it is not the default.
    """

    io: InputOutput
    registers: Registers
    modbus: ModbusSignals
    input_actions: dict[tuple[str, int], str] = field(default_factory=dict)
    program_runs: bool = False
    _rules: dict[tuple[OutputKind, int], RunState] = field(default_factory=dict)

    @property
    def has_actions(self) -> bool:
        """True while an input may have an action: of the box, or of another unit."""
        return bool(self.input_actions or self.modbus.signals)

    def set_input_action(self, group: str, index: int, action: str) -> None:
        """Set the action of an input."""
        if action == DEFAULT_ACTION:
            self.input_actions.pop((group, index), None)
        else:
            self.input_actions[group, index] = action

    def requests_freedrive(self) -> bool:
        """True while a line that is set up for it, or a signal of another unit, is high."""
        for (group, index), action in self.input_actions.items():
            if action == FREEDRIVE_ACTION and self.is_high(group, index):
                return True
        return self.modbus.requests_freedrive

    def is_high(self, group: str, index: int) -> bool:
        """Return the level of an input; names of groups as in those of builtins."""
        if group == "gp_boolean":
            return self.registers.inputs.booleans[index]
        return self.io.read_digital_in(_INPUTS[group].bits[index])

    def set_rule(self, kind: OutputKind, index: int, rule: RunState) -> None:
        """Let an output follow the program; it takes its value for the present state at once."""
        if rule is RunState.KEEP:
            self._rules.pop((kind, index), None)
        else:
            self._rules[kind, index] = rule
            self._set(kind, index, level(rule, self.program_runs))

    def follow(self, program_runs: bool, *, unscheduled: bool = False) -> None:
        """Set the outputs that follow the program, which has started or ended; see `lines.level`."""
        self.program_runs = program_runs
        self.modbus.follow(program_runs, unscheduled=unscheduled)
        for (kind, index), rule in self._rules.items():
            self._set(kind, index, level(rule, program_runs, unscheduled=unscheduled))

    def _set(self, kind: OutputKind, index: int, is_high: bool | None) -> None:
        if is_high is None:
            return
        match kind:
            case OutputKind.ANALOG:
                self.io.analog_out[index].set_ratio(float(is_high))
            case OutputKind.GP_BOOLEAN:
                self.registers.outputs.booleans[index] = is_high
            case OutputKind.GP_INTEGER:
                self.registers.outputs.integers[index] = int(is_high)
            case OutputKind.GP_FLOAT:
                self.registers.outputs.floats[index] = float(is_high)
            case OutputKind.EUROMAP:
                self.io.write_euromap_output(index, is_high)
            case _:
                self.io.write_digital_out(_OUTPUTS[kind].bits[index], is_high)
