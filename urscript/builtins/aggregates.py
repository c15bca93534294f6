"""Builtins that make lists with room and structs. Source: e-Series script directory, Lists and Structs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from urscript.dialect import LONGEST_LIST
from urscript.errors import ScriptRuntimeError
from urscript.values import Matrix, Struct, a_type, list_with_capacity

from .arguments import integer


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


FUNCTIONS: dict[str, Callable[..., Any]] = {"make_list": make_list, "struct": struct}
