"""Values at run time: of variables, inside lists, poses, matrices and structs, and their methods.

A variable has one type after the first assignment. Values are passed by value, so they do not change in
place: storing an element, or a method that changes a list, makes a new value, which the program stores.
Undocumented behaviour is decided in `dialect`. The manual says when a method fails, the texts are ours.
"""

from collections.abc import Callable, Generator, Mapping, Sequence
from typing import Any, Final

from urscript import values
from urscript.catalogue.calls import CallSignature, compile_fitting, converted, fits
from urscript.catalogue.catalogue import METHODS, method_key
from urscript.catalogue.types import Builtin, ParamType
from urscript.errors import ScriptRuntimeError, ScriptTypeError
from urscript.run.host import Handle
from urscript.run.threads import ScriptThread
from urscript.run.waits import Wait
from urscript.values import CapacityList, Matrix, Pose, Struct, a_type, is_number, type_name


class _Undefined:
    """The content of a variable that nothing was assigned to yet."""

    script_type = "undefined"

    def __repr__(self) -> str:
        return "UNDEFINED"


UNDEFINED: Final = _Undefined()


def undefined(name: str) -> Any:
    """A variable was read before a value was assigned to it (U: the text of a controller)."""
    raise ScriptRuntimeError(f"variable '{name}' is used before a value is assigned to it")


# Types of values without parts: two of one of these agree.
_SCALARS = frozenset({int, float, bool, str})


def same_kind(old: type, value: Any) -> bool:
    """Whether a variable or element of type `old` may receive `value`; int and float are one kind, number."""
    new = type(value)
    if new is old or value is None or old is type(None):
        return True
    if old is int or old is float:
        # A thread handle and an integer replace each other. Source: driver scripts preset handles to 0.
        return (new is not bool and isinstance(value, (int, float))) or hasattr(value, "thread_id")
    return hasattr(old, "thread_id") and new is int


def same_type(old: Any, value: Any) -> bool:
    """Whether an element or member that holds `old` may receive `value`: also elements and members agree."""
    if type(old) is Struct:
        return type(value) is Struct and _same_members(old, value)
    if isinstance(old, list):
        return isinstance(value, list) and same_type(sample_of(old), sample_of(value))
    return old is UNDEFINED or value is UNDEFINED or same_kind(type(old), value)


def _same_members(old: Struct, value: Struct) -> bool:
    return list(old.members) == list(value.members) and all(
        map(same_type, old.members.values(), value.members.values())
    )


def sample_of(items: list[Any]) -> Any:
    """A value of the type of the elements of a list; UNDEFINED if it never had one."""
    if items:
        return items[0]
    return items.sample if isinstance(items, CapacityList) else UNDEFINED


def capacity_of(items: list[Any]) -> int:
    """Most elements that a list can have."""
    return items.capacity if isinstance(items, CapacityList) else len(items)


def assign(value: Any, old: Any, name: str) -> Any:
    """The new value of variable `name`, which holds `old`, in `name = value`.

    The first value fixes the type (D), and that of a list its length (see Dialect.list_resize).
    """
    if type(value) is list and type(old) is list:
        if len(value) != len(old):
            raise ScriptRuntimeError("Resizing of 'List' is not supported")
        if value and type(value[0]) is type(old[0]):  # nearly always
            return value
    return assign_resizing(value, old, name)


def assign_resizing(value: Any, old: Any, name: str) -> Any:
    """`assign` for software in which a list may change its length."""
    if isinstance(value, list) and isinstance(old, list):
        if old and value and not same_kind(type(old[0]), value[0]):
            raise _other_type(f"variable '{name}'", old, value)
        return value
    return _assign_other(value, old, "variable", name)


def assign_within_capacity(value: Any, old: Any, name: str) -> Any:
    """`assign` for software in which a list has a capacity, which it keeps (D); so it can get shorter."""
    if (
        type(value) is list
        and type(old) is list
        and len(value) == len(old) > 0
        and type(value[0]) is type(old[0])
        and type(value[0]) in _SCALARS
    ):  # nearly always
        return value
    return fitted(value, old, "variable", name)


def fitted(value: Any, old: Any, kind: str, name: str) -> Any:
    """What a variable or member that holds `old` holds after `value` is stored in it.

    Messages say which `kind` it is, "variable" or "member", and its name.
    """
    if isinstance(old, list):
        if type(value) is Struct and (members := list(value.members.values())):
            # A struct whose members are of one type, that of the list, fits into it (D).
            value = members if all(same_type(sample_of(old), member) for member in members) else value
        if isinstance(value, list):
            return _into_list(value, old, kind, name)
    return _assign_other(value, old, kind, name)


