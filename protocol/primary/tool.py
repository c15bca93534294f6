"""Sub-packages of the robot state about the tool connector, in the form of `primary.layout`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from protocol.primary.framing import SubPackage
from protocol.wire_record import Since, ValueOrigin, since, wire

__all__ = ["ToolCommunicationInfo", "ToolData", "ToolModeInfo"]

_MEASURED, _MODELLED = ValueOrigin.MEASURED, ValueOrigin.MODELLED


@dataclass(frozen=True, slots=True)
class ToolData(SubPackage):
    """Tool connector: analogue inputs, supply, temperature."""

    SUB_TYPE: ClassVar[int] = 2

    analog_input_range2: int = wire("B", "0 current, 1 voltage", origin=_MODELLED)
    analog_input_range3: int = wire("B", "0 current, 1 voltage", origin=_MODELLED)
    analog_input2: float = wire("d", unit="A or V", default=0.0, origin=_MODELLED)
    analog_input3: float = wire("d", unit="A or V", default=0.0, origin=_MODELLED)
    tool_voltage_48v: float = wire("f", unit="V", default=48.0, origin=_MEASURED)
    tool_output_voltage: int = wire("B", "0, 12 or 24", unit="V", origin=_MODELLED)
    tool_current: float = wire("f", unit="A", default=0.0, origin=_MODELLED)
    tool_temperature: float = wire("f", unit="degC", default=25.0, origin=_MEASURED)
    tool_mode: int = wire("B", "JointMode, the tool's subset", default=239, origin=_MODELLED)


@dataclass(frozen=True, slots=True)
class ToolCommunicationInfo(SubPackage):
    """Serial line at the tool, e-Series."""

    SUB_TYPE: ClassVar[int] = 11
    SINCE: ClassVar[Since] = since(None, (5, 0))

    is_enabled: bool = wire("?", default=False, origin=_MODELLED)
    baud_rate: int = wire("i", default=115200, origin=_MODELLED)
    parity: int = wire("i", "0 none, 1 odd, 2 even", origin=_MODELLED)
    stop_bits: int = wire("i", default=1, origin=_MODELLED)
    rx_idle_chars: float = wire("f", default=1.5, origin=_MODELLED)
    tx_idle_chars: float = wire("f", default=3.5, origin=_MODELLED)


@dataclass(frozen=True, slots=True)
class ToolModeInfo(SubPackage):
    """Digital outputs at the tool, e-Series."""

    SUB_TYPE: ClassVar[int] = 12
    SINCE: ClassVar[Since] = since(None, (5, 1))

    output_mode: int = wire("B", "0 digital, 1 dual-pin power", origin=_MODELLED)
    digital_output_mode0: int = wire("B", "1 sinking, 2 sourcing, 3 push-pull", default=1, origin=_MODELLED)
    digital_output_mode1: int = wire("B", "1 sinking, 2 sourcing, 3 push-pull", default=1, origin=_MODELLED)
