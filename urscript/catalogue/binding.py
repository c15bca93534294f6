"""Which argument of a call belongs to which parameter, decided from the form of the call alone.

The compiler calls `static_bind` once for each call in a program; at run time nothing is left to decide.

Texts: "speedl() got an unexpected keyword argument 't_min'" and "Type error: str_sub takes exact..." were
seen from controllers; the words after "exact" and the other cases follow the same, Python-like, pattern.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass
from typing import Literal

from urscript.errors import ScriptTypeError

from .types import Builtin

Slot = tuple[Literal["arg"], int] | tuple[Literal["kw"], str] | tuple[Literal["default"], object]
"""Where a parameter's value comes from: positional argument i, keyword argument, or the default."""


@dataclass(frozen=True, slots=True)
class CallSignature:
    """The signature of a function, builtin or of a program.

    Attributes:
        function: name of the function.
        names: of its parameters, in order.
        optional: those that have a default.
        hint: added to the error.
    """

    function: str
    names: Sequence[str]
    optional: Set[str]
    hint: str | None = None

    def check(self, n_positional: int, keywords: Sequence[str]) -> None:
        """Raise ScriptTypeError, without a place, if these arguments do not fit.

        Args:
            n_positional: number of positional arguments.
            keywords: names of the keyword arguments, in the order of the call.
        """
        self.check_keywords(n_positional, keywords)
        given = n_positional + len(keywords)
        if n_positional > len(self.names) or given < len(self.names) - len(self.optional):
            raise self._wrong_count(given)
        for name in self.names[n_positional:]:
            if name not in keywords and name not in self.optional:
                raise self._type_error(f"{self.function}() missing required argument '{name}'")

    def check_keywords(self, n_positional: int, keywords: Sequence[str]) -> None:
        """Raise ScriptTypeError for a name that no parameter has, or one that has its value already."""
        seen = set(self.names[:n_positional])
        for keyword in keywords:
            if keyword not in self.names:
                raise self._type_error(f"{self.function}() got an unexpected keyword argument '{keyword}'")
            if keyword in seen:
                raise self._type_error(
                    f"{self.function}() got multiple values for keyword argument '{keyword}'"
                )
            seen.add(keyword)

    def _wrong_count(self, given: int) -> ScriptTypeError:
        most = len(self.names)
        least = most - len(self.optional)
        between = "" if least == most else f"{least} or " if least == most - 1 else f"{least} to "
        arguments = "argument" if most == 1 else "arguments"
        return self._type_error(f"{self.function} takes exactly {between}{most} {arguments} ({given} given)")

    def _type_error(self, message: str) -> ScriptTypeError:
        return ScriptTypeError(message, hint=self.hint)


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
    if builtin.any_names:
        if n_positional or not keyword_names:
            raise ScriptTypeError(f"{builtin.name} takes one or more named arguments and no others")
        CallSignature(builtin.name, keyword_names, frozenset()).check_keywords(0, keyword_names)
        return [("kw", name) for name in keyword_names]
    names = [param.name for param in builtin.params]
    optional = {param.name for param in builtin.params if not param.is_required}
    CallSignature(builtin.name, names, optional, f"use {builtin.signature}").check(
        n_positional, keyword_names
    )
    slots: list[Slot] = []
    for index, param in enumerate(builtin.params):
        if index < n_positional:
            slots.append(("arg", index))
        elif param.name in keyword_names:
            slots.append(("kw", param.name))
        else:
            slots.append(("default", param.default))
    return slots
