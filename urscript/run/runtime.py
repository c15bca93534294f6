"""The run-time library: the operators, and all names that a compiled program uses.

| name | is |
|---|---|
| `_T` | the running thread, set by the scheduler |
| `_b`, `_x` | what is left of a grant of the meter, and the units in it beyond one a statement |
| `_add` ... | the operators, here and in `variables` |
| `_run`, `_kill`, `_join`, `_halt`, `_enter`, `_leave` | flow |
| `b_name` | a builtin, called with the thread first |

The compiler calls an operator of this module where the types are not known statically; for known numbers or
booleans it emits the Python operator. Two numbers, the most frequent operands, come first in each function.
Undocumented behaviour is decided in `dialect`.
"""

import operator
from collections.abc import Callable, Generator, Iterable, Mapping
from math import ceil, fmod, isfinite, nan
from typing import Any, Final

from urscript import dialect, values
from urscript.builtins import PURE
from urscript.catalogue import Catalogue
from urscript.catalogue.calls import Fitting
from urscript.catalogue.costs import OF_THREAD
from urscript.catalogue.types import FIXED_SIZE
from urscript.dialect import Dialect
from urscript.errors import ScriptRuntimeError
from urscript.run import variables
from urscript.run.host import Host
from urscript.run.metering import Meter, call_cost
from urscript.run.threads import ProgramHalted, Scheduler, ScriptThread, join
from urscript.run.waits import NEXT_CYCLE, OUT_OF_UNITS, Wait
from urscript.values import INT_MAX, INT_MIN, CapacityList, Matrix, Pose, Struct, is_number, wrap_int

# --- arithmetic ----------------------------------------------------------------------------------------


def add(a: Any, b: Any) -> Any:
    """`a + b`: numbers, strings, lists by element, matrices of equal shape."""
    ta, tb = type(a), type(b)
    if ta is int and tb is int:
        result = a + b
        return result if INT_MIN <= result <= INT_MAX else wrap_int(result)
    if (ta is float or ta is int) and (tb is float or tb is int):
        return a + b
    if ta is str and tb is str:
        if len(a) + len(b) > dialect.LONGEST_STRING:
            raise ScriptRuntimeError(
                f"a string of {len(a) + len(b)} characters; allowed: up to {dialect.LONGEST_STRING}"
            )
        return a + b
    return _elementwise("+", add, a, b)


def sub(a: Any, b: Any) -> Any:
    """`a - b`."""
    ta, tb = type(a), type(b)
    if ta is int and tb is int:
        result = a - b
        return result if INT_MIN <= result <= INT_MAX else wrap_int(result)
    if (ta is float or ta is int) and (tb is float or tb is int):
        return a - b
    return _elementwise("-", sub, a, b)


def mul(a: Any, b: Any) -> Any:
    """`a * b`; two matrices, or a matrix and a list, multiply as in algebra."""
    ta, tb = type(a), type(b)
    if ta is int and tb is int:
        result = a * b
        return result if INT_MIN <= result <= INT_MAX else wrap_int(result)
    if (ta is float or ta is int) and (tb is float or tb is int):
        return a * b
    if ta is Matrix and (tb is Matrix or isinstance(b, list)):
        return _matrix_product(a, b)
    return _elementwise("*", mul, a, b)


def div(a: Any, b: Any) -> Any:
    """`a / b`: always real division."""
    ta, tb = type(a), type(b)
    if (ta is float or ta is int) and (tb is float or tb is int):
        if b == 0:
            raise ScriptRuntimeError("division by zero")
        return a / b
    return _elementwise("/", div, a, b)


def mod(a: Any, b: Any) -> Any:
    """`a % b`: the remainder has the sign of `a`."""
    ta, tb = type(a), type(b)
    if (ta is float or ta is int) and (tb is float or tb is int):
        if b == 0:
            raise ScriptRuntimeError("modulo by zero")
        if ta is int and tb is int:
            rest = abs(a) % abs(b)
            return -rest if a < 0 else rest
        # As in C; Python's fmod refuses an infinite dividend.
        return fmod(a, b) if isfinite(a) else nan
    return _elementwise("%", mod, a, b)


def neg(a: Any) -> Any:
    """`-a`; of a list by element."""
    kind = type(a)
    if kind is float:
        return -a
    if kind is int:
        return wrap_int(-a)
    if isinstance(a, list):
        return [neg(item) for item in a]
    if kind is Matrix:
        return Matrix([neg(item) for item in row] for row in a.rows)
    if _is_scalar(a):
        return neg(_to_builtin(a))
    raise ScriptRuntimeError(f"a sign needs a number, a list or a matrix of numbers, got {values.a_type(a)}")


def pos(a: Any) -> Any:
    """`+a`, for whatever can be negated."""
    return neg(neg(a))


def without_arrays(sign: str, compute: Callable[..., Any]) -> Callable[..., Any]:
    """An arithmetic operator of software in which it takes numbers and strings only."""

    def operate(*operands: Any) -> Any:
        if any(isinstance(operand, (list, Matrix)) for operand in operands):
            names = " and ".join(map(values.type_name, operands))
            raise ScriptRuntimeError(f"'{sign}' is not defined for {names} in this software version")
        return compute(*operands)

    return operate


