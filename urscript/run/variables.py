"""Values of variables: undefined before the first assignment, of one type after it.

Undocumented behaviour is decided in `dialect`.
"""

from __future__ import annotations

from typing import Any, Final

from urscript import dialect
from urscript.errors import ScriptRuntimeError
from urscript.values import Pose, a_type, is_number, type_name


class _Undefined:
    """The content of a variable that nothing was assigned to yet."""

    script_type = "undefined"

    def __repr__(self) -> str:
        return "UNDEFINED"


UNDEFINED: Final = _Undefined()


def undefined(name: str) -> Any:
    """A variable was read before a value was assigned to it (U: the text of a controller)."""
    raise ScriptRuntimeError(f"variable '{name}' is used before a value is assigned to it")


def same_kind(old: type, value: Any) -> bool:
    """Whether a variable or element of type `old` may receive `value`; int and float are one kind, number."""
    new = type(value)
    if new is old or (dialect.NONE_FITS_EVERY_VARIABLE and (value is None or old is type(None))):
        return True
    if old is int or old is float:
        # A thread handle and an integer replace each other. Source: driver scripts preset handles to 0.
        return (new is not bool and isinstance(value, (int, float))) or hasattr(value, "thread_id")
    return hasattr(old, "thread_id") and new is int


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
    if type(value) is list and type(old) is list:
        if old and value and not same_kind(type(old[0]), value[0]):
            raise _other_type(name, f"a list of {type_name(old[0])}", f"a list of {type_name(value[0])}")
        return value
    if old is UNDEFINED or same_kind(type(old), value):
        return value
    if dialect.SIX_NUMBERS_FIT_A_POSE_VARIABLE and _is_six_numbers(old) and _is_six_numbers(value):
        return value
    raise _other_type(name, a_type(old), a_type(value))


def _is_six_numbers(value: Any) -> bool:
    return type(value) is Pose or (type(value) is list and len(value) == 6 and all(map(is_number, value)))


def _other_type(name: str, old: str, new: str) -> ScriptRuntimeError:
    return ScriptRuntimeError(f"variable '{name}' is {old}, cannot assign {new}")
