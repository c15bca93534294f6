"""Builtins on the robot's own Modbus map. They act at once, like those for lines."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from ur_emulator.controller.modbus import robot_map
from ur_emulator.controller.modbus.robot_map import MapAddressError
from ur_emulator.controller.state import ControllerState
from urscript.errors import ScriptRuntimeError

_SIGN = 0x8000

T = TypeVar("T")


def port_functions(state: ControllerState) -> Mapping[str, Callable[..., Any]]:
    """Return the builtins for the Modbus map of one controller, whose whole state it shows.

    What can only be read ignores writes: the manual's own example writes to an input.
    """

    def access(function: Callable[..., T], address: float, *value: int | bool) -> T:
        try:
            return function(state, int(address), *value)
        except MapAddressError as error:
            raise ScriptRuntimeError(str(error)) from None

    def read_port_register(thread: object, address: float) -> int:
        word = access(robot_map.read_register, address)
        return word - 2 * _SIGN if word & _SIGN else word

    def write_port_register(thread: object, address: float, value: float) -> None:
        access(robot_map.write_register, address, int(value))

    def write_port_bit(thread: object, address: float, value: bool) -> None:
        access(robot_map.write_coil, address, value)

    return {
        "read_port_bit": lambda thread, address: access(robot_map.read_coil, address),
        "read_port_register": read_port_register,
        "write_port_bit": write_port_bit,
        "write_port_register": write_port_register,
    }