def _is_scalar(value: Any) -> bool:
    """Whether an arithmetic operator takes it for a number."""
    return is_number(value) or type(value) is bool


def _to_builtin(value: Any) -> Any:
    """A bool, or a number of a subclass (of numpy, an enum), as int or float."""
    return float(value) if isinstance(value, float) else int(value)


def _elementwise(sign: str, one: Callable[[Any, Any], Any], a: Any, b: Any) -> Any:
    """Operators on lists and matrices, element by element; anything else is an error.

    Source: script manual 3.15.4, array and matrix arithmetic.
    """
    if isinstance(a, list) and isinstance(b, list):
        if len(a) != len(b):
            raise ScriptRuntimeError(f"'{sign}' needs lists of equal length, got {len(a)} and {len(b)}")
        return [one(x, y) for x, y in zip(a, b, strict=True)]
    if isinstance(a, list) and _is_scalar(b):
        return [one(x, b) for x in a]
    if _is_scalar(a) and isinstance(b, list):
        return [one(a, y) for y in b]
    if type(a) is Matrix and _is_scalar(b):
        return Matrix([one(x, b) for x in row] for row in a.rows)
    if _is_scalar(a) and type(b) is Matrix:
        return Matrix([one(a, y) for y in row] for row in b.rows)
    if sign in "+-" and type(a) is Matrix and type(b) is Matrix:
        if a.shape != b.shape:
            raise ScriptRuntimeError(f"'{sign}' needs matrices of equal shape, got {_size(a)} and {_size(b)}")
        pairs = zip(a.rows, b.rows, strict=True)
        return Matrix([one(x, y) for x, y in zip(left, right, strict=True)] for left, right in pairs)
    if _is_scalar(a) and _is_scalar(b):
        return one(_to_builtin(a), _to_builtin(b))
    raise ScriptRuntimeError(f"'{sign}' is not defined for {values.type_name(a)} and {values.type_name(b)}")


def _size(matrix: Matrix) -> str:
    rows, columns = matrix.shape
    return f"{rows} x {columns}"


def _matrix_product(a: Matrix, b: Matrix | list[Any]) -> Matrix | list[Any]:
    inner = a.shape[1]
    height = len(b)
    if inner != height:
        raise ScriptRuntimeError(f"'*' needs {inner} rows on the right side, got {height}")
    if isinstance(b, Matrix):
        columns = list(zip(*b.rows, strict=True))
        return Matrix([_dot(row, column) for column in columns] for row in a.rows)
    return [_dot(row, b) for row in a.rows]


def _dot(row: tuple[Any, ...], column: tuple[Any, ...] | list[Any]) -> Any:
    total: Any = 0
    for x, y in zip(row, column, strict=True):
        total = add(total, mul(x, y))
    return total


# --- comparison and conditions -------------------------------------------------------------------------


def equal(a: Any, b: Any) -> bool:
    """`a == b`: one bool, also for lists and poses; different types are unequal."""
    ta, tb = type(a), type(b)
    if ta is tb:
        if ta is list or ta is Pose or ta is CapacityList:
            # Python's own comparison takes True for 1, and a NaN for equal to itself.
            return a == b and all(map(equal, a, b))
        if ta is Struct:
            members = list(a.members) == list(b.members)
            return members and all(map(equal, a.members.values(), b.members.values()))
        return bool(a == b)
    if ta is bool or tb is bool:
        return False
    if (ta is int or ta is float) and (tb is int or tb is float):
        return bool(a == b)
    if is_number(a) and is_number(b):
        return bool(a == b)
    return isinstance(a, list) and isinstance(b, list) and len(a) == len(b) and all(map(equal, a, b))


def unequal(a: Any, b: Any) -> bool:
    """`a != b`."""
    return not equal(a, b)


def _ordering(sign: str, compare: Callable[[Any, Any], bool]) -> Callable[[Any, Any], bool]:
    def ordered(a: Any, b: Any) -> bool:
        ta, tb = type(a), type(b)
        if (ta is float or ta is int) and (tb is float or tb is int):
            return compare(a, b)
        a, b = getattr(a, "thread_id", a), getattr(b, "thread_id", b)
        if is_number(a) and is_number(b):
            return bool(compare(a, b))
        raise ScriptRuntimeError(
            f"'{sign}' compares numbers, got {values.type_name(a)} and {values.type_name(b)}"
        )

    return ordered


def truth(value: Any) -> bool:
    """A condition: a bool, a number that is not 0, or a string that is not empty."""
    if value is True or value is False:
        return bool(value)
    if type(value) is str:
        return value != ""
    if type(value) is float or type(value) is int:
        return bool(value != 0)
    raise ScriptRuntimeError(f"a condition must be True or False, got {values.a_type(value)}")


# --- the names -------------------------------------------------------------------------------------------


def _halt() -> None:
    raise ProgramHalted


def _refuse(text: str) -> Any:
    raise ScriptRuntimeError(text)


