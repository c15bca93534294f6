"""Run-time checks of arguments against the catalogue: type, finiteness, range, with the error text.

A check is compiled once for each builtin and then only runs small predicates, because motion commands pass
here every control cycle. It never converts: an integer parameter also takes a float without fraction,
because programs compute indexes (dialect: INDEX_TAKES_WHOLE_FLOATS), so host functions call `int()` on it.

Texts: the one for poses is the controller's own (log of 5.12: "get_inverse_kin: Parameter must be a Pose on
the form p[x,y,z,a,b,c]"); the others are not documented and follow its pattern, adding what was given.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import hypot, isfinite
from typing import Any

from urscript.errors import ScriptRuntimeError
from urscript.values import Matrix, Pose, is_number, type_name

from .types import Builtin, Param, ParamType

Predicate = Callable[[Any], bool]

_SHOWN_TEXT = 40
# Larger numbers are not a length, time or angle of a robot; their products would overflow.
_LARGEST = 1e15


def _is_int(value: Any) -> bool:
    return type(value) is int or (isinstance(value, float) and value.is_integer())


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


def _is_pose(value: Any) -> bool:
    return type(value) is Pose


_PREDICATES: dict[ParamType, Predicate] = {
    ParamType.BOOL: lambda value: type(value) is bool,
    ParamType.INT: _is_int,
    ParamType.NUMBER: is_number,
    ParamType.STRING: lambda value: isinstance(value, str),
    ParamType.POSE: _is_pose,
    ParamType.JOINTS: _is_six,
    ParamType.POSE_OR_JOINTS: lambda value: type(value) is Pose or _is_numbers(value, 6),
    ParamType.VECTOR3: lambda value: _is_numbers(value, 3),
    ParamType.VECTOR6: lambda value: type(value) is Pose or _is_numbers(value, 6),
    ParamType.NUMBERS: _is_numbers,
    ParamType.BOOLS: lambda value: isinstance(value, list) and all(type(item) is bool for item in value),
    ParamType.LIST: lambda value: isinstance(value, list),
    ParamType.MATRIX: lambda value: isinstance(value, Matrix),
    ParamType.ARRAY: lambda value: isinstance(value, (list, Pose)),
    ParamType.SIZED: lambda value: isinstance(value, (list, str, Pose)),
    ParamType.SHAPED: lambda value: isinstance(value, (Matrix, list, str, Pose)),
    ParamType.LIST_OR_MATRIX: lambda value: isinstance(value, Matrix) or _is_numbers(value),
    ParamType.POSE_OR_MATRIX: lambda value: isinstance(value, (Matrix, Pose)),
    ParamType.NORMED: lambda value: type(value) is Pose or is_number(value) or _is_numbers(value),
}

_NUMERIC = frozenset(
    {
        ParamType.NUMBER,
        ParamType.POSE,
        ParamType.JOINTS,
        ParamType.POSE_OR_JOINTS,
        ParamType.VECTOR3,
        ParamType.VECTOR6,
        ParamType.NUMBERS,
    }
)


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


def _is_finite(value: Any) -> bool:
    """For a number, a list of numbers or a pose."""
    return all(map(isfinite, value)) if isinstance(value, (list, Pose)) else isfinite(value)


def _is_bounded(value: Any) -> bool:
    """Like `_is_finite`, and not larger than `_LARGEST`."""
    if isinstance(value, (list, Pose)):
        # NaN slips through a maximum, not through a sum.
        return not value or (isfinite(sum(value)) and max(map(abs, value)) <= _LARGEST)
    return bool(-_LARGEST <= value <= _LARGEST)


def _must_be_finite(builtin: Builtin, param: Param) -> bool:
    return not builtin.nan_ok and param.type in _NUMERIC


def _is_in_range(param: Param, value: Any) -> bool:
    if param.choices and value not in param.choices:
        return False
    if param.low is not None and not value >= param.low:
        return False
    return param.high is None or bool(value <= param.high)


def explain(builtin: Builtin, param: Param, value: Any) -> ScriptRuntimeError:
    """The error for an argument that a check refused."""
    if not fits(param.type, value):
        return type_error(builtin.name, param.name, param.type, value)
    if _must_be_finite(builtin, param) and not _is_bounded(value):
        allowed = f"in the range {-_LARGEST:g} to {_LARGEST:g}" if _is_finite(value) else "finite"
    elif param.choices:
        allowed = "one of " + ", ".join(map(str, param.choices))
    elif param.low is not None and param.high is not None:
        allowed = f"in the range {param.low:g} to {param.high:g}"
    elif param.low is not None:
        allowed = f"at least {param.low:g}"
    else:
        allowed = f"at most {param.high:g}"
    return ScriptRuntimeError(
        f"{builtin.name}: Parameter '{param.name}' must be {allowed}, got {_show(value)}"
    )


def _show(value: Any) -> str:
    return f"[{', '.join(map(str, value))}]" if isinstance(value, (list, Pose)) else str(value)


def _accepts(builtin: Builtin, param: Param) -> Predicate | None:
    """All conditions on one argument in one predicate, or None if there is none."""
    of_type = _PREDICATES.get(param.type)
    if of_type is None:
        return None
    needs_finite = _must_be_finite(builtin, param)
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


def compile_check(builtin: Builtin) -> Callable[[Sequence[Any]], None]:
    """A function that takes bound arguments and raises ScriptRuntimeError for the first that does not fit."""
    tests = [
        (index, accepts)
        for index, param in enumerate(builtin.params)
        if (accepts := _accepts(builtin, param)) is not None
    ]

    def check(args: Sequence[Any]) -> None:
        for index, accepts in tests:
            if not accepts(args[index]):
                raise explain(builtin, builtin.params[index], args[index])

    return check
