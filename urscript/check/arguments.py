"""Warnings about constant arguments: a type, length or range that a builtin refuses, degrees, millimetres."""

from collections import Counter
from collections.abc import Iterator, Sequence
from math import degrees, hypot
from typing import Any, Final, NamedTuple

from urscript.catalogue import STEP_TIME, Catalogue
from urscript.catalogue.calls import compile_fitting, converted, fits, type_error
from urscript.catalogue.types import Builtin, Param
from urscript.check import warnings
from urscript.check.unused import Variable, expressions_read, owner
from urscript.check.warnings import ScriptWarning
from urscript.errors import ScriptRuntimeError, ScriptTypeError
from urscript.names.scopes import ResolvedProgram, wrong_count
from urscript.syntax import nodes
from urscript.syntax.nodes import Expression, all_statements
from urscript.values import Pose, is_number, log_form

_STREAMED: Final = frozenset({"servoj", "speedj", "speedl"})


class KnownValue(NamedTuple):
    """What is statically known of a value.

    Attributes:
        value: The value; unknown numbers in it are 0.
        whole: All of it is known, not only type and length.
    """

    value: Any
    whole: bool


def argument_warnings(program: ResolvedProgram, catalogue: Catalogue) -> Iterator[ScriptWarning]:
    """Everything this module warns about, in no order."""
    constants = _constants(program)
    cycle = STEP_TIME[catalogue.version.generation]
    for scope, call in expressions_read(program):
        if not isinstance(call, nodes.Call):
            continue
        callee = scope.find_function(call.function)
        if callee is not None:
            if refusal := wrong_count(call, callee):
                yield ScriptWarning(warnings.WRONG_COUNT, refusal, call.span)
            continue
        builtin = catalogue.lookup(call.function)
        if builtin is None:
            continue
        for param, argument in _arguments(call, builtin, catalogue):
            value = argument
            if isinstance(argument, nodes.Name):
                value = constants.get(owner(argument.name, scope), argument)
            known = _known_value(value)
            if known is None:
                continue
            message = _refused(builtin, param, known)
            taken = converted(param.type, known.value)
            if message:
                yield ScriptWarning(warnings.REFUSED_ARGUMENT, message, argument.span)
            elif taken is not known.value:
                message = type_error(builtin.name, param.name, param.type, known.value).message
                hint = f"it is taken as {log_form(taken)}"
                yield ScriptWarning(warnings.IN_NO_MANUAL, message, argument.span, hint)
            elif found := _wrong_unit(param, known.value):
                rule, text, hint = found
                yield ScriptWarning(rule, f"{builtin.name}: {text}", argument.span, hint)
            elif builtin.name in _STREAMED and param.name == "t" and 0 < known.value < cycle:
                text = f"{builtin.name}: {known.value:g} s is shorter than a control cycle of {cycle:g} s"
                hint = "write get_steptime()"
                yield ScriptWarning(warnings.SHORT_TIME, text, argument.span, hint)


def _constants(program: ResolvedProgram) -> dict[Variable, Expression]:
    """The values of variables that are assigned once, with their elements."""
    values: dict[Variable, Expression] = {}
    assigned: Counter[Variable] = Counter()
    for scope in program.scopes():
        parameters = scope.node.parameters if scope.node is not None else ()
        assigned.update((scope, parameter.name) for parameter in parameters)
        for statement in all_statements(scope.body):
            if not isinstance(statement, nodes.Assign):
                continue
            target = nodes.root_of(statement.target)
            if isinstance(target, nodes.Name):
                variable = owner(target.name, scope, statement.scope)
                assigned[variable] += 1
                values[variable] = statement.value
    for scope, part in expressions_read(program):
        if isinstance(part, nodes.MethodCall) and isinstance(part.target, nodes.Name):
            assigned[owner(part.target.name, scope)] += 1  # it may change its list
    return {variable: value for variable, value in values.items() if assigned[variable] == 1}


def _arguments(
    call: nodes.Call, builtin: Builtin, catalogue: Catalogue
) -> Iterator[tuple[Param, Expression]]:
    """The arguments that are given, beside their parameters; none if they do not fit."""
    positional = [item.value for item in call.arguments if item.name is None]
    named = {item.name: item.value for item in call.arguments if item.name is not None}
    try:
        slots = catalogue.static_bind(builtin.name, len(positional), tuple(named))
    except ScriptTypeError:  # it is shown as an error
        return
    for param, slot in zip(builtin.params, slots, strict=False):
        if slot[0] == "arg":
            yield param, positional[slot[1]]
        elif slot[0] == "kw":
            yield param, named[slot[1]]


