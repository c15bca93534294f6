"""Which argument of a call fills which parameter, decided from the shape of the call alone.

The compiler calls `static_bind` once for each call in a program; at run time nothing is left to decide.

Texts: "speedl() got an unexpected keyword argument 't_min'" and "Type error: str_sub takes exact..." were
seen from controllers; the words after "exact" and the other cases follow the same, Python-like, pattern.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from urscript.errors import ScriptTypeError

from .types import Builtin

Slot = tuple[Literal["arg"], int] | tuple[Literal["kw"], str] | tuple[Literal["default"], object]
"""Where a parameter's value comes from: positional argument i, keyword argument, or the default."""


def _count(number: int) -> str:
    return f"{number} argument" if number == 1 else f"{number} arguments"


def _wrong_count(builtin: Builtin, given: int) -> ScriptTypeError:
    total = len(builtin.params)
    required = sum(param.is_required for param in builtin.params)
    if required == total:
        allowed = f"exactly {_count(total)}"
    elif given < required:
        allowed = f"at least {_count(required)}"
    else:
        allowed = f"at most {_count(total)}"
    return ScriptTypeError(f"{builtin.name} takes {allowed} ({given} given)", hint=f"use {builtin.signature}")


def _missing(builtin: Builtin, given: int, name: str) -> ScriptTypeError:
    """Too few arguments, or enough of them but not this one."""
    if given < sum(param.is_required for param in builtin.params):
        return _wrong_count(builtin, given)
    return ScriptTypeError(
        f"{builtin.name}() missing required argument '{name}'", hint=f"use {builtin.signature}"
    )


def static_bind(builtin: Builtin, n_positional: int, keyword_names: Sequence[str] = ()) -> list[Slot]:
    """Decide for each parameter, in order, where its value comes from.

    Args:
        builtin: the function called.
        n_positional: number of positional arguments.
        keyword_names: names of the keyword arguments, in the order of the call.

    Returns:
        One slot for each parameter: `("arg", i)`, `("kw", name)` or `("default", value)`.

    Raises:
        ScriptTypeError: wrong count, unknown or repeated keyword; without a place, the caller adds it.
    """
    given = n_positional + len(keyword_names)
    names = [param.name for param in builtin.params]
    seen = set(names[:n_positional])
    for keyword in keyword_names:
        if keyword not in names:
            raise ScriptTypeError(
                f"{builtin.name}() got an unexpected keyword argument '{keyword}'",
                hint=f"use {builtin.signature}",
            )
        if keyword in seen:
            raise ScriptTypeError(f"{builtin.name}() got multiple values for keyword argument '{keyword}'")
        seen.add(keyword)
    if n_positional > len(names):
        raise _wrong_count(builtin, given)
    slots: list[Slot] = []
    for index, param in enumerate(builtin.params):
        if index < n_positional:
            slots.append(("arg", index))
        elif param.name in seen:
            slots.append(("kw", param.name))
        elif param.is_required:
            raise _missing(builtin, given, param.name)
        else:
            slots.append(("default", param.default))
    return slots
