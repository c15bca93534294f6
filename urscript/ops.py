"""What the operators do at run time: arithmetic, comparison, conditions, elements, assignment.

The compiler calls these where it cannot tell the types; with evident floats or booleans it emits the
Python operator itself. The common case, two numbers, comes first in each function. Choices that no
document settles are named in `dialect`.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from math import fmod
from typing import Any, Final

from urscript import dialect
from urscript.errors import ScriptRuntimeError
from urscript.values import INT_MAX, INT_MIN, Matrix, Pose, is_number, type_name, wrap_int


class _Undefined:
    """The content of a variable that nothing was assigned to yet."""

    script_type = "undefined"

    def __repr__(self) -> str:
        return "UNDEFINED"


UNDEFINED: Final = _Undefined()


def undefined(name: str) -> Any:
    """A variable was read before anything was assigned to it (U: what a controller says)."""
    raise ScriptRuntimeError(f"variable '{name}' is used before a value is assigned to it")


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
        return a + b
    return _spread("+", add, a, b)


def sub(a: Any, b: Any) -> Any:
    """`a - b`."""
    ta, tb = type(a), type(b)
    if ta is int and tb is int:
        result = a - b
        return result if INT_MIN <= result <= INT_MAX else wrap_int(result)
    if (ta is float or ta is int) and (tb is float or tb is int):
        return a - b
    return _spread("-", sub, a, b)


def mul(a: Any, b: Any) -> Any:
    """`a * b`; two matrices, or a matrix and a list, multiply as in algebra."""
    ta, tb = type(a), type(b)
    if ta is int and tb is int:
        result = a * b
        return result if INT_MIN <= result <= INT_MAX else wrap_int(result)
    if (ta is float or ta is int) and (tb is float or tb is int):
        return a * b
    if ta is Matrix and (tb is Matrix or tb is list):
        return _matrix_product(a, b)
    return _spread("*", mul, a, b)


def div(a: Any, b: Any) -> Any:
    """`a / b`: always real division."""
    ta, tb = type(a), type(b)
    if (ta is float or ta is int) and (tb is float or tb is int):
        if b == 0:
            raise ScriptRuntimeError("division by zero")
        if dialect.EXACT_DIVISION_GIVES_INT and ta is int and tb is int and a % b == 0:
            return a // b
        return a / b
    return _spread("/", div, a, b)


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
        try:
            return fmod(a, b)
        except ValueError:
            raise ScriptRuntimeError(f"cannot compute {a} % {b}") from None
    return _spread("%", mod, a, b)


def neg(a: Any) -> Any:
    """`-a`; of a list by element."""
    kind = type(a)
    if kind is float:
        return -a
    if kind is int:
        return wrap_int(-a)
    if kind is list:
        return [neg(item) for item in a]
    if kind is Matrix:
        return Matrix([neg(item) for item in row] for row in a.rows)
    if is_number(a):
        return neg(_plain(a))
    raise ScriptRuntimeError(f"cannot negate a {type_name(a)}")


def pos(a: Any) -> Any:
    """`+a`: the value itself, for whatever can be negated."""
    neg(a)
    return a


def _plain(value: Any) -> Any:
    """A number of some subclass (numpy's, an enum's) as int or float."""
    return float(value) if isinstance(value, float) else int(value)


def _spread(sign: str, one: Callable[[Any, Any], Any], a: Any, b: Any) -> Any:
    """Operators on lists and matrices, element by element; anything else is an error.

    Source: script manual 3.15.4, array and matrix arithmetic.
    """
    if type(a) is list and type(b) is list:
        if len(a) != len(b):
            raise ScriptRuntimeError(f"'{sign}' needs lists of equal length, got {len(a)} and {len(b)}")
        return [one(x, y) for x, y in zip(a, b, strict=True)]
    if type(a) is list and is_number(b):
        return [one(x, b) for x in a]
    if is_number(a) and type(b) is list:
        return [one(a, y) for y in b]
    if type(a) is Matrix and is_number(b):
        return Matrix([one(x, b) for x in row] for row in a.rows)
    if is_number(a) and type(b) is Matrix:
        return Matrix([one(a, y) for y in row] for row in b.rows)
    if sign in "+-" and type(a) is Matrix and type(b) is Matrix and a.shape == b.shape:
        pairs = zip(a.rows, b.rows, strict=True)
        return Matrix([one(x, y) for x, y in zip(left, right, strict=True)] for left, right in pairs)
    if is_number(a) and is_number(b):
        return one(_plain(a), _plain(b))
    raise ScriptRuntimeError(f"'{sign}' is not defined for {type_name(a)} and {type_name(b)}")


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
        return bool(a == b)
    if ta is bool or tb is bool:
        return False
    if (ta is int or ta is float) and (tb is int or tb is float):
        return bool(a == b)
    if is_number(a) and is_number(b):
        return bool(a == b)
    if dialect.MIXED_TYPES_COMPARE or a is None or b is None or _same_kind(ta, b):
        return False
    raise ScriptRuntimeError(f"cannot compare a {type_name(a)} with a {type_name(b)}")


def unequal(a: Any, b: Any) -> bool:
    """`a != b`."""
    return not equal(a, b)


def _ordering(sign: str, compare: Callable[[Any, Any], bool]) -> Callable[[Any, Any], bool]:
    def ordered(a: Any, b: Any) -> bool:
        ta, tb = type(a), type(b)
        if (ta is float or ta is int) and (tb is float or tb is int):
            return compare(a, b)
        if is_number(a) and is_number(b):
            return bool(compare(a, b))
        raise ScriptRuntimeError(f"'{sign}' compares numbers, got {type_name(a)} and {type_name(b)}")

    return ordered


less = _ordering("<", operator.lt)
less_equal = _ordering("<=", operator.le)
greater = _ordering(">", operator.gt)
greater_equal = _ordering(">=", operator.ge)


def truth(value: Any) -> bool:
    """A condition: a bool, or a string that is not empty. Source: script manual, socket_read_line."""
    if value is True or value is False:
        return bool(value)
    if type(value) is str:
        return value != ""
    if dialect.INT_AS_CONDITION and type(value) is int:
        return value != 0
    raise ScriptRuntimeError(f"a condition must be True or False, got a {type_name(value)}")


# --- lists, poses, matrices ----------------------------------------------------------------------------


def make_list(items: list[Any]) -> Any:
    """The value of a list literal: a list of one kind of values, or a matrix when it holds lists."""
    if not items:
        return items
    if all(map(is_number, items)):
        return items
    first = type(items[0])
    if first is list:
        if all(type(item) is list for item in items):
            return Matrix(items)
        raise ScriptRuntimeError("a matrix needs a list in every row")
    if first is Matrix:
        raise ScriptRuntimeError("a matrix has two dimensions, not three")
    for item in items:
        if type(item) is not first:
            raise ScriptRuntimeError(
                f"all elements of a list have one type, got {type_name(items[0])} and {type_name(item)}"
            )
    return items


def make_pose(*items: Any) -> Pose:
    """The value of a pose literal."""
    for item in items:
        if not is_number(item):
            raise ScriptRuntimeError(f"a pose holds numbers only, got a {type_name(item)}")
    return Pose(*items)


def _position(index: Any, length: int) -> int:
    """`index` as a position in something of `length` elements."""
    if dialect.INDEX_TAKES_WHOLE_FLOATS and type(index) is float and index.is_integer():
        index = int(index)
    if type(index) is not int:
        raise ScriptRuntimeError(f"an index must be an integer, got a {type_name(index)}")
    if not 0 <= index < length:
        raise ScriptRuntimeError(f"index {index} is out of range, the valid ones are 0 to {length - 1}")
    return index


def item(target: Any, index: Any) -> Any:
    """`target[index]` of a list or pose."""
    kind = type(target)
    if kind is list or kind is Pose:
        if type(index) is int and 0 <= index < len(target):
            return target[index]
        return target[_position(index, len(target))]
    if kind is Matrix:
        raise ScriptRuntimeError("a matrix needs a row and a column: m[row, column]")
    raise ScriptRuntimeError(f"a {type_name(target)} has no elements")


def cell(target: Any, row: Any, column: Any) -> Any:
    """`target[row, column]` of a matrix."""
    if type(target) is not Matrix:
        raise ScriptRuntimeError(f"[row, column] needs a matrix, got a {type_name(target)}")
    rows, columns = target.shape
    return target.rows[_position(row, rows)][_position(column, columns)]


def store_item(value: Any, index: Any, target: Any) -> Any:
    """What `target` becomes by `target[index] = value`; the old value stays as it is."""
    kind = type(target)
    if kind is list:
        place = _position(index, len(target))
        if not _same_kind(type(target[place]), value):
            raise ScriptRuntimeError(
                f"cannot store a {type_name(value)} in a list of {type_name(target[place])}"
            )
        changed = target.copy()
        changed[place] = value
        return changed
    if kind is Pose:
        place = _position(index, 6)
        if not is_number(value):
            raise ScriptRuntimeError(f"a pose holds numbers only, got a {type_name(value)}")
        return target.with_item(place, value)
    if kind is Matrix:
        raise ScriptRuntimeError("a matrix needs a row and a column: m[row, column] = value")
    raise ScriptRuntimeError(f"a {type_name(target)} has no elements to assign to")


def store_cell(value: Any, row: Any, column: Any, target: Any) -> Any:
    """What `target` becomes by `target[row, column] = value`."""
    if type(target) is not Matrix:
        raise ScriptRuntimeError(f"[row, column] needs a matrix, got a {type_name(target)}")
    rows, columns = target.shape
    return target.with_item(_position(row, rows), _position(column, columns), value)


# --- variables -----------------------------------------------------------------------------------------


def _same_kind(old: type, value: Any) -> bool:
    """Whether a place that held type `old` may receive `value`; int and float are one kind, number."""
    new = type(value)
    if new is old or (dialect.NONE_FITS_EVERY_VARIABLE and (value is None or old is type(None))):
        return True
    if old is int or old is float:
        # A thread handle and the integer 0 stand for each other. Source: driver scripts.
        return (new is not bool and isinstance(value, (int, float))) or hasattr(value, "thread_id")
    return hasattr(old, "thread_id") and new is int


def assign(value: Any, old: Any, name: str) -> Any:
    """What variable `name`, which holds `old`, becomes by `name = value`.

    The first value fixes the type (D), and that of a list its length (see Dialect.list_resize).
    """
    if type(value) is list and type(old) is list:
        if len(value) != len(old):
            raise ScriptRuntimeError("Resizing of 'List' is not supported")
        if old and not _same_kind(type(old[0]), value[0]):
            raise _other_type(name, f"list of {type_name(old[0])}", f"list of {type_name(value[0])}")
        return value
    return assign_resizing(value, old, name)


def assign_resizing(value: Any, old: Any, name: str) -> Any:
    """`assign` where a list may change its length."""
    if old is UNDEFINED or _same_kind(type(old), value):
        return value
    raise _other_type(name, type_name(old), type_name(value))


def _other_type(name: str, old: str, new: str) -> ScriptRuntimeError:
    return ScriptRuntimeError(f"variable '{name}' is a {old}, cannot assign a {new}")
