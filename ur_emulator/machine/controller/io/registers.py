"""General purpose registers of the controller: booleans, integers and floats; memory of its Modbus map.

Ranges: 128 booleans, 48 integers, 48 floats in each direction; the lower part is meant for fieldbuses, the
upper for RTDE clients. Registers keep their values when programs end. Source: UR RTDE guide; URScript manual
CB3 3.15, read_input_boolean_register and related builtins.
"""

from collections.abc import Iterable
from typing import NamedTuple, SupportsIndex, TypeVar

from urscript.values import INT_MAX, INT_MIN, wrap_int

N_BOOLEAN = 128
N_INTEGER = 48
N_FLOAT = 48
# Booleans below this are published in words of so many bits each.
N_PACKED = 64
_WORD = 32

T = TypeVar("T")


class RegisterMemory(list[T]):
    """Registers of one kind.

    Most cycles write none, so what is published is only copied again after a write.
    """

    __slots__ = ("copy_made",)

    def __init__(self, cells: Iterable[T]) -> None:
        super().__init__(cells)
        self.copy_made: tuple[T, ...] | None = None

    def __setitem__(self, index: SupportsIndex, value: T) -> None:  # type: ignore[override]
        super().__setitem__(index, value)
        self.copy_made = None

    def frozen(self) -> tuple[T, ...]:
        """Return the present values."""
        if self.copy_made is None:
            self.copy_made = tuple(self)
        return self.copy_made


class IntegerMemory(RegisterMemory[int]):
    """Integer registers hold 32 bits; what is larger wraps as in the language."""

    __slots__ = ()

    def __setitem__(self, index: SupportsIndex, value: int) -> None:  # type: ignore[override]
        super().__setitem__(index, value if INT_MIN <= value <= INT_MAX else wrap_int(value))


class RegisterBank:
    """One direction of registers, all starting at zero."""

    __slots__ = ("_words", "booleans", "floats", "integers")

    def __init__(self) -> None:
        self.booleans = RegisterMemory([False] * N_BOOLEAN)
        self.integers = IntegerMemory([0] * N_INTEGER)
        self.floats = RegisterMemory([0.0] * N_FLOAT)
        self._words = (0, 0)

    def words(self) -> tuple[int, int]:
        """Return the lower booleans packed, the first one in the lowest bit of the first word."""
        if self.booleans.copy_made is None:
            bits = self.booleans[:N_PACKED]
            value = sum(1 << i for i, bit in enumerate(bits) if bit)
            self._words = (value & (1 << _WORD) - 1, value >> _WORD)
        return self._words


class RegisterValues(NamedTuple):
    """All registers at the end of a cycle, frozen."""

    input_words: tuple[int, int]
    input_booleans: tuple[bool, ...]
    input_integers: tuple[int, ...]
    input_floats: tuple[float, ...]
    output_words: tuple[int, int]
    output_booleans: tuple[bool, ...]
    output_integers: tuple[int, ...]
    output_floats: tuple[float, ...]


class Registers:
    """Inputs are written by clients and read by scripts; outputs vice versa."""

    __slots__ = ("_memories", "_values", "inputs", "outputs")

    def __init__(self) -> None:
        self.inputs = RegisterBank()
        self.outputs = RegisterBank()
        self._memories: tuple[RegisterMemory[bool] | RegisterMemory[int] | RegisterMemory[float], ...] = (
            self.inputs.booleans,
            self.inputs.integers,
            self.inputs.floats,
            self.outputs.booleans,
            self.outputs.integers,
            self.outputs.floats,
        )
        self._values = self._freeze()

    def values(self) -> RegisterValues:
        """Return the present values; the same object as long as nothing is written."""
        for memory in self._memories:
            if memory.copy_made is None:
                self._values = self._freeze()
                break
        return self._values

    def _freeze(self) -> RegisterValues:
        inputs, outputs = self.inputs, self.outputs
        return RegisterValues(
            inputs.words(),  # before the booleans, whose copy says that they are packed already
            inputs.booleans.frozen(),
            inputs.integers.frozen(),
            inputs.floats.frozen(),
            outputs.words(),
            outputs.booleans.frozen(),
            outputs.integers.frozen(),
            outputs.floats.frozen(),
        )


# General purpose words, for scripts and Modbus clients. Source: UR "Modbus server" article.
FIRST_GENERAL = 128
N_GENERAL = 128


class MapMemory:
    """What of the robot's Modbus map is no other part of the box: words 0 to 65535, the latched clock."""

    __slots__ = ("latched_tick", "version", "words")

    def __init__(self, version: tuple[int, int]) -> None:
        self.version = version
        self.words = [0] * N_GENERAL
        self.latched_tick = 0
