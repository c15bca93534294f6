"""Builtins for the tool connector of an e-Series arm, and for the light of its base.

Nothing listens at the tool's serial line here: its settings are kept and reported, and how the outputs drive.
No port shows the light: its settings are checked and have no other effect.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from ur_emulator.controller.io.lines import InputOutput, ToolLine
from urscript.errors import ScriptRuntimeError

# Bits per second of the tool's serial line. Source: URScript manual e-Series, set_tool_communication.
BAUD_RATES: Final = (9600, 19200, 38400, 57600, 115200, 1_000_000, 2_000_000, 5_000_000)


def tool_functions(io: InputOutput) -> Mapping[str, Callable[..., Any]]:
    """Return the builtins for the tool connector and the base light."""

    def set_tool_communication(
        thread: object, enabled: bool, baud_rate: int, parity: int, stop_bits: int, *idle_chars: float
    ) -> None:
        if baud_rate not in BAUD_RATES:
            allowed = ", ".join(map(str, BAUD_RATES))
            raise ScriptRuntimeError(
                f"set_tool_communication: baud rate {baud_rate} is not supported; allowed: {allowed}"
            )
        io.set_tool_line(ToolLine(enabled, int(baud_rate), int(parity), int(stop_bits), *idle_chars))

    def set_pin_mode(thread: object, n: float, mode: float) -> None:
        io.set_tool_output_mode(1 + int(n), int(mode))

    def accept(thread: object, *setting: int) -> None:
        """Accept a setting without effect; the catalogue checks its range."""

    return {
        "set_tool_communication": set_tool_communication,
        "set_tool_output_mode": lambda thread, mode: io.set_tool_output_mode(0, int(mode)),
        "set_tool_digital_output_mode": set_pin_mode,
        "set_baselight_off": accept,
        "set_baselight_iec": accept,
        "set_baselight_solid": accept,
    }
