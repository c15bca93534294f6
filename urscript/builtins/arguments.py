"""Argument checks that the pure builtins share.

Pure functions check their own arguments, so that calls of them need no checks of the catalogue. The texts are
those of the catalogue.
"""

from __future__ import annotations

from typing import Any

from urscript.catalogue.argument_checks import type_error
from urscript.catalogue.types import ParamType
from urscript.errors import ScriptRuntimeError
from urscript.values import INT_MAX, INT_MIN, Pose, is_number


def number(function: str, parameter: str, value: Any) -> float:
    """The argument, if it is an int or a float; raises ScriptRuntimeError otherwise."""
    kind = type(value)
    if kind is float or kind is int or is_number(value):
        return value  # type: ignore[no-any-return]
    raise type_error(function, parameter, ParamType.NUMBER, value)


def integer(function: str, parameter: str, value: Any) -> int:
    """The argument as an int; a float without fraction will do (see dialect: INDEX_TAKES_WHOLE_FLOATS)."""
    if type(value) is int:
        return value
    if isinstance(value, float) and value.is_integer() and INT_MIN <= value <= INT_MAX:
        return int(value)
    raise type_error(function, parameter, ParamType.INT, value)


def string(function: str, parameter: str, value: Any) -> str:
    """The argument, if it is a string."""
    if isinstance(value, str):
        return value
    raise type_error(function, parameter, ParamType.STRING, value)


def pose(function: str, parameter: str, value: Any) -> Pose:
    """The argument, if it is a pose."""
    if type(value) is Pose:
        return value
    raise type_error(function, parameter, ParamType.POSE, value)


def numbers(function: str, parameter: str, value: Any, kind: ParamType = ParamType.NUMBERS) -> list[float]:
    """The argument, if it is a list of numbers: 3 for VECTOR3, 6 or a pose for VECTOR6, else any number."""
    count = {ParamType.VECTOR3: 3, ParamType.VECTOR6: 6}.get(kind)
    if kind is ParamType.VECTOR6 and type(value) is Pose:
        return list(value)
    if isinstance(value, list) and (count is None or len(value) == count) and all(map(is_number, value)):
        return value
    raise type_error(function, parameter, kind, value)


def fit_int(function: str, value: float) -> int:
    """A whole number as a 32-bit int.

    A controller converts by a C cast, arbitrary for numbers out of range; here that is an error.
    """
    if INT_MIN <= value <= INT_MAX:
        return int(value)
    raise ScriptRuntimeError(f"{function}: result {value} does not fit into a 32-bit integer")
