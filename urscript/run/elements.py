"""Lists, poses, matrices and structs at run time: literals, reading an element or member, storing one.

Storing makes a new value and does not change the old one, because values are passed by value.
"""

from __future__ import annotations

from typing import Any

from urscript import dialect
from urscript.errors import ScriptRuntimeError
from urscript.run.variables import capacity_of, fitted, same_kind, same_type
from urscript.values import Matrix, Pose, Struct, a_type, is_number, list_with_capacity, type_name

Step = str | tuple[Any, ...]
"""From a value to one in it: the name of a member, an index, or row and column."""


def make_list(items: list[Any]) -> Any:
    """The value of a list literal: a list of one kind of values, or a matrix when it holds lists."""
    if not items:
        return items
    if all(map(is_number, items)):
        return items
    if isinstance(items[0], list):
        if all(isinstance(item, list) for item in items):
            return Matrix(items)
        raise ScriptRuntimeError("a matrix needs a list in every row")
    if type(items[0]) is Matrix:
        raise ScriptRuntimeError("a matrix has two dimensions, not three")
    for item in items:
        if not _are_alike(items[0], item):
            raise ScriptRuntimeError(
                f"all elements of a list must have one type, got {type_name(items[0])} and {type_name(item)}"
            )
    return items


def _are_alike(a: Any, b: Any) -> bool:
    """Whether two values may be elements of one list."""
    if type(a) is Struct:
        return same_type(a, b)
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
    """`target[index]` of a list, pose or struct."""
    kind = type(target)
    if kind is list or kind is Pose:
        if type(index) is int and 0 <= index < len(target):
            return target[index]
        return target[_position(index, len(target))]
    if kind is Matrix:
        raise ScriptRuntimeError("a matrix needs a row and a column: m[row, column]")
    if isinstance(target, list):
        return target[_position(index, len(target))]
    if kind is Struct:
        return target.members[_member_at(target, index)]
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
    if isinstance(target, list):
        place = _position(index, len(target))
        old = target[place]
        if not _are_alike(old, value):
            raise not_an_element(value, old)
        changed = target.copy()
        changed[place] = fitted(value, old, "element", str(place)) if type(old) is Struct else value
        return changed if kind is list else list_with_capacity(changed, capacity_of(target), old)
    if kind is Pose:
        place = _position(index, 6)
        if not is_number(value):
            raise ScriptRuntimeError(f"a pose holds numbers only, got {a_type(value)}")
        return target.with_item(place, value)
    if kind is Matrix:
        raise ScriptRuntimeError("a matrix needs a row and a column: m[row, column] = value")
    if kind is Struct:
        return store_member(value, _member_at(target, index), target)
    raise ScriptRuntimeError(f"{a_type(target)} has no elements to assign to")


def store_cell(value: Any, row: Any, column: Any, target: Any) -> Any:
    """The new value of `target` in `target[row, column] = value`."""
    if type(target) is not Matrix:
        raise ScriptRuntimeError(f"[row, column] needs a matrix, got {a_type(target)}")
    rows, columns = target.shape
    return target.with_item(_position(row, rows), _position(column, columns), value)


def not_an_element(value: Any, sample: Any) -> ScriptRuntimeError:
    """The error for a value that has another type than `sample`, an element of the list."""
    if type(value) is type(sample) is Struct:
        theirs, its = ", ".join(sample.members), ", ".join(value.members)
        how = " with members of other types" if its == theirs else ""
        return ScriptRuntimeError(f"cannot store a struct of {its} in a list of structs of {theirs}{how}")
    return ScriptRuntimeError(f"cannot store {a_type(value)} in a list of {type_name(sample)}")


def member(target: Any, name: str) -> Any:
    """`target.name` of a struct."""
    return _struct_with(target, name, "").members[name]


def store_member(value: Any, name: str, target: Any) -> Struct:
    """The new value of `target` in `target.name = value`: the type of a member stays."""
    struct = _struct_with(target, name, " to assign to")
    return struct.with_member(name, fitted(value, struct.members[name], "member", name))


def _struct_with(target: Any, name: str, purpose: str) -> Struct:
    if type(target) is not Struct:
        raise ScriptRuntimeError(f"{a_type(target)} has no member '{name}'{purpose}")
    if name not in target.members:
        raise ScriptRuntimeError(
            f"the struct has no member '{name}'{purpose}; it has {', '.join(target.members)}"
        )
    return target


def _member_at(target: Struct, index: Any) -> str:
    return list(target.members)[_position(index, len(target.members))]


def inside(target: Any, step: Step) -> Any:
    """The value that is a step inside `target`."""
    if isinstance(step, str):
        return member(target, step)
    return item(target, *step) if len(step) == 1 else cell(target, *step)


def store_inside(value: Any, steps: list[Step], target: Any) -> Any:
    """The new value of `target` when `value` is stored so many steps inside it."""
    holders = [target]
    for step in steps[:-1]:
        holders.append(inside(holders[-1], step))
    for step, holder in zip(reversed(steps), reversed(holders), strict=True):
        if isinstance(step, str):
            value = store_member(value, step, holder)
        elif len(step) == 1:
            value = store_item(value, step[0], holder)
        else:
            value = store_cell(value, step[0], step[1], holder)
    return value
