"""The operators at run time: arithmetic, comparison, conditions.

The compiler calls these where the types are not known statically; for known numbers or booleans it emits the
Python operator. The common case, two numbers, comes first in each function. Undocumented behaviour is decided
in `dialect`.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from math import fmod, isfinite, nan
from typing import Any

from urscript import dialect
from urscript.errors import ScriptRuntimeError
from urscript.run.variables import same_kind
from urscript.values import (
    INT_MAX,
    INT_MIN,
    CapacityList,
    Matrix,
    Pose,
    Struct,
    a_type,
    is_number,
    type_name,
    wrap_int,
)

# --- arithmetic ----------------------------------------------------------------------------------------


def add(a: Any, b: Any) -> Any:
    """`a + b`: numbers, strings, lists by element, matrices of equal shape."""
    ta, tb = type(a), type(b)
    if ta is int and tb is int:
        result = a + b
        return result if INT_MIN <= result <= INT_MAX else wrap_int(result)
    if (ta is float or ta is int) and (tb is float or tb is int):
        return a + b
    if ta is str and tb is str:
        if len(a) + len(b) > dialect.LONGEST_STRING:
            raise ScriptRuntimeError(
                f"a string of {len(a) + len(b)} characters; allowed: up to {dialect.LONGEST_STRING}"
            )
        return a + b
    return _elementwise("+", add, a, b)


def sub(a: Any, b: Any) -> Any:
    """`a - b`."""
    ta, tb = type(a), type(b)
    if ta is int and tb is int:
        result = a - b
        return result if INT_MIN <= result <= INT_MAX else wrap_int(result)
    if (ta is float or ta is int) and (tb is float or tb is int):
        return a - b
    return _elementwise("-", sub, a, b)


def mul(a: Any, b: Any) -> Any:
    """`a * b`; two matrices, or a matrix and a list, multiply as in algebra."""
    ta, tb = type(a), type(b)
    if ta is int and tb is int:
        result = a * b
        return result if INT_MIN <= result <= INT_MAX else wrap_int(result)
    if (ta is float or ta is int) and (tb is float or tb is int):
        return a * b
    if ta is Matrix and (tb is Matrix or isinstance(b, list)):
        return _matrix_product(a, b)
    return _elementwise("*", mul, a, b)


def div(a: Any, b: Any) -> Any:
    """`a / b`: always real division."""
    ta, tb = type(a), type(b)
    if (ta is float or ta is int) and (tb is float or tb is int):
        if b == 0:
            raise ScriptRuntimeError("division by zero")
        if dialect.EXACT_DIVISION_GIVES_INT and ta is int and tb is int and a % b == 0:
            return a // b
        return a / b
    return _elementwise("/", div, a, b)


def mod(a: Any, b: Any) -> Any:
    """`a % b`: the remainder has the sign of `a`."""
    ta, tb = type(a), type(b)
    if (ta is float or ta is int) and (tb is float or tb is int):
        if b == 0:
            raise ScriptRuntimeError("modulo by zero")
        if dialect.MODULO_SIGN == "divisor":
            return a % b
        if ta is int and tb is int:
            rest = abs(a) % abs(b)
            return -rest if a < 0 else rest
        # As in C; Python's fmod refuses an infinite dividend.
        return fmod(a, b) if isfinite(a) else nan
    return _elementwise("%", mod, a, b)


def neg(a: Any) -> Any:
    """`-a`; of a list by element."""
    kind = type(a)
    if kind is float:
        return -a
    if kind is int:
        return wrap_int(-a)
    if isinstance(a, list):
        return [neg(item) for item in a]
    if kind is Matrix:
        return Matrix([neg(item) for item in row] for row in a.rows)
    if is_number(a):
        return neg(_to_builtin(a))
    raise ScriptRuntimeError(f"a sign needs a number, a list or a matrix of numbers, got {a_type(a)}")


def pos(a: Any) -> Any:
    """`+a`: the value itself, for whatever can be negated."""
    neg(a)
    return a


def without_arrays(sign: str, compute: Callable[..., Any]) -> Callable[..., Any]:
    """An arithmetic operator of software in which it takes numbers and strings only."""

    def operate(*operands: Any) -> Any:
        if any(isinstance(operand, (list, Matrix)) for operand in operands):
            names = " and ".join(map(type_name, operands))
            raise ScriptRuntimeError(f"'{sign}' is not defined for {names} in this software version")
        return compute(*operands)

    return operate


def _to_builtin(value: Any) -> Any:
    """A number of a subclass (of numpy, an enum) as int or float."""
    return float(value) if isinstance(value, float) else int(value)


def _elementwise(sign: str, one: Callable[[Any, Any], Any], a: Any, b: Any) -> Any:
    """Operators on lists and matrices, element by element; anything else is an error.

    Source: script manual 3.15.4, array and matrix arithmetic.
    """
    if isinstance(a, list) and isinstance(b, list):
        if len(a) != len(b):
            raise ScriptRuntimeError(f"'{sign}' needs lists of equal length, got {len(a)} and {len(b)}")
        return [one(x, y) for x, y in zip(a, b, strict=True)]
    if isinstance(a, list) and is_number(b):
        return [one(x, b) for x in a]
    if is_number(a) and isinstance(b, list):
        return [one(a, y) for y in b]
    if type(a) is Matrix and is_number(b):
        return Matrix([one(x, b) for x in row] for row in a.rows)
    if is_number(a) and type(b) is Matrix:
        return Matrix([one(a, y) for y in row] for row in b.rows)
    if sign in "+-" and type(a) is Matrix and type(b) is Matrix:
        if a.shape != b.shape:
            raise ScriptRuntimeError(f"'{sign}' needs matrices of equal shape, got {_size(a)} and {_size(b)}")
        pairs = zip(a.rows, b.rows, strict=True)
        return Matrix([one(x, y) for x, y in zip(left, right, strict=True)] for left, right in pairs)
    if is_number(a) and is_number(b):
        return one(_to_builtin(a), _to_builtin(b))
    raise ScriptRuntimeError(f"'{sign}' is not defined for {type_name(a)} and {type_name(b)}")


def _size(matrix: Matrix) -> str:
    rows, columns = matrix.shape
    return f"{rows} x {columns}"


def _matrix_product(a: Matrix, b: Matrix | list[Any]) -> Matrix | list[Any]:
    inner = a.shape[1]
    height = len(b)
    if inner != height:
        raise ScriptRuntimeError(f"'*' needs {inner} rows on the right side, got {height}")
    if isinstance(b, Matrix):
        columns = list(zip(*b.rows, strict=True))
        return Matrix([_dot(row, column) for column in columns] for row in a.rows)
    return [_dot(row, b) for row in a.rows]


def _dot(row: tuple[Any, ...], column: tuple[Any, ...] | list[Any]) -> Any:
    total: Any = 0
    for x, y in zip(row, column, strict=True):
        total = add(total, mul(x, y))
    return total


# --- comparison and conditions -------------------------------------------------------------------------


def equal(a: Any, b: Any) -> bool:
    """`a == b`: one bool, also for lists and poses; different types are unequal."""
    ta, tb = type(a), type(b)
    if ta is tb:
        if ta is list or ta is Pose or ta is CapacityList:
            # Python's own comparison takes True for 1, and a NaN for equal to itself.
            return a == b and all(map(equal, a, b))
        if ta is Struct:
            members = list(a.members) == list(b.members)
            return members and all(map(equal, a.members.values(), b.members.values()))
        return bool(a == b)
    if ta is bool or tb is bool:
        return False
    if (ta is int or ta is float) and (tb is int or tb is float):
        return bool(a == b)
    if is_number(a) and is_number(b):
        return bool(a == b)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(equal, a, b))
    if dialect.MIXED_TYPES_COMPARE or a is None or b is None or same_kind(ta, b):
        return False
    raise ScriptRuntimeError(f"cannot compare {a_type(a)} with {a_type(b)}")


def unequal(a: Any, b: Any) -> bool:
    """`a != b`."""
    return not equal(a, b)


def _ordering(sign: str, compare: Callable[[Any, Any], bool]) -> Callable[[Any, Any], bool]:
    def ordered(a: Any, b: Any) -> bool:
        ta, tb = type(a), type(b)
        if (ta is float or ta is int) and (tb is float or tb is int):
            return compare(a, b)
        a, b = getattr(a, "thread_id", a), getattr(b, "thread_id", b)
        if is_number(a) and is_number(b):
            return bool(compare(a, b))
        raise ScriptRuntimeError(f"'{sign}' compares numbers, got {type_name(a)} and {type_name(b)}")

    return ordered


less = _ordering("<", operator.lt)
less_equal = _ordering("<=", operator.le)
greater = _ordering(">", operator.gt)
greater_equal = _ordering(">=", operator.ge)


def truth(value: Any) -> bool:
    """A condition: a bool, a number that is not 0, or a string that is not empty; see `dialect`."""
    if value is True or value is False:
        return bool(value)
    if type(value) is str:
        return value != ""
    if dialect.NUMBER_AS_CONDITION and (type(value) is float or type(value) is int):
        return bool(value != 0)
    raise ScriptRuntimeError(f"a condition must be True or False, got {a_type(value)}")
