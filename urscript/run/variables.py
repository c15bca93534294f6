"""Values of variables: undefined before the first assignment, of one type after it.

Undocumented behaviour is decided in `dialect`.
"""

from __future__ import annotations

from typing import Any, Final

from urscript import dialect
from urscript.errors import ScriptRuntimeError
from urscript.values import CapacityList, Pose, Struct, a_type, is_number, list_with_capacity, type_name


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
    if new is old or (dialect.NONE_FITS_EVERY_VARIABLE and (value is None or old is type(None))):
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

    Args:
        value: The new value.
        old: The present one.
        kind: "variable" or "member", for messages.
        name: Its name.
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
    return list_with_capacity(value, capacity, sample_of(old))


def _assign_other(value: Any, old: Any, kind: str, name: str) -> Any:
    """All but a list into a list."""
    if type(old) is Struct and type(value) is Struct and list(old.members) == list(value.members):
        pairs = zip(old.members.items(), value.members.values(), strict=True)
        return Struct({member: fitted(new, present, "member", member) for (member, present), new in pairs})
    are_structs = type(old) is type(value) is Struct
    if old is UNDEFINED or (same_kind(type(old), value) and not are_structs):
        return value
    if dialect.SIX_NUMBERS_FIT_A_POSE_VARIABLE and _is_six_numbers(old) and _is_six_numbers(value):
        return value
    raise _other_type(f"{kind} '{name}'", old, value)


def _is_six_numbers(value: Any) -> bool:
    return type(value) is Pose or (isinstance(value, list) and len(value) == 6 and all(map(is_number, value)))


def _other_type(what: str, old: Any, new: Any) -> ScriptRuntimeError:
    return ScriptRuntimeError(f"{what} is {_described(old, new)}, cannot assign {_described(new, old)}")


def _described(value: Any, other: Any) -> str:
    """The type of a value as it differs from that of another."""
    if isinstance(value, list) and isinstance(other, list):
        return f"a list of {type_name(sample_of(value))}"
    if type(value) is Struct and type(other) is Struct:
        return f"a struct of {', '.join(value.members)}"
    return a_type(value)
