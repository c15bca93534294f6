"""Which argument of a call belongs to which parameter, and whether its value fits.

The compiler calls `static_bind` once for each call in a program: the form of the call alone decides which
argument is which. Values are checked at run time: type, finiteness, range.

Texts: "speedl() got an unexpected keyword argument 't_min'" and "Type error: str_sub takes exact..." were
seen from controllers; the words after "exact" and the other cases follow the same, Python-like, pattern. Of
the texts about values, the one for poses is the controller's own (log of 5.12: "get_inverse_kin: Parameter
must be a Pose on the form p[x,y,z,a,b,c]"); the others follow its pattern, adding what was given.
"""

import operator
from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass
from math import hypot, isfinite
from typing import Any, Literal

from urscript.catalogue.types import FIXED_SIZE, Builtin, Param, ParamType
from urscript.errors import ScriptRuntimeError, ScriptTypeError
from urscript.values import INT_MAX, INT_MIN, Matrix, Pose, is_number, type_name

Slot = tuple[Literal["arg"], int] | tuple[Literal["kw"], str] | tuple[Literal["default"], object]
"""Where a parameter's value comes from: positional argument i, keyword argument, or the default."""


@dataclass(frozen=True, slots=True)
class CallSignature:
    """The signature of a function, builtin or of a program.

    Attributes:
        names: of its parameters, in order.
        optional: those that have a default.
        hint: added to the error.
    """

    function: str
    names: Sequence[str]
    optional: Set[str]
    hint: str | None = None

    def check(self, n_positional: int, keywords: Sequence[str]) -> None:
        """Raise ScriptTypeError, without a place, if these arguments do not fit."""
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


# --- values: what fits them is compiled once for each builtin and then only runs small predicates, because
# motion commands pass here every control cycle. What they refuse may still be converted.

Predicate = Callable[[Any], bool]
Fitting = Callable[[Sequence[Any]], Sequence[Any]]

_SHOWN_TEXT = 40
# Larger numbers are not a length, time or angle of a robot; their products would overflow.
_LARGEST = 1e15


def _is_numbers(value: Any, count: int | None = None) -> bool:
    if not isinstance(value, list) or (count is not None and len(value) != count):
        return False
    for item in value:
        kind = type(item)
        if kind is not float and kind is not int and not is_number(item):
            return False
    return True


def _is_six(value: Any) -> bool:
    return _is_numbers(value, 6)


def _is_bools(value: Any) -> bool:
    return isinstance(value, list) and all(type(item) is bool for item in value)


_PREDICATES: dict[ParamType, Predicate] = {
    ParamType.BOOL: lambda value: type(value) is bool,
    ParamType.INT: lambda value: type(value) is int,
    ParamType.NUMBER: is_number,
    ParamType.STRING: lambda value: isinstance(value, str),
    ParamType.STRING_OR_INT: lambda value: isinstance(value, (str, int)),
    ParamType.POSE: lambda value: type(value) is Pose,
    ParamType.JOINTS: _is_six,
    ParamType.POSE_OR_JOINTS: lambda value: type(value) is Pose or _is_numbers(value, 6),
    ParamType.VECTOR3: lambda value: _is_numbers(value, 3),
    ParamType.VECTOR6: lambda value: type(value) is Pose or _is_numbers(value, 6),
    ParamType.NUMBERS: _is_numbers,
    ParamType.NUMBER_OR_NUMBERS: lambda value: is_number(value) or _is_numbers(value),
    ParamType.BOOLS: _is_bools,
    ParamType.BOOL_OR_BOOLS: lambda value: type(value) is bool or _is_bools(value),
    ParamType.LIST: lambda value: isinstance(value, list),
    ParamType.MATRIX: lambda value: isinstance(value, Matrix),
    ParamType.ARRAY: lambda value: isinstance(value, (list, Pose)),
    ParamType.SIZED: lambda value: isinstance(value, (list, str, Pose)),
    ParamType.SHAPED: lambda value: isinstance(value, (Matrix, list, str, Pose)),
    ParamType.LIST_OR_MATRIX: lambda value: isinstance(value, Matrix) or _is_numbers(value),
    ParamType.POSE_OR_MATRIX: lambda value: isinstance(value, (Matrix, Pose)),
    ParamType.NORMED: lambda value: type(value) is Pose or is_number(value) or _is_numbers(value),
}

_INTS = frozenset({ParamType.INT, ParamType.STRING_OR_INT})
_BOOLS = frozenset({ParamType.BOOL, ParamType.BOOLS, ParamType.BOOL_OR_BOOLS})
_NUMERIC = FIXED_SIZE - {ParamType.BOOL, ParamType.INT} | {ParamType.NUMBERS, ParamType.NUMBER_OR_NUMBERS}
_NUMBERS = _NUMERIC | _INTS | {ParamType.LIST_OR_MATRIX, ParamType.NORMED}
"""Types of what is a number, or may hold some."""


def converted(kind: ParamType, value: Any) -> Any:
    """A value as a parameter of this type takes it, if it can be converted.

    Where it takes numbers, True is 1 and False 0; where it takes bools, 0 is False, any other number True. An
    integer may be a float without fraction: programs compute indexes.
    """
    if isinstance(value, list):
        parts = [converted(kind, item) for item in value]
        return value if all(map(operator.is_, parts, value)) else parts
    if type(value) is bool:
        return int(value) if kind in _NUMBERS else value
    if isinstance(value, float) and kind in _INTS and value.is_integer() and INT_MIN <= value <= INT_MAX:
        return int(value)
    return value != 0 if kind in _BOOLS and is_number(value) else value