def _refused(builtin: Builtin, param: Param, known: KnownValue) -> str | None:
    if known.whole:
        try:
            compile_fitting(builtin.name, (param,), builtin.nan_ok)([known.value])
        except ScriptRuntimeError as error:
            return error.message
        return None
    if fits(param.type, converted(param.type, known.value)):
        return None
    return type_error(builtin.name, param.name, param.type, known.value).message


def _known_value(expression: Expression) -> KnownValue | None:
    match expression:
        case (
            nodes.IntLiteral(value=value)
            | nodes.FloatLiteral(value=value)
            | nodes.BoolLiteral(value=value)
            | nodes.StringLiteral(value=value)
        ):
            return KnownValue(value, True)
        case nodes.UnaryOperation(
            operator="-" | "+" as sign, operand=nodes.IntLiteral() | nodes.FloatLiteral() as number
        ):
            return KnownValue(-number.value if sign == "-" else number.value, True)
        case nodes.ListLiteral(items=items) | nodes.PoseLiteral(items=items):
            parts = [_known_value(item) for item in items]
            if any(isinstance(item, nodes.ListLiteral) for item in items):
                return None  # a matrix
            values = [0 if part is None else part.value for part in parts]
            whole = all(part is not None and part.whole for part in parts)
            if isinstance(expression, nodes.ListLiteral):
                return KnownValue(values, whole)
            if all(type(value) in (int, float) for value in values):
                return KnownValue(Pose.of(values), whole)
    return None


# --- units: degrees for radians, millimetres for metres -------------------------------------------------

_JOINT_RANGE: Final = 6.4
"""No joint but the last goes beyond 363 degrees, and no rotation vector is longer [rad]."""
_LAST_JOINT: Final = 12.6
"""The last joint may turn without end; more than two turns are hardly meant [rad]."""
_JOINT_SPEED: Final = 12.6
"""Twice the speed of the fastest joint [rad/s]."""
_LENGTH: Final = 3.0
"""No arm reaches so far, with its tool [m]."""
_TOOL_SPEED: Final = 10.0
"""More than twice what the fastest arm does with its tool [m/s]."""


_Excess = tuple[warnings.Rule, str, str]
"""Of a value that is too large for its unit: the warning, what is too large, what to write instead."""


def _wrong_unit(param: Param, value: Any) -> _Excess | None:
    """What is too large in a constant argument, or None; numbers that are not known are 0.

    The first words of the parameter's unit say what it measures.
    """
    unit = param.unit
    if isinstance(value, Pose):
        is_pose = "m, rad" in unit or "m and rad" in unit
        return _too_long(value[:3]) or _too_far_turned(value[3:]) if is_pose else None
    if is_number(value):
        value = [value]
    elif not isinstance(value, list) or not value or not all(map(is_number, value)):
        return None
    match unit:
        case "m" | "m from the flange":
            return _too_long(value)
        case "m/s" | "m/s, rad/s":
            return _too_fast_tool(value[:3])
        case "rad/s":
            return _too_fast_joint(value)
    is_joints = len(value) == 6 and "rad" in unit and "/" not in unit
    return _beyond_joints(value) if is_joints else None


def _too_fast_tool(speeds: Sequence[float]) -> _Excess | None:
    fastest = max(speeds, key=abs)
    text = f"{fastest:g} m/s is faster than any arm"
    return _in_millimetres(text, fastest) if abs(fastest) > _TOOL_SPEED else None


def _too_fast_joint(speeds: Sequence[float]) -> _Excess | None:
    fastest = max(speeds, key=abs)
    text = f"{fastest:g} rad/s is faster than any joint"
    return _in_degrees(text, fastest) if abs(fastest) > _JOINT_SPEED else None


def _beyond_joints(q: Sequence[float]) -> _Excess | None:
    for k, x in enumerate(q):
        if abs(x) > (_LAST_JOINT if k == 5 else _JOINT_RANGE):
            return _in_degrees(f"joint {k} at {x:g} rad is {degrees(x):.0f} degrees", x)
    return None


def _too_far_turned(rotation: Sequence[float]) -> _Excess | None:
    largest = max(rotation, key=abs)
    text = f"a rotation vector with {largest:g} rad is more than a turn"
    return _in_degrees(text, largest) if hypot(*rotation) > _JOINT_RANGE else None


def _too_long(lengths: Sequence[float]) -> _Excess | None:
    longest = max(lengths, key=abs)
    text = f"{longest:g} m is farther than any arm reaches"
    return _in_millimetres(text, longest) if abs(longest) > _LENGTH else None


def _in_degrees(text: str, value: float) -> _Excess:
    return warnings.DEGREES, text, f"write d2r({value:g}) if degrees are meant"


def _in_millimetres(text: str, value: float) -> _Excess:
    return warnings.MILLIMETRES, text, f"write {value / 1000:g} if millimetres are meant"
