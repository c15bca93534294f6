"""Methods of lists, structs and matrices at run time, and of handles.

Values do not change in place: a method that changes a list makes another one, which the program stores where
the call was made. Errors: the manual says when, the texts are ours.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from typing import Any, Final

from urscript.catalogue.calls import integer, type_error
from urscript.catalogue.methods import ValueMethod
from urscript.catalogue.types import ParamType
from urscript.errors import ScriptRuntimeError, ScriptTypeError
from urscript.run.host import Handle
from urscript.run.threads import ScriptThread
from urscript.run.variables import (
    UNDEFINED,
    Step,
    capacity_of,
    inside,
    not_an_element,
    same_type,
    sample_of,
    store_inside,
)
from urscript.run.waits import Wait
from urscript.values import (
    TEXT_LIMIT,
    TYPE_NAMES,
    Matrix,
    Struct,
    a_type,
    list_with_capacity,
    str_form,
    type_name,
)

Methods = Mapping[tuple[str, str], ValueMethod]
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
        if type(target) not in TYPE_NAMES and isinstance(target, Handle):
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
        if type(target) not in TYPE_NAMES and isinstance(target, Handle):
            return UNDEFINED, (yield from target.call_method(thread, method, arguments, named))
        changed, result = self._result(target, method, arguments, named)
        if changed is UNDEFINED or not steps:
            return changed, result
        return store_inside(changed, steps, root), result

    def _result(
        self, target: Any, method: str, arguments: Sequence[Any], named: Mapping[str, Any]
    ) -> Changed:
        row = self._methods.get((type_name(target), method))
        if row is None:
            raise ScriptRuntimeError(f"{a_type(target)} has no method '{method}'")
        if named or len(arguments) != len(row.params):
            try:
                row.signature.check(len(arguments), list(named))
            except ScriptTypeError as error:
                raise ScriptRuntimeError(error.message) from None
            arguments = [*arguments, *(named[param.name] for param in row.params[len(arguments) :])]
        made = _FUNCTIONS[row.type, row.name](target, *arguments)
        return made if row.changes else (UNDEFINED, made)


def kept(changed: Changed, present: Any) -> Any:
    """What a variable holds after a call of `MethodCalls.change` on it."""
    return present if changed[0] is UNDEFINED else changed[0]


# --- lists -----------------------------------------------------------------------------------------------


def _changed(target: list[Any], items: list[Any], result: Any = None) -> Changed:
    return list_with_capacity(items, capacity_of(target), sample_of(target)), result


def _grown(target: list[Any], method: str, index: int, values: list[Any]) -> Changed:
    """`target` with `values` before the element `index`."""
    capacity = capacity_of(target)
    if len(target) + len(values) > capacity:
        raise ScriptRuntimeError(
            f"{method}: a list of {len(target)} elements with a capacity of {capacity} has no room for "
            f"{len(values)} more"
        )
    sample = sample_of(target)
    for value in values:
        if not same_type(sample, value):
            raise not_an_element(value, sample)
    grown = target.copy()
    grown[index:index] = values
    return _changed(target, grown)


def _append(target: list[Any], value: Any) -> Changed:
    return _grown(target, "append", len(target), [value])


def _extend(target: list[Any], values: Any) -> Changed:
    if not isinstance(values, list):
        raise type_error("extend", "values", ParamType.LIST, values)
    return _grown(target, "extend", len(target), values)


def _insert(target: list[Any], index: Any, value: Any) -> Changed:
    return _grown(target, "insert", _place("insert", index, len(target)), [value])


def _pop(target: list[Any]) -> Changed:
    if not target:
        raise ScriptRuntimeError("pop: the list is empty")
    return _changed(target, target[:-1], target[-1])


def _remove(target: list[Any], index: Any) -> Changed:
    place = _place("remove", index, len(target) - 1)
    rest = target.copy()
    del rest[place]
    return _changed(target, rest)


def _clear(target: list[Any]) -> Changed:
    return _changed(target, [])


def _slice(target: list[Any], begin: Any, end: Any) -> list[Any]:
    first, last = _place("slice", begin, len(target)), _place("slice", end, len(target))
    if first > last:
        raise ScriptRuntimeError(f"slice: it ends at {last}, before it begins at {first}")
    return target[first:last]


def _place(method: str, index: Any, last: int) -> int:
    """An index from 0 to `last`."""
    place = integer(method, "index", index)
    if not 0 <= place <= last:
        allowed = f"allowed: 0 to {last}" if last >= 0 else "the list is empty"
        raise ScriptRuntimeError(f"{method}: index {place} is out of range; {allowed}")
    return place


# --- matrices, texts -------------------------------------------------------------------------------------


def _get_row(target: Matrix, index: Any) -> list[Any]:
    return list(target.rows[_place("get_row", index, target.shape[0] - 1)])


def _get_column(target: Matrix, index: Any) -> list[Any]:
    column = _place("get_column", index, target.shape[1] - 1)
    return [row[column] for row in target.rows]


def _to_string(target: Any) -> str:
    text = str_form(target)
    if len(text) <= TEXT_LIMIT:
        return text
    end = f"...{text[-1]}"
    return text[: TEXT_LIMIT - len(end)] + end


def _length(target: Struct) -> int:
    return len(target.members)


_FUNCTIONS: Final[dict[tuple[str, str], Callable[..., Any]]] = {
    ("list", "append"): _append,
    ("list", "extend"): _extend,
    ("list", "insert"): _insert,
    ("list", "pop"): _pop,
    ("list", "remove"): _remove,
    ("list", "clear"): _clear,
    ("list", "slice"): _slice,
    ("list", "length"): len,
    ("list", "capacity"): capacity_of,
    ("list", "excess_capacity"): lambda target: capacity_of(target) - len(target),
    ("list", "to_string"): _to_string,
    ("struct", "length"): _length,
    ("struct", "to_string"): _to_string,
    ("matrix", "get_row"): _get_row,
    ("matrix", "get_column"): _get_column,
    ("matrix", "shape"): lambda target: list(target.shape),
    ("matrix", "to_string"): _to_string,
}
