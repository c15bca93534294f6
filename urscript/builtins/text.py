"""What values look like where a program makes text of them: to_str and str_cat, textmsg, sockets.

The two text forms are `urscript.values.str_form` and `log_form`; here is which operation takes which values
in which form.
"""

from __future__ import annotations

from typing import Any

from urscript.errors import ScriptRuntimeError
from urscript.values import TEXT_LIMIT, Pose, a_type, is_number, log_form, str_form

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


def message_text(s1: Any, s2: Any = "") -> str:
    """The line that `textmsg(s1, s2)` writes: both texts with nothing between, floats with 6 digits.

    Source: script manual CB3 3.15.4, textmsg; primary interface captures.
    """
    return log_form(s1) + log_form(s2)


def wire_text(value: Any) -> str:
    """The characters `socket_send_string` and `socket_send_line` send; each stands for one byte (latin-1).

    Source: field use: numbers go out in decimal, lists as `[a,b,...]`, so in the form of textmsg.
    """
    return log_form(value)
