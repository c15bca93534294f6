"""Builtins that programs exported from an e-Series begin with, for boxes that report its software version.

The tool's connector has no serial line and no switchable outputs here: its settings are checked and kept.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from ur_emulator.controller.tool_settings import ToolSettings
from ur_emulator.models.robot_model import six
from urscript.errors import ScriptRuntimeError

# Bits per second of the tool's serial line. Source: URScript manual e-Series, set_tool_communication.
BAUD_RATES: Final = (9600, 19200, 38400, 57600, 115200, 1_000_000, 2_000_000, 5_000_000)
# Largest moment of inertia [kg m^2]. Source: URScript manual e-Series, set_target_payload.
MAX_INERTIA: Final = 133.0


def e_series_functions(
    tool: ToolSettings, set_payload: Callable[[object, float, Any], None]
) -> Mapping[str, Callable[..., Any]]:
    """Return the builtins.

    Args:
        tool: gets the inertia of the payload.
        set_payload: the builtin that takes mass and centre of gravity.
    """

    def set_tool_communication(thread: object, enabled: bool, baud_rate: int, *line: float) -> None:
        if baud_rate not in BAUD_RATES:
            allowed = ", ".join(map(str, BAUD_RATES))
            raise ScriptRuntimeError(
                f"set_tool_communication: baud rate {baud_rate} is not supported; allowed: {allowed}"
            )

    def keep(thread: object, *setting: int) -> None:
        """Accept a setting without effect; the catalogue checks its range."""

    def set_target_payload(thread: object, m: float, cog: Any, inertia: Any, *transition: float) -> None:
        if (
            len(inertia) != 6
            or not all(abs(moment) <= MAX_INERTIA for moment in inertia)
            or min(inertia[:3]) < 0.0
        ):
            raise ScriptRuntimeError(
                f"set_target_payload: inertia must be six moments of inertia up to {MAX_INERTIA:g} kg m^2, "
                "the first three not below 0"
            )
        set_payload(thread, m, cog)
        tool.set_inertia(six(inertia))

    return {
        "set_tool_communication": set_tool_communication,
        "set_tool_output_mode": keep,
        "set_tool_digital_output_mode": keep,
        "set_target_payload": set_target_payload,
    }
