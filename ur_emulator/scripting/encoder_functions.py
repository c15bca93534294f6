"""Builtins for the conveyor encoders, and their old forms for the first one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ur_emulator.controller.io.encoders import PULSE_INPUTS, RANGES, Decoder, Encoders
from ur_emulator.controller.io.lines import InputOutput
from urscript.errors import ScriptRuntimeError
from urscript.values import wrap_int

# The encoder of the old forms.
_CONVEYOR = 0


def encoder_functions(encoders: Encoders, io: InputOutput) -> Mapping[str, Callable[..., Any]]:
    """Return the encoder builtins."""

    def pin(number: float) -> int:
        bit = PULSE_INPUTS.get(int(number))
        if bit is None:
            allowed = ", ".join(map(str, PULSE_INPUTS))
            raise ScriptRuntimeError(
                f"digital input {number:g} cannot take encoder pulses; allowed: {allowed}"
            )
        return bit

    def enable_pulse_decode(thread: object, index: float, decoder: float, a: float, b: float) -> None:
        encoders.decode(int(index), Decoder(int(decoder)), pin(a), pin(b), io.digital_in)

    def enable_set_tick_count(thread: object, index: float, range_id: float) -> None:
        encoders.feed(int(index), int(range_id))

    def set_tick_count(thread: object, index: float, count: float) -> None:
        encoder = encoders.encoders[int(index)]
        if not encoder.is_fed:
            raise ScriptRuntimeError(
                f"encoder {index:g} does not take counts, call encoder_enable_set_tick_count first"
            )
        low, size = RANGES[encoder.range_id]
        if not low <= count < low + size:
            raise ScriptRuntimeError(
                f"encoder count {count:g} is out of range; allowed: {low} to {low + size - 1}"
            )
        encoder.set_count(float(count))

    def get_tick_count(thread: object, index: float, opt: str = "") -> float:
        count = encoders.encoders[int(index)].count
        if opt not in ("", "raw"):
            raise ScriptRuntimeError(
                f'encoder_get_tick_count: opt "{opt}" does not exist; allowed: "" and "raw"'
            )
        return wrap_int(int(count)) if opt else count

    def unwind(thread: object, index: float, delta: float) -> float | None:
        encoder = encoders.encoders[int(index)]
        return encoder.unwind(float(delta)) if encoder.is_enabled else None

    def set_conveyor(thread: object, count: float, resolution: float) -> None:
        if resolution not in RANGES:
            raise ScriptRuntimeError(
                f"set_conveyor_tick_count: resolution {resolution:g} does not exist; allowed: 0 to 4"
            )
        encoder = encoders.encoders[_CONVEYOR]
        if not encoder.is_fed or encoder.range_id != resolution:
            encoders.feed(_CONVEYOR, int(resolution))
        set_tick_count(thread, _CONVEYOR, count)

    return {
        "encoder_enable_pulse_decode": enable_pulse_decode,
        "encoder_enable_set_tick_count": enable_set_tick_count,
        "encoder_set_tick_count": set_tick_count,
        "encoder_get_tick_count": get_tick_count,
        "encoder_unwind_delta_tick_count": unwind,
        "conveyor_pulse_decode": lambda thread, kind, a, b: enable_pulse_decode(
            thread, _CONVEYOR, kind, a, b
        ),
        "get_conveyor_tick_count": lambda thread: encoders.encoders[_CONVEYOR].count,
        "set_conveyor_tick_count": set_conveyor,
    }
