"""Calls of builtins with Python values: the arguments in the order of the signature, defaults filled in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from urscript.catalogue import CB3_3_15


def bind(name: str, args: Sequence[Any], named: Mapping[str, Any] | None = None) -> tuple[Any, ...]:
    """The bound arguments; raises ScriptTypeError if the call does not fit the signature."""
    named = named or {}
    sources = {
        "arg": lambda index: args[index],
        "kw": lambda name: named[name],
        "default": lambda value: value,
    }
    return tuple(sources[kind](key) for kind, key in CB3_3_15.static_bind(name, len(args), tuple(named)))
