"""Lists, poses and matrices at run time: literals, reading an element, storing one.

Storing makes a new value and does not change the old one, because values are passed by value.
"""

from __future__ import annotations

from typing import Any

from urscript import dialect
from urscript.errors import ScriptRuntimeError
from urscript.run.variables import same_kind
from urscript.values import Matrix, Pose, a_type, is_number, type_name


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
        if not _are_alike(items[0], item):
            raise ScriptRuntimeError(
                f"all elements of a list must have one type, got {type_name(items[0])} and {type_name(item)}"
            )
    return items


def _are_alike(a: Any, b: Any) -> bool:
    """Whether two values may be elements of one list."""
    return type(a) is type(b) or (a is not None and b is not None and same_kind(type(a), b))


def make_pose(*items: Any) -> Pose:
    """The value of a pose literal."""
    for item in items:
        if not is_number(item):
            raise ScriptRuntimeError(f"a pose holds numbers only, got {a_type(item)}")
    return Pose(*items)


def _position(index: Any, length: int) -> int:
    """`index` as a position in something of `length` elements."""
    if dialect.INDEX_TAKES_WHOLE_FLOATS and type(index) is float and index.is_integer():
        index = int(index)
    if type(index) is not int:
        raise ScriptRuntimeError(f"an index must be an integer, got {a_type(index)}")
    if not 0 <= index < length:
        if length == 0:
            raise ScriptRuntimeError(f"index {index} is out of range: the list is empty")
        raise ScriptRuntimeError(f"index {index} is out of range; allowed: 0 to {length - 1}")
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
    raise ScriptRuntimeError(f"{a_type(target)} has no elements")


def cell(target: Any, row: Any, column: Any) -> Any:
    """`target[row, column]` of a matrix."""
    if type(target) is not Matrix:
        raise ScriptRuntimeError(f"[row, column] needs a matrix, got {a_type(target)}")
    rows, columns = target.shape
    return target.rows[_position(row, rows)][_position(column, columns)]


def store_item(value: Any, index: Any, target: Any) -> Any:
    """The new value of `target` in `target[index] = value`; the old one does not change."""
    kind = type(target)
    if kind is list:
        place = _position(index, len(target))
        if not _are_alike(target[place], value):
            raise ScriptRuntimeError(f"cannot store {a_type(value)} in a list of {type_name(target[place])}")
        changed = target.copy()
        changed[place] = value
        return changed
    if kind is Pose:
        place = _position(index, 6)
        if not is_number(value):
            raise ScriptRuntimeError(f"a pose holds numbers only, got {a_type(value)}")
        return target.with_item(place, value)
    if kind is Matrix:
        raise ScriptRuntimeError("a matrix needs a row and a column: m[row, column] = value")
    raise ScriptRuntimeError(f"{a_type(target)} has no elements to assign to")


def store_cell(value: Any, row: Any, column: Any, target: Any) -> Any:
    """The new value of `target` in `target[row, column] = value`."""
    if type(target) is not Matrix:
        raise ScriptRuntimeError(f"[row, column] needs a matrix, got {a_type(target)}")
    rows, columns = target.shape
    return target.with_item(_position(row, rows), _position(column, columns), value)
