"""What the input variables of RTDE do in the box. Names and types are in `protocol.rtde.fields`.

A register is written at once. Variables that act together, a mask and its values, act whenever one of them
is written, with the last values of the others; values outside a mask are ignored, since clients
do not initialise them.
"""

import math
from collections.abc import Callable, Iterable
from typing import Any

from ur_emulator.machine.controller.clock import Clock
from ur_emulator.machine.controller.io.lines import DIGITAL_GROUPS, DigitalGroup, InputOutput
from ur_emulator.machine.controller.io.registers import N_BOOLEAN, N_FLOAT, N_INTEGER, N_PACKED, Registers
from ur_emulator.machine.controller.io.watchdogs import Watchdogs
from ur_emulator.machine.controller.safety.speed_scaling import SpeedScaling

_WORD = 32
# Registers by the name of their variable: (kind of memory, first register, how many).
_REGISTERS: dict[str, tuple[str, int, int]] = {
    "input_bit_registers0_to_31": ("booleans", 0, _WORD),
    "input_bit_registers32_to_63": ("booleans", _WORD, _WORD),
    **{f"input_bit_register_{i}": ("booleans", i, 1) for i in range(N_PACKED, N_BOOLEAN)},
    **{f"input_int_register_{i}": ("integers", i, 1) for i in range(N_INTEGER)},
    **{f"input_double_register_{i}": ("floats", i, 1) for i in range(N_FLOAT)},
}


class ClientInputs:
    """Writes variables into the parts of the box that they are for, and keeps the values of the others."""

    def __init__(
        self, io: InputOutput, registers: Registers, speed: SpeedScaling, watchdogs: Watchdogs, clock: Clock
    ) -> None:
        self.io = io
        self.speed = speed
        self._registers = registers.inputs
        self._watchdogs = watchdogs
        self._clock = clock
        self._values: dict[str, Any] = {}

    def get(self, name: str, default: Any) -> Any:
        """Return the last value of a variable that is not a register; `default` before the first."""
        return self._values.get(name, default)

    def write(self, values: Iterable[tuple[str, Any]]) -> None:
        """Write variables, in order: names and values of the types of `protocol.rtde.fields.INPUTS`."""
        acts: dict[Callable[[ClientInputs], None], None] = {}
        values = tuple(values)
        if self._watchdogs:
            self._watchdogs.written((name for name, _ in values), self._clock.tick)
        for name, value in values:
            register = _REGISTERS.get(name)
            if register is None:
                self._values[name] = value
                acts[_ACTS[name]] = None
                continue
            kind, first, count = register
            memory = getattr(self._registers, kind)
            if count == 1:
                memory[first] = value
            else:
                for bit in range(count):
                    memory[first + bit] = bool(value >> bit & 1)
        for act in acts:
            act(self)


def _digital_outputs(group: DigitalGroup) -> Callable[[ClientInputs], None]:
    mask_name, value_name = f"{group.name}_digital_output_mask", f"{group.name}_digital_output"

    def act(inputs: ClientInputs) -> None:
        mask = inputs.get(mask_name, 0) << group.first & group.mask
        inputs.io.write_digital_outputs(inputs.get(value_name, 0) << group.first, mask)

    return act


def _set_analog_outputs(inputs: ClientInputs) -> None:
    mask = inputs.get("standard_analog_output_mask", 0)
    domains = inputs.get("standard_analog_output_type", 0)
    for i, line in enumerate(inputs.io.analog_out):
        if mask >> i & 1:
            line.domain = domains >> i & 1
            line.set_ratio(inputs.get(f"standard_analog_output_{i}", 0.0))


def _set_speed_slider(inputs: ClientInputs) -> None:
    fraction = inputs.get("speed_slider_fraction", math.nan)
    if inputs.get("speed_slider_mask", 0) and math.isfinite(fraction):
        inputs.speed.slider = min(1.0, max(0.0, fraction))


# What a write to a variable that is not a register does.
_ACTS: dict[str, Callable[[ClientInputs], None]] = {
    "speed_slider_mask": _set_speed_slider,
    "speed_slider_fraction": _set_speed_slider,
    "standard_analog_output_mask": _set_analog_outputs,
    "standard_analog_output_type": _set_analog_outputs,
    "standard_analog_output_0": _set_analog_outputs,
    "standard_analog_output_1": _set_analog_outputs,
    "external_force_torque": lambda inputs: None,  # only kept: a script can enable its use
}
for _name, _group in DIGITAL_GROUPS.items():
    _ACTS[f"{_name}_digital_output_mask"] = _ACTS[f"{_name}_digital_output"] = _digital_outputs(_group)