def _into_list(value: list[Any], old: list[Any], kind: str, name: str) -> list[Any]:
    if not same_type(old, value):
        raise _other_type(f"{kind} '{name}'", old, value)
    capacity = capacity_of(old)
    if len(value) > capacity:
        raise ScriptRuntimeError(
            f"a list of {len(value)} elements does not fit into {kind} '{name}' with a capacity of {capacity}"
        )
    return values.list_with_capacity(value, capacity, sample_of(old))


def _assign_other(value: Any, old: Any, kind: str, name: str) -> Any:
    """All but a list into a list."""
    if type(old) is Struct and type(value) is Struct and list(old.members) == list(value.members):
        pairs = zip(old.members.items(), value.members.values(), strict=True)
        return Struct({member: fitted(new, present, "member", member) for (member, present), new in pairs})
    are_structs = type(old) is type(value) is Struct
    if old is UNDEFINED or (same_kind(type(old), value) and not are_structs):
        return value
    if fits(ParamType.VECTOR6, old) and fits(ParamType.VECTOR6, value):
        return value
    raise _other_type(f"{kind} '{name}'", old, value)


def _other_type(what: str, old: Any, new: Any) -> ScriptRuntimeError:
    return ScriptRuntimeError(f"{what} is {_described(old, new)}, cannot assign {_described(new, old)}")


def _described(value: Any, other: Any) -> str:
    """The type of a value as it differs from that of another."""
    if isinstance(value, list) and isinstance(other, list):
        return f"a list of {type_name(sample_of(value))}"
    if type(value) is Struct and type(other) is Struct:
        return f"a struct of {', '.join(value.members)}"
    return a_type(value)


# --- inside lists, poses, matrices and structs -----------------------------------------------------------

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
    return Pose(*map(_element_of_pose, items))


def _element_of_pose(value: Any) -> float:
    """A value as an element of a pose: a pose takes what a builtin takes for a number."""
    element = converted(ParamType.NUMBER, value)
    if is_number(element):
        return element  # type: ignore[no-any-return]
    raise ScriptRuntimeError(f"a pose holds numbers only, got {a_type(value)}")


def _position(index: Any, length: int) -> int:
    """`index` as a position in something of `length` elements."""
    if type(index) is float and index.is_integer():
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
        return changed if kind is list else values.list_with_capacity(changed, capacity_of(target), old)
    if kind is Pose:
        return target.with_item(_position(index, 6), _element_of_pose(value))
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


# --- methods of values, and of handles -------------------------------------------------------------------

Methods = Mapping[tuple[str, str], Builtin]
Changed = tuple[Any, Any]
"""What a method leaves in the place of its list, and its result."""


class MethodCalls:
    """Calls of methods, in software that has these."""

    def __init__(self, methods: Methods) -> None:
        self._methods = methods

    def call(
        self,
        thread: ScriptThread,
        target: Any,
        method: str,
        arguments: Sequence[Any],
        named: Mapping[str, Any],
    ) -> Generator[Wait, None, Any]:
        """`target.method(...)`; what it changes is lost."""
        # The test of a protocol is slow: values come first.
        if type(target) not in values.TYPE_NAMES and isinstance(target, Handle):
            return (yield from target.call_method(thread, method, arguments, named))
        return self._result(target, method, arguments, named)[1]

    def change(
        self,
        thread: ScriptThread,
        method: str,
        arguments: Sequence[Any],
        named: Mapping[str, Any],
        steps: list[Step],
        root: Any,
    ) -> Generator[Wait, None, Changed]:
        """`variable.method(...)`, or of an element or member that is so many steps inside the variable.

        Returns:
            The new value of the variable (UNDEFINED: it stays), and the result.
        """
        target = root
        for step in steps:
            target = inside(target, step)
        if type(target) not in values.TYPE_NAMES and isinstance(target, Handle):
            return UNDEFINED, (yield from target.call_method(thread, method, arguments, named))
        changed, result = self._result(target, method, arguments, named)
        if changed is UNDEFINED or not steps:
            return changed, result
        return store_inside(changed, steps, root), result

    def _result(
        self, target: Any, method: str, arguments: Sequence[Any], named: Mapping[str, Any]
    ) -> Changed:
        key = type_name(target), method
        row = self._methods.get(key)
        if row is None:
            raise ScriptRuntimeError(f"{a_type(target)} has no method '{method}'")
        if named or len(arguments) != len(row.params):
            try:
                signature = CallSignature(method, [param.name for param in row.params], frozenset())
                signature.check(len(arguments), list(named))
            except ScriptTypeError as error:
                raise ScriptRuntimeError(error.message) from None
            arguments = [*arguments, *(named[param.name] for param in row.params[len(arguments) :])]
        made = _FUNCTIONS[key](target, *_FITTINGS[key](arguments))
        return made if row.changes else (UNDEFINED, made)


