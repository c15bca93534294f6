"""Checks of what to_str and str_cat take and give; the text form itself is `urscript.values.str_form`."""

from __future__ import annotations

from typing import Any

from urscript.errors import ScriptRuntimeError
from urscript.values import TEXT_LIMIT, Pose, a_type, is_number, str_form

_ALLOWED = "a string, bool, int, float or pose, or a list of bools, ints, floats or poses"


def _is_scalar(value: Any) -> bool:
    return isinstance(value, (bool, Pose)) or is_number(value)


def operand_text(function: str, value: Any) -> str:
    """The text of an operand of to_str or str_cat: six decimals at most, trailing zeros removed.

    Raises:
        ScriptRuntimeError: any type but those the manual lists (none, matrices and lists of strings are not).

    Source: script manual CB3 3.15.4, str_cat and to_str.
    """
    if not isinstance(value, str) and not _is_scalar(value):
        if not isinstance(value, list):
            raise ScriptRuntimeError(f"{function}: operand must be {_ALLOWED}, got {a_type(value)}")
        odd = [item for item in value if not _is_scalar(item)]
        if odd:
            raise ScriptRuntimeError(
                f"{function}: operand must be {_ALLOWED}, got a list with {a_type(odd[0])} in it"
            )
    return str_form(value)


def limited(function: str, text: str) -> str:
    """The text, if it is not longer than a script string may become.

    Raises:
        ScriptRuntimeError: more than 1023 characters.
    """
    if len(text) > TEXT_LIMIT:
        raise ScriptRuntimeError(
            f"{function}: the resulting string has {len(text)} characters, the limit is {TEXT_LIMIT}"
        )
    return text
