"""The names that compiled programs use.

| name | is |
|---|---|
| `_T` | the running thread, set by the scheduler |
| `_b`, `_x` | what is left of a grant of the meter, and the units in it beyond one a statement |
| `_add` ... | the operators of `ops` and `variables` |
| `_run`, `_kill`, `_join`, `_halt`, `_enter`, `_leave` | flow |
| `b_name` | a builtin, called with the thread first |
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Mapping
from math import ceil
from typing import Any, Final

from urscript.builtins import PURE
from urscript.catalogue import Catalogue
from urscript.catalogue.costs import OF_THREAD
from urscript.catalogue.types import FIXED_SIZE
from urscript.dialect import Dialect
from urscript.errors import ScriptRuntimeError
from urscript.run import ops, variables
from urscript.run.host import Host
from urscript.run.metering import Meter, host_cost, pure_cost
from urscript.run.methods import MethodCalls, Methods, kept
from urscript.run.threads import ProgramHalted, Scheduler, ScriptThread, join
from urscript.run.waits import NEXT_CYCLE, OUT_OF_UNITS, Wait
from urscript.values import Pose, log_form, wrap_int


def _halt() -> None:
    raise ProgramHalted


def _refuse(text: str) -> Any:
    raise ScriptRuntimeError(text)


_COMMON: Final[dict[str, Any]] = {
    "_MISSING": object(),
    "_NEXT_CYCLE": NEXT_CYCLE,
    "_UNDEFINED": variables.UNDEFINED,
    "_undefined": variables.undefined,
    "_Pose": Pose,
    "_pose": variables.make_pose,
    "_list": variables.make_list,
    "_item": variables.item,
    "_cell": variables.cell,
    "_store_item": variables.store_item,
    "_store_cell": variables.store_cell,
    "_member": variables.member,
    "_store_member": variables.store_member,
    "_store_inside": variables.store_inside,
    "_kept": kept,
    "_refuse": _refuse,
    "_truth": ops.truth,
    "_wrap": wrap_int,
    "_add": ops.add,
    "_sub": ops.sub,
    "_mul": ops.mul,
    "_div": ops.div,
    "_mod": ops.mod,
    "_neg": ops.neg,
    "_pos": ops.pos,
    "_equal": ops.equal,
    "_unequal": ops.unequal,
    "_less": ops.less,
    "_less_equal": ops.less_equal,
    "_greater": ops.greater,
    "_greater_equal": ops.greater_equal,
    "_join": join,
    "_halt": _halt,
    "_OUT_OF_UNITS": OUT_OF_UNITS,
}


_ARITHMETIC: Final = {
    "_add": "+",
    "_sub": "-",
    "_mul": "*",
    "_div": "/",
    "_mod": "%",
    "_neg": "-",
    "_pos": "+",
}


_ASSIGN: Final = {
    "free": variables.assign_resizing,
    "error": variables.assign,
    "capacity": variables.assign_within_capacity,
}


def base_namespace(dialect: Dialect, methods: Methods, meter: Meter) -> dict[str, Any]:
    """The names that do not depend on the host: operators and values."""
    calls = MethodCalls(methods)
    names = {
        **_COMMON,
        "_assign": _ASSIGN[dialect.list_resize],
        "_method": calls.call,
        "_change": calls.change,
    }
    if not dialect.array_arithmetic:
        names |= {name: ops.without_arrays(sign, _COMMON[name]) for name, sign in _ARITHMETIC.items()}
    return names | meter.operations(names)


def flow_namespace(scheduler: Scheduler, namespace: Mapping[str, Any], meter: Meter) -> dict[str, Any]:
    """The names with which a program calls its scheduler."""

    def run(function: Callable[[], Any], name: str, depth: int) -> ScriptThread:
        meter.charge(OF_THREAD, OF_THREAD)
        return scheduler.start(function, name, namespace["_T"], depth)

    return {"_run": run, "_kill": scheduler.kill, "_enter": scheduler.enter, "_leave": scheduler.leave}


# --- builtins ------------------------------------------------------------------------------------------


def builtin_namespace(names: Iterable[str], catalogue: Catalogue, host: Host, meter: Meter) -> dict[str, Any]:
    """The builtins that a program uses; those of the host check their arguments first."""
    offered = host.builtins()
    flow = _flow_builtins(host)
    bound: dict[str, Any] = {}
    for name in names:
        function = flow.get(name) or offered.get(name)
        if function is not None:
            bound[f"b_{name}"] = _checked(name, function, catalogue, meter)
        elif name in PURE:
            pure = _without_thread(PURE[name])
            bound[f"b_{name}"] = meter.function(pure, pure_cost(name), name)
        else:
            bound[f"b_{name}"] = _declared_only(name)
    return bound


def _flow_builtins(host: Host) -> dict[str, Callable[..., Any]]:
    """Builtins of the language: they need only the cycle time and the log of the robot."""

    def textmsg(thread: ScriptThread, first: Any, second: Any) -> None:
        host.textmsg(log_form(first) + log_form(second))

    def sleep(thread: ScriptThread, seconds: float) -> Generator[Wait, None, None]:
        # Whole cycles that cover the time; the small slack keeps 0.016 s at two.
        for _ in range(ceil(seconds / host.step_time - 1e-9)):
            yield NEXT_CYCLE

    return {"textmsg": textmsg, "varmsg": lambda thread, name, value: None, "sleep": sleep}


def _checked(
    name: str, function: Callable[..., Any], catalogue: Catalogue, meter: Meter
) -> Callable[..., Any]:
    """A builtin of the host, charged for, with the check of its arguments in front."""
    cost, builtin = host_cost(name), catalogue.lookup(name)
    if builtin is None or not builtin.params:
        return meter.function(function, cost, name)
    check = catalogue.check_of(name)
    if all(param.type in FIXED_SIZE for param in builtin.params):
        return meter.checked(function, cost, check)

    def call(thread: ScriptThread, *arguments: Any) -> Any:
        check(arguments)
        return function(thread, *arguments)

    return meter.function(call, cost, name)


def _without_thread(function: Callable[..., Any]) -> Callable[..., Any]:
    def call(thread: ScriptThread, *arguments: Any) -> Any:
        return function(*arguments)

    return call


def _declared_only(name: str) -> Callable[..., Any]:
    def call(thread: ScriptThread, *arguments: Any) -> Any:
        raise ScriptRuntimeError(
            f"{name} is declared only: this box does not model it yet (docs/urscript-coverage.md)"
        )

    return call