def fits(kind: ParamType, value: Any) -> bool:
    """Whether `value` is of the type a parameter asks for."""
    predicate = _PREDICATES.get(kind)
    return predicate is None or predicate(value)


def describe(value: Any) -> str:
    """A value in an error message: its type and, where short, itself."""
    if value is None:
        return "None"
    if isinstance(value, str):
        cut = value if len(value) <= _SHOWN_TEXT else value[:_SHOWN_TEXT] + "..."
        return f'the string "{cut}"'
    if isinstance(value, list):
        if value and not all(map(is_number, value)):
            odd = next(item for item in value if not is_number(item))
            return f"a list of {len(value)} with a {type_name(odd)} in it"
        return f"a list of {len(value)}"
    if isinstance(value, (bool, int, float)):
        return f"the {type_name(value)} {value}"
    return f"a {type_name(value)}"


def type_error(function: str, parameter: str, kind: ParamType, value: Any) -> ScriptRuntimeError:
    """The error for an argument of the wrong type."""
    if kind is ParamType.POSE:
        return ScriptRuntimeError(f"{function}: Parameter must be {kind.value}")
    return ScriptRuntimeError(
        f"{function}: Parameter '{parameter}' must be {kind.value}, got {describe(value)}"
    )


def _is_bounded(value: Any) -> bool:
    """Whether a number, or each of a list or pose, is finite and not larger than `_LARGEST`."""
    if isinstance(value, (list, Pose)):
        # NaN slips through a maximum, not through a sum.
        return not value or (isfinite(sum(value)) and max(map(abs, value)) <= _LARGEST)
    return bool(-_LARGEST <= value <= _LARGEST)


def _is_in_range(param: Param, value: Any) -> bool:
    if param.choices and value not in param.choices:
        return False
    if param.low is not None and not value >= param.low:
        return False
    return param.high is None or bool(value <= param.high)


def explain(function: str, param: Param, value: Any, needs_finite: bool) -> ScriptRuntimeError:
    """The error for an argument that does not fit."""
    taken = converted(param.type, value)
    if not fits(param.type, taken):
        return type_error(function, param.name, param.type, value)
    if needs_finite and not _is_bounded(taken):
        is_finite = all(map(isfinite, taken if isinstance(taken, (list, Pose)) else [taken]))
        allowed = f"in the range {-_LARGEST:g} to {_LARGEST:g}" if is_finite else "finite"
    elif param.choices:
        allowed = "one of " + ", ".join(map(str, param.choices))
    elif param.low is not None and param.high is not None:
        allowed = f"in the range {param.low:g} to {param.high:g}"
    elif param.low is not None:
        allowed = f"at least {param.low:g}"
    else:
        allowed = f"at most {param.high:g}"
    return ScriptRuntimeError(f"{function}: Parameter '{param.name}' must be {allowed}, got {_show(taken)}")


def _show(value: Any) -> str:
    return f"[{', '.join(map(str, value))}]" if isinstance(value, (list, Pose)) else str(value)


def _accepts(param: Param, needs_finite: bool) -> Predicate | None:
    """All conditions on one argument in one predicate, or None if there is none."""
    of_type = _PREDICATES.get(param.type)
    if of_type is None:
        return None
    is_ranged = bool(param.choices) or param.low is not None or param.high is not None
    may_be_left_out = param.default is None

    def accepts(value: Any) -> bool:
        if value is None:
            return may_be_left_out
        if not of_type(value):
            return False
        if needs_finite and not _is_bounded(value):
            return False
        return not is_ranged or _is_in_range(param, value)

    is_usual = _FAST_PREDICATES.get(param.type) if needs_finite and not is_ranged else None
    return accepts if is_usual is None else lambda value: is_usual(value) or accepts(value)


_NUMBER_TYPES = frozenset({int, float})


def _is_usual_number(value: Any) -> bool:
    return type(value) in _NUMBER_TYPES and bool(-_LARGEST <= value <= _LARGEST)


def _is_usual_six(value: Any) -> bool:
    # The norm is not a number, or infinite, where an element is; it is at least as large as each of them.
    return (
        type(value) is list
        and len(value) == 6
        and _NUMBER_TYPES.issuperset(map(type, value))
        and hypot(*value) <= _LARGEST
    )


# Fast tests that accept nearly every argument of a motion command; others get the full test.
_FAST_PREDICATES: dict[ParamType, Predicate] = {
    ParamType.NUMBER: _is_usual_number,
    ParamType.JOINTS: _is_usual_six,
    ParamType.POSE_OR_JOINTS: _is_usual_six,
    ParamType.VECTOR6: _is_usual_six,
}


def compile_fitting(function: str, params: Sequence[Param], nan_ok: bool = True) -> Fitting:
    """A function that returns bound arguments as a builtin or method with these parameters takes them.

    It raises ScriptRuntimeError for the first that does not fit. `nan_ok`: see `Builtin`.
    """
    tests = []
    for index, param in enumerate(params):
        needs_finite = not nan_ok and param.type in _NUMERIC
        if (accepts := _accepts(param, needs_finite)) is not None:
            tests.append((index, param, needs_finite, accepts))

    def fit(args: Sequence[Any]) -> Sequence[Any]:
        for index, param, needs_finite, accepts in tests:
            if not accepts(args[index]):
                value = converted(param.type, args[index])
                if not accepts(value):
                    raise explain(function, param, args[index], needs_finite)
                args = [*args[:index], value, *args[index + 1 :]]
        return args

    return fit
