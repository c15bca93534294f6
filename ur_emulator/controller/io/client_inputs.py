"""What the input variables of RTDE do in the box. Names and types stand in `protocol.rtde.fields`.

A register is written at once. Variables that act together, a mask and its values, act whenever one of them
is written, with the last values of the others; what a mask leaves out is never looked at, since clients
leave it uninitialised.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

from ur_emulator.controller.io.lines import (
    CONFIGURABLE_SHIFT,
    N_CONFIGURABLE,
    N_STANDARD,
    N_TOOL,
    TOOL_SHIFT,
)
from ur_emulator.controller.io.registers import N_BOOLEAN, N_FLOAT, N_INTEGER, N_PACKED
from ur_emulator.controller.state import ControllerState

_WORD = 32
# Registers by the name of their variable: (kind of memory, first register, how many).
_REGISTERS: dict[str, tuple[str, int, int]] = {
    "input_bit_registers0_to_31": ("booleans", 0, _WORD),
    "input_bit_registers32_to_63": ("booleans", _WORD, _WORD),
    **{f"input_bit_register_{i}": ("booleans", i, 1) for i in range(N_PACKED, N_BOOLEAN)},
    **{f"input_int_register_{i}": ("integers", i, 1) for i in range(N_INTEGER)},
    **{f"input_double_register_{i}": ("floats", i, 1) for i in range(N_FLOAT)},
}


def write_inputs(state: ControllerState, values: Iterable[tuple[str, Any]]) -> None:
    """Write variables, in order.

    Args:
        state: of the controller.
        values: names with values of the types that `protocol.rtde.fields.INPUTS` gives.
    """
    acts: dict[Callable[[ControllerState], None], None] = {}
    values = tuple(values)
    if state.watchdogs:
        state.watchdogs.written((name for name, _ in values), state.tick)
    for name, value in values:
        register = _REGISTERS.get(name)
        if register is None:
            state.client_inputs[name] = value
            acts[_ACTS[name]] = None
            continue
        kind, first, count = register
        memory = getattr(state.registers.inputs, kind)
        if count == 1:
            memory[first] = value
        else:
            for bit in range(count):
                memory[first + bit] = bool(value >> bit & 1)
    for act in acts:
        act(state)


def _digital_group(group: str, shift: int, size: int) -> Callable[[ControllerState], None]:
    mask_name, value_name = f"{group}_digital_output_mask", f"{group}_digital_output"

    def act(state: ControllerState) -> None:
        inputs = state.client_inputs
        mask = (inputs.get(mask_name, 0) & (1 << size) - 1) << shift
        value = inputs.get(value_name, 0) << shift
        state.io.digital_out = state.io.digital_out & ~mask | value & mask

    return act


def _set_analog_outputs(state: ControllerState) -> None:
    inputs = state.client_inputs
    mask = inputs.get("standard_analog_output_mask", 0)
    domains = inputs.get("standard_analog_output_type", 0)
    for i, line in enumerate(state.io.analog_out):
        if mask >> i & 1:
            line.domain = domains >> i & 1
            line.set_ratio(inputs.get(f"standard_analog_output_{i}", 0.0))


def _set_speed_slider(state: ControllerState) -> None:
    fraction = state.client_inputs.get("speed_slider_fraction", math.nan)
    if state.client_inputs.get("speed_slider_mask", 0) and math.isfinite(fraction):
        state.speed_slider = min(1.0, max(0.0, fraction))


def _keep(state: ControllerState) -> None:
    """Nothing acts on the value; it is kept for a script to enable."""


_DIGITAL_GROUPS = (
    ("standard", 0, N_STANDARD),
    ("configurable", CONFIGURABLE_SHIFT, N_CONFIGURABLE),
    ("tool", TOOL_SHIFT, N_TOOL),
)
# What to do when a variable that is no register has been written.
_ACTS: dict[str, Callable[[ControllerState], None]] = {
    "speed_slider_mask": _set_speed_slider,
    "speed_slider_fraction": _set_speed_slider,
    "standard_analog_output_mask": _set_analog_outputs,
    "standard_analog_output_type": _set_analog_outputs,
    "standard_analog_output_0": _set_analog_outputs,
    "standard_analog_output_1": _set_analog_outputs,
    "external_force_torque": _keep,
}
for _group, _shift, _size in _DIGITAL_GROUPS:
    _act = _digital_group(_group, _shift, _size)
    _ACTS[f"{_group}_digital_output_mask"] = _ACTS[f"{_group}_digital_output"] = _act
