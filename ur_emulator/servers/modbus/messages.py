"""What Modbus frames carry, for both roles; no library needed.

Source: Modbus application protocol V1.1b3, sections 6 and 7.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

READ_FUNCTIONS = frozenset((1, 2, 3, 4))
SINGLE_WRITES = frozenset((5, 6))
MULTIPLE_WRITES = frozenset((15, 16))
COIL_FUNCTIONS = frozenset((1, 2, 5, 15))

ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE = 1, 2, 3
"""Codes of the exceptions that a server answers with."""


class Frame(NamedTuple):
    """One frame.

    Attributes:
        transaction: number by which request and answer find each other.
        slave: number of the unit behind the address.
        pdu: function code and data, at least one byte.
    """

    transaction: int
    slave: int
    pdu: bytes


@dataclass(frozen=True, slots=True)
class MapRequest:
    """A request to read from or write to a map of coils and registers.

    Attributes:
        function: 1 to 6, 15 or 16.
        first: lowest address.
        count: how many addresses, at least one, none above 65535.
        values: what to write, 0 or 1 for a coil; empty for a read.
    """

    function: int
    first: int
    count: int
    values: tuple[int, ...]

    @property
    def is_coils(self) -> bool:
        """Whether it is about coils; otherwise about registers."""
        return self.function in COIL_FUNCTIONS

    @property
    def addresses(self) -> range:
        """What it is about."""
        return range(self.first, self.first + self.count)


class RefusedError(Exception):
    """A request that cannot be understood or followed.

    Attributes:
        code: of the exception to answer with.
    """

    def __init__(self, code: int) -> None:
        super().__init__(f"Modbus exception {code}")
        self.code = code