def kept(changed: Changed, present: Any) -> Any:
    """What a variable holds after a call of `MethodCalls.change` on it."""
    return present if changed[0] is UNDEFINED else changed[0]


def _changed(target: list[Any], items: list[Any], result: Any = None) -> Changed:
    return values.list_with_capacity(items, capacity_of(target), sample_of(target)), result


def _grown(target: list[Any], method: str, index: int, items: list[Any]) -> Changed:
    """`target` with `items` before the element `index`."""
    _place(method, index, len(target))
    capacity = capacity_of(target)
    if len(target) + len(items) > capacity:
        raise ScriptRuntimeError(
            f"{method}: a list of {len(target)} elements with a capacity of {capacity} has no room for "
            f"{len(items)} more"
        )
    sample = sample_of(target)
    for value in items:
        if not same_type(sample, value):
            raise not_an_element(value, sample)
    grown = target.copy()
    grown[index:index] = items
    return _changed(target, grown)


def _pop(target: list[Any]) -> Changed:
    if not target:
        raise ScriptRuntimeError("pop: the list is empty")
    return _changed(target, target[:-1], target[-1])


def _remove(target: list[Any], index: int) -> Changed:
    place = _place("remove", index, len(target) - 1)
    rest = target.copy()
    del rest[place]
    return _changed(target, rest)


def _slice(target: list[Any], begin: int, end: int) -> list[Any]:
    first, last = _place("slice", begin, len(target)), _place("slice", end, len(target))
    if first > last:
        raise ScriptRuntimeError(f"slice: it ends at {last}, before it begins at {first}")
    return target[first:last]


def _place(method: str, index: int, last: int) -> int:
    """An index from 0 to `last`."""
    if not 0 <= index <= last:
        allowed = f"allowed: 0 to {last}" if last >= 0 else "the list is empty"
        raise ScriptRuntimeError(f"{method}: index {index} is out of range; {allowed}")
    return index


def _get_row(target: Matrix, index: int) -> list[Any]:
    return list(target.rows[_place("get_row", index, target.shape[0] - 1)])


def _get_column(target: Matrix, index: int) -> list[Any]:
    column = _place("get_column", index, target.shape[1] - 1)
    return [row[column] for row in target.rows]


def _to_string(target: Any) -> str:
    text = values.str_form(target)
    if len(text) <= values.TEXT_LIMIT:
        return text
    end = f"...{text[-1]}"
    return text[: values.TEXT_LIMIT - len(end)] + end


_FITTINGS: Final = {key: compile_fitting(key[1], row.params) for row in METHODS for key in (method_key(row),)}

_FUNCTIONS: Final[dict[tuple[str, str], Callable[..., Any]]] = {
    ("list", "append"): lambda target, value: _grown(target, "append", len(target), [value]),
    ("list", "extend"): lambda target, items: _grown(target, "extend", len(target), items),
    ("list", "insert"): lambda target, index, value: _grown(target, "insert", index, [value]),
    ("list", "pop"): _pop,
    ("list", "remove"): _remove,
    ("list", "clear"): lambda target: _changed(target, []),
    ("list", "slice"): _slice,
    ("list", "length"): len,
    ("list", "capacity"): capacity_of,
    ("list", "excess_capacity"): lambda target: capacity_of(target) - len(target),
    ("list", "to_string"): _to_string,
    ("struct", "length"): lambda target: len(target.members),
    ("struct", "to_string"): _to_string,
    ("matrix", "get_row"): _get_row,
    ("matrix", "get_column"): _get_column,
    ("matrix", "shape"): lambda target: list(target.shape),
    ("matrix", "to_string"): _to_string,
}