_COMMON: Final[dict[str, Any]] = {
    **{
        f"_{function.__name__.lstrip('_')}": function
        for function in (
            add, sub, mul, div, mod, neg, pos, equal, unequal, truth,
            variables.item, variables.cell, variables.member, variables.undefined, variables.kept,
            variables.store_item, variables.store_cell, variables.store_member, variables.store_inside,
            join, _halt, _refuse,
        )
    },
    "_less": _ordering("<", operator.lt),
    "_less_equal": _ordering("<=", operator.le),
    "_greater": _ordering(">", operator.gt),
    "_greater_equal": _ordering(">=", operator.ge),
    "_wrap": wrap_int,
    "_Pose": Pose,
    "_pose": variables.make_pose,
    "_list": variables.make_list,
    "_UNDEFINED": variables.UNDEFINED,
    "_MISSING": object(),
    "_NEXT_CYCLE": NEXT_CYCLE,
    "_OUT_OF_UNITS": OUT_OF_UNITS,
}  # fmt: skip
"""What is the same for all programs; a function has its own name, behind an underscore."""

_SIGNS: Final = {"_add": "+", "_sub": "-", "_mul": "*", "_div": "/", "_mod": "%", "_neg": "-", "_pos": "+"}

_ASSIGN: Final = {
    "free": variables.assign_resizing,
    "error": variables.assign,
    "capacity": variables.assign_within_capacity,
}


def base_namespace(dialect: Dialect, methods: variables.Methods, meter: Meter) -> dict[str, Any]:
    """The names that do not depend on the host: operators and values."""
    calls = variables.MethodCalls(methods)
    names = {
        **_COMMON,
        "_assign": _ASSIGN[dialect.list_resize],
        "_method": calls.call,
        "_change": calls.change,
    }
    if not dialect.array_arithmetic:
        names |= {name: without_arrays(sign, _COMMON[name]) for name, sign in _SIGNS.items()}
    return names | meter.operations(names)


def flow_namespace(scheduler: Scheduler, namespace: Mapping[str, Any], meter: Meter) -> dict[str, Any]:
    """The names with which a program calls its scheduler."""

    def run(function: Callable[[], Any], name: str, depth: int) -> ScriptThread:
        meter.charge(OF_THREAD, OF_THREAD)
        return scheduler.start(function, name, namespace["_T"], depth)

    return {"_run": run, "_kill": scheduler.kill, "_enter": scheduler.enter, "_leave": scheduler.leave}


# --- builtins --------------------------------------------------------------------------------------------


def builtin_namespace(names: Iterable[str], catalogue: Catalogue, host: Host, meter: Meter) -> dict[str, Any]:
    """The builtins that a program uses; their arguments are fitted first."""
    offered = host.builtins()
    flow = _flow_builtins(host)
    bound: dict[str, Any] = {}
    for name in names:
        function = flow.get(name) or offered.get(name)
        if function is not None:
            bound[f"b_{name}"] = _fitted(name, function, catalogue, meter)
        elif name in PURE:
            pure = _without_thread(PURE[name], catalogue.fittings[name])
            bound[f"b_{name}"] = meter.function(pure, call_cost(name, is_pure=True), name)
        else:
            bound[f"b_{name}"] = _declared_only(name)
    return bound


def _flow_builtins(host: Host) -> dict[str, Callable[..., Any]]:
    """Builtins of the language: they need only the cycle time and the log of the robot."""

    def textmsg(thread: ScriptThread, first: Any, second: Any) -> None:
        host.textmsg(values.log_form(first) + values.log_form(second))

    def sleep(thread: ScriptThread, seconds: float) -> Generator[Wait, None, None]:
        # Whole cycles that cover the time; the small slack keeps 0.016 s at two.
        for _ in range(ceil(seconds / host.step_time - 1e-9)):
            yield NEXT_CYCLE

    return {"textmsg": textmsg, "varmsg": lambda thread, name, value: None, "sleep": sleep}


def _fitted(
    name: str, function: Callable[..., Any], catalogue: Catalogue, meter: Meter
) -> Callable[..., Any]:
    """A builtin of the host, charged for, that gets its arguments as it takes them."""
    cost, builtin = call_cost(name, is_pure=False), catalogue.lookup(name)
    if builtin is None or not builtin.params:
        return meter.function(function, cost, name)
    fit = catalogue.fittings[name]
    if all(param.type in FIXED_SIZE for param in builtin.params):
        return meter.fitted(function, cost, fit)

    def call(thread: ScriptThread, *arguments: Any) -> Any:
        return function(thread, *fit(arguments))

    return meter.function(call, cost, name)


def _without_thread(function: Callable[..., Any], fit: Fitting) -> Callable[..., Any]:
    def call(thread: ScriptThread, *arguments: Any) -> Any:
        return function(*fit(arguments))

    return call


def _declared_only(name: str) -> Callable[..., Any]:
    def call(thread: ScriptThread, *arguments: Any) -> Any:
        raise ScriptRuntimeError(
            f"{name} is declared only: this box does not model it yet (docs/urscript-coverage.md)"
        )

    return call
