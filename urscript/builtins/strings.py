"""The string functions: bytes in, bytes out; positions count bytes from 0.

Source: script manual CB3 3.15.4, module internals, str_at to to_str. The manual says which cases are errors,
not their texts.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

from urscript.catalogue.calls import integer, string
from urscript.errors import ScriptRuntimeError
from urscript.values import INT_MAX, INT_MIN, TEXT_LIMIT, Pose, a_type, is_number, str_form

_NUMBER = re.compile(
    r"""[ \t\n\v\f\r]*
    (?P<sign>[+-]?)
    (?: 0[xX](?P<hex>[0-9a-fA-F]+)
      | (?P<decimal>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)
      | (?P<word>inf|infinity|nan)
    )""",
    re.VERBOSE | re.IGNORECASE | re.ASCII,
)


def str_at(src: Any, index: Any) -> str:
    """One byte of a string; run-time error for an empty string or an index past its ends."""
    text, place = string("str_at", "src", src), integer("str_at", "index", index)
    if not text:
        raise ScriptRuntimeError("str_at: source string is empty")
    if not 0 <= place < len(text):
        raise ScriptRuntimeError(f"str_at: index {place} is out of bounds, the string has {len(text)} bytes")
    return text[place]


def str_cat(op1: Any, op2: Any) -> str:
    """The texts of two values, joined; at most 1023 characters."""
    return _limited("str_cat", _operand_text("str_cat", op1) + _operand_text("str_cat", op2))


def to_str(val: Any) -> str:
    """The text of a value; at most 1023 characters."""
    return _limited("to_str", _operand_text("to_str", val))


def str_empty(text: Any) -> bool:
    """Whether a string has no bytes."""
    return not string("str_empty", "str", text)


def str_len(text: Any) -> int:
    """Number of bytes."""
    return len(string("str_len", "str", text))


def str_find(src: Any, target: Any, start_from: Any = 0) -> int:
    """Index of the first occurrence of target from start_from on, -1 if there is none.

    A start past either end finds nothing; the manual lists no error.
    """
    text, wanted = string("str_find", "src", src), string("str_find", "target", target)
    start = integer("str_find", "start_from", start_from)
    return text.find(wanted, start) if 0 <= start <= len(text) else -1


def str_sub(src: Any, index: Any, count: Any = None) -> str:
    """At most `count` bytes from `index` on, all to the end without it.

    Raises:
        ScriptRuntimeError: index outside [0, length], negative count.
    """
    text, start = string("str_sub", "src", src), integer("str_sub", "index", index)
    if not 0 <= start <= len(text):
        raise ScriptRuntimeError(f"str_sub: index {start} is out of bounds, the string has {len(text)} bytes")
    if count is None:
        return text[start:]
    at_most = integer("str_sub", "len", count)
    if at_most < 0:
        raise ScriptRuntimeError(f"str_sub: len {at_most} is out of bounds, it must not be negative")
    return text[start : start + at_most]


def to_num(number_text: Any) -> int | float:
    """The number a string spells: a float if it has a decimal point, else an int.

    Leading spaces, a sign, an exponent, 0x..., inf and nan are allowed. An exponent without a point that
    leaves a fraction ("5e-4") gives a float: the manual allows the text and names no type.

    Raises:
        ScriptRuntimeError: no valid number, or out of range for its type.
    """
    text = string("to_num", "str", number_text)
    match = _NUMBER.fullmatch(text)
    if match is None:
        raise ScriptRuntimeError(f'to_num: string doesn\'t contain a valid number: "{text[:40]}"')
    sign = -1 if match["sign"] == "-" else 1
    if match["word"]:
        return sign * float(match["word"])
    if match["hex"]:
        return _in_range(sign * int(match["hex"], 16), text)
    value = sign * float(match["decimal"])
    if math.isinf(value):
        raise _out_of_range(text)
    if "." in match["decimal"] or not value.is_integer():
        return value
    return _in_range(int(value), text)


def _in_range(value: int, text: str) -> int:
    if not INT_MIN <= value <= INT_MAX:
        raise _out_of_range(text)
    return value


def _out_of_range(text: str) -> ScriptRuntimeError:
    return ScriptRuntimeError(f'to_num: the number is out of range: "{text[:40]}"')


# --- what to_str and str_cat take and give; the text form is `urscript.values.str_form` -----------------

_ALLOWED = "a string, bool, int, float or pose, or a list of bools, ints, floats or poses"


def _is_scalar(value: Any) -> bool:
    return isinstance(value, (bool, Pose)) or is_number(value)


def _operand_text(function: str, value: Any) -> str:
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


def _limited(function: str, text: str) -> str:
    """The text, if it is not longer than a script string may become.

    Raises:
        ScriptRuntimeError: more than 1023 characters.
    """
    if len(text) > TEXT_LIMIT:
        raise ScriptRuntimeError(
            f"{function}: the resulting string has {len(text)} characters, the limit is {TEXT_LIMIT}"
        )
    return text


FUNCTIONS: dict[str, Callable[..., Any]] = {
    "str_at": str_at,
    "str_cat": str_cat,
    "str_empty": str_empty,
    "str_len": str_len,
    "str_find": str_find,
    "str_sub": str_sub,
    "to_num": to_num,
    "to_str": to_str,
}
