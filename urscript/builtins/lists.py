"""Builtins on lists and matrices: lengths, norms, transpose, inverse, bits.

Values are never changed in place; every result is new. Source: script manual CB3 3.15.4, module urmath.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from urscript.builtins.poses import pose_inv
from urscript.catalogue.calls import integer, numbers, type_error
from urscript.catalogue.types import ParamType
from urscript.dialect import LONGEST_LIST
from urscript.errors import ScriptRuntimeError
from urscript.values import Matrix, Pose, Struct, a_type, is_number, list_with_capacity, wrap_int

_WORD = 32


def norm(a: Any) -> float:
    """Absolute value of a number (an int stays int), Euclidean length of a list or of all six of a pose."""
    if type(a) is int:
        return wrap_int(abs(a))
    if is_number(a):
        return abs(a)  # type: ignore[no-any-return]
    if type(a) is Pose or (isinstance(a, list) and all(map(is_number, a))):
        return math.hypot(*a)
    raise type_error("norm", "a", ParamType.NORMED, a)


def normalize(v: Any) -> list[float]:
    """The unit vector in the direction of v.

    Raises:
        ScriptRuntimeError: the sum of the squares is zero.
    """
    values = numbers("normalize", "v", v)
    square = sum(value * value for value in values)
    if square == 0:
        raise ScriptRuntimeError("normalize: the sum of all squared elements is zero")
    length = math.sqrt(square)
    return [value / length for value in values]


def length(v: Any) -> int:
    """Number of elements of a list or pose, or of bytes of a string."""
    if isinstance(v, (list, str, Pose)):
        return len(v)
    raise type_error("length", "v", ParamType.SIZED, v)


def get_list_length(v: Any) -> int:
    """Number of elements of a list or pose."""
    if isinstance(v, (list, Pose)):
        return len(v)
    raise type_error("get_list_length", "v", ParamType.ARRAY, v)


def size(v: Any) -> int | list[int]:
    """[rows, columns] of a matrix, else the number of elements or bytes."""
    if isinstance(v, Matrix):
        return list(v.shape)
    if isinstance(v, (list, str, Pose)):
        return len(v)
    raise type_error("size", "v", ParamType.SHAPED, v)


def transpose(m: Any) -> Matrix | list[Any]:
    """Rows become columns; a list becomes a column matrix, and a column matrix becomes a list."""
    if isinstance(m, Matrix):
        if m.shape[1] == 1:
            return [row[0] for row in m.rows]
        return Matrix(list(zip(*m.rows, strict=True)))
    return Matrix([[value] for value in numbers("transpose", "m", m, ParamType.LIST_OR_MATRIX)])


def inv(m: Any) -> Matrix | Pose:
    """Inverse of a pose or of a square, non-singular matrix."""
    if type(m) is Pose:
        return pose_inv(m, "inv")
    if not isinstance(m, Matrix):
        raise type_error("inv", "m", ParamType.POSE_OR_MATRIX, m)
    rows, columns = m.shape
    if rows != columns or rows == 0:
        raise ScriptRuntimeError(f"inv: the matrix must be square, got {rows} x {columns}")
    array = np.array(m.rows, dtype=np.float64)
    if not np.isfinite(array).all():
        raise ScriptRuntimeError("inv: the matrix must be finite")
    # Rounding hides exact singularity from the inversion itself: ask for the rank first.
    if np.linalg.matrix_rank(array) < rows:
        raise ScriptRuntimeError("inv: the matrix is singular")
    return Matrix(np.linalg.inv(array).tolist())


def integer_to_binary_list(x: Any) -> list[bool]:
    """The 32 bits of an int in two's complement, least significant first."""
    value = integer("integer_to_binary_list", "x", x)
    return [bool(value >> bit & 1) for bit in range(_WORD)]


def binary_list_to_integer(bits: Any) -> int:
    """Signed value of bits, least significant first; missing ones are 0, those after the 32nd are ignored."""
    if not isinstance(bits, list) or not all(type(bit) is bool for bit in bits):
        raise type_error("binary_list_to_integer", "l", ParamType.BOOLS, bits)
    value = sum(1 << place for place, bit in enumerate(bits[:_WORD]) if bit)
    return value - (1 << _WORD) if value >> (_WORD - 1) else value


# --- lists with room and structs; source: e-Series script directory, Lists and Structs ------------------


def make_list(length: Any, initial_value: Any, capacity: Any = None) -> list[Any]:
    """A list of `length` equal elements with room for `capacity` of them, by default for no more.

    Raises:
        ScriptRuntimeError: a length below 0 or above the capacity, a list of lists.
    """
    count = integer("make_list", "length", length)
    most = count if capacity is None else integer("make_list", "capacity", capacity)
    for name, number in (("length", count), ("capacity", most)):
        if not 0 <= number <= LONGEST_LIST:
            raise ScriptRuntimeError(
                f"make_list: Parameter '{name}' must be in the range 0 to {LONGEST_LIST}, got {number}"
            )
    if count > most:
        raise ScriptRuntimeError(f"make_list: a length of {count} exceeds the capacity of {most}")
    if isinstance(initial_value, (list, Matrix)):
        raise ScriptRuntimeError(
            f"make_list: elements must be no lists, got {a_type(initial_value)}; a list of lists is a matrix"
        )
    return list_with_capacity([initial_value] * count, most, initial_value)


def struct(names: tuple[str, ...], *values: Any) -> Struct:
    """A struct of named values; the names are those of the arguments of the call."""
    return Struct(dict(zip(names, values, strict=True)))


FUNCTIONS: dict[str, Callable[..., Any]] = {
    "norm": norm,
    "normalize": normalize,
    "length": length,
    "get_list_length": get_list_length,
    "size": size,
    "transpose": transpose,
    "inv": inv,
    "integer_to_binary_list": integer_to_binary_list,
    "binary_list_to_integer": binary_list_to_integer,
    "make_list": make_list,
    "struct": struct,
}
