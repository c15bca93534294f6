"""General purpose registers of the controller: booleans, integers and floats, inputs and outputs apart.

Ranges: 128 booleans, 48 integers, 48 floats each way; the lower part is meant for fieldbuses, the upper for
RTDE clients. Registers live as long as the controller does: programs come and go over them.
Source: UR RTDE guide; URScript manual CB3 3.15, read_input_boolean_register and its kin.
"""

from __future__ import annotations

from dataclasses import dataclass, field

N_BOOLEAN = 128
N_INTEGER = 48
N_FLOAT = 48


@dataclass(slots=True)
class RegisterBank:
    """One direction of registers, all starting at zero."""

    booleans: list[bool] = field(default_factory=lambda: [False] * N_BOOLEAN)
    integers: list[int] = field(default_factory=lambda: [0] * N_INTEGER)
    floats: list[float] = field(default_factory=lambda: [0.0] * N_FLOAT)


@dataclass(slots=True)
class Registers:
    """Inputs are written by clients and read by scripts; outputs the other way round."""

    inputs: RegisterBank = field(default_factory=RegisterBank)
    outputs: RegisterBank = field(default_factory=RegisterBank)
