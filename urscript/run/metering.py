"""What a program may do in a control cycle: statements have a limit, units of work spread it over cycles.

Two things are counted. *Statements* are the language's: a thread that runs `Dialect.statement_budget` of them
without a call that takes time ends with the controller's error. *Units* are time: one is what a simple
statement takes. A `WorkBudget` gets so many in each cycle, and saves some for programs that compute a lot now
and then. When they are used up, the program stands still with all its threads and goes on in the next cycle
at the same place: what needs more gets slower itself and computes the same. An operation that takes more than
was left makes a debt, which the next cycles pay. Nothing here reads a clock.

Compiled code counts its own statements and units (`compile.compiler`): `_b` is what is left of a grant, `_x`
the units beyond one a statement. Here are the charges that depend on values: arrays, texts, builtins.
"""

from collections.abc import Callable, Mapping
from math import inf
from typing import Any, Final

from urscript.catalogue.calls import Fitting
from urscript.catalogue.costs import OF_OTHERS, TEXT, UNITS
from urscript.errors import ScriptBudgetError
from urscript.values import CapacityList, Matrix, Pose, Struct, size_of

MOST_AT_ONCE: Final = 110_000
"""Units of the longest operation that is started, 5 ms: one on arrays cannot be interrupted. A longer one is
an error, as if it were a loop."""

_CALL_SHARE: Final = 30
"""A call of a builtin counts for one statement every so many units: the limit of statements is for loops, and
a program that computes a lot in calls gets slower instead."""

_LEAST_OF_HOST: Final = 10
_LEAST_OF_PURE: Final = 3
"""Statements that a cheap call counts for."""

_ELEMENT: Final = 5
"""Units that an operator takes for each element of an array (0.25 µs)."""

_OF_ELEMENT: Final = {
    "_list": 2,
    "_store_item": 1,
    "_store_cell": 2,
    "_store_member": 2,
    "_store_inside": 2,
    "_neg": _ELEMENT,
    "_pos": _ELEMENT,
}
_OF_TWO: Final = ("_add", "_sub", "_mul", "_div", "_mod", "_equal", "_unequal")

_METHOD: Final = 10
"""Units of a call of a method (0.5 µs); one that changes its list takes three times as long."""

_OF_METHOD: Final = {"to_string": 12, "slice": 1, "get_row": 1, "get_column": 1}
"""Units for each element of the value of a method; the others take the same time for all values."""

FREE_CALLS: Final = 16
"""Open calls of a thread that are resumed for nothing; more cost a unit each (25 to 40 ns), every time."""

CLOSING: Final = 5
"""Units to end each of them when the thread is killed (250 ns)."""

_SCALARS: Final = frozenset({int, float, bool})

Function = Callable[..., Any]


class WorkBudget:
    """Units of work of a control cycle, shared by programs.

    Args:
        per_cycle: Units that each cycle gives; without a limit where no client waits for the program.
        most: Units that one cycle may use when those before it used few.

    Attributes:
        left: Units that are left; below 0 it is a debt.
    """

    __slots__ = ("_most", "_per_cycle", "left")

    def __init__(self, per_cycle: float = inf, most: float = inf) -> None:
        self._per_cycle = per_cycle
        self._most = self.left = most

    def renew(self) -> None:
        """A cycle begins."""
        if self.left != self._most:
            self.left = min(self._most, self.left + self._per_cycle)


class Meter:
    """Counts for the threads of one program.

    Attributes:
        work: What the program may do in a cycle.
        statements: That the running thread may still run in its time slice.
    """

    def __init__(self, namespace: dict[str, Any], work: WorkBudget) -> None:
        self._namespace = namespace
        self._granted: float = 0
        self.work = work
        self.statements: float = 0
        namespace["_x"] = 0

    def grant(self, statements: float) -> None:
        """Let a thread with so many statements left use what is left of the cycle."""
        left = self.work.left
        self.statements = statements
        self._namespace["_b"] = self._granted = statements if statements < left else left

    def settle(self) -> float:
        """Book what was used of the grant; return the statements that are left, below 0 beyond the limit."""
        namespace = self._namespace
        left = namespace["_b"]
        used = self._granted - left
        if used:
            self._granted = left
            self.work.left -= used
            self.statements -= used - namespace["_x"]
            namespace["_x"] = 0
        return self.statements

    def charge(self, statements: int, units: int) -> None:
        """Charge an operation before it is done.

        Raises:
            ScriptBudgetError: it exceeds the limit of statements, or is too long to be done at once.
        """
        namespace = self._namespace
        left = namespace["_b"] - units
        namespace["_b"] = left
        namespace["_x"] += units - statements
        if left < 0 and (units > MOST_AT_ONCE or self.settle() < 0):
            raise ScriptBudgetError

    def operations(self, names: Mapping[str, Any]) -> dict[str, Function]:
        """The operations of `names` that may get arrays, charged for each element."""
        pairs = {name: self._pair(names[name], name == "_mul") for name in _OF_TWO}
        return {
            **pairs,
            **{name: self._change(names[name], units) for name, units in _OF_ELEMENT.items()},
            "_method": self._method(names["_method"]),
            "_change": self._method_that_changes(names["_change"]),
        }

    def function(self, function: Function, cost: tuple[int, int], name: str) -> Function:
        """A builtin, charged its statements and units, and for arrays among its arguments."""
        charge, (own, units) = self.charge, cost
        cubic, of_length = name == "inv", name == "make_list"
        of_element = 12 if name in TEXT else 3

        def call(*arguments: Any) -> Any:
            statements, work = own, units
            if of_length and type(arguments[1]) is int:
                work += max(0, arguments[1]) >> 4
            for argument in arguments:
                kind = type(argument)
                if kind is list:
                    elements = _elements(argument)
                    statements += elements >> 3
                    work += of_element * elements
                elif kind is str:
                    statements += len(argument) >> 3
                    work += len(argument) >> 3
                elif kind is Matrix:
                    cells = _product(argument, argument) if cubic else _cells(argument)
                    statements += cells
                    work += cells
                elif kind is Struct or kind is CapacityList:
                    size = size_of(argument)
                    statements += size >> 3
                    work += of_element * size
            charge(statements, work)
            return function(*arguments)

        return call

    def fitted(self, function: Function, cost: tuple[int, int], fit: Fitting) -> Function:
        """A builtin without long arguments, charged its statements and units; its arguments are fitted."""
        namespace, settle = self._namespace, self.settle
        statements, units = cost
        extra = units - statements

        def call(thread: Any, *arguments: Any) -> Any:
            namespace["_b"] = left = namespace["_b"] - units
            namespace["_x"] += extra
            if left < 0 and settle() < 0:
                raise ScriptBudgetError
            return function(thread, *fit(arguments))

        return call

    def _pair(self, operation: Function, product: bool) -> Function:
        charge = self.charge

        def operate(a: Any, b: Any) -> Any:
            first, second = type(a), type(b)
            if first in _SCALARS and second in _SCALARS:
                return operation(a, b)
            if first is str or second is str:
                length = len(a) + len(b) >> 3 if first is second else 0
                charge(length, 2 + length)
            elif isinstance(a, list) or isinstance(b, list):
                length = _elements(a if isinstance(a, list) else b)
                if first is Matrix:
                    cells = _cells(a)
                    charge(cells, 3 * cells)
                else:
                    charge(length >> 3, _ELEMENT * length)
            elif first is Matrix or second is Matrix:
                if product and first is second:
                    work = _product(a, b)
                    charge(work, work)
                else:
                    cells = _cells(a if first is Matrix else b)
                    charge(cells, 3 * cells)
            elif first is Pose and second is Pose:
                charge(0, 16)
            elif first is Struct and second is Struct:
                charge(a.size >> 3, _ELEMENT * a.size)
            return operation(a, b)

        return operate

    def _change(self, operation: Function, units: int) -> Function:
        """Charge an operation whose array is its last argument: a literal, a sign, a store."""
        charge = self.charge

        def operate(*arguments: Any) -> Any:
            array = arguments[-1]
            if isinstance(array, (list, Struct)):
                weight = _weight(array)
                charge(weight >> 3, units * weight)
            elif type(array) is Matrix:
                charge(_cells(array), units * _cells(array))
            return operation(*arguments)

        return operate

    def _method(self, method: Function) -> Function:
        """Charge a call of a method that looks at all elements of its value."""
        charge = self.charge

        def call(thread: Any, target: Any, name: str, *arguments: Any) -> Any:
            size = size_of(target) if name in _OF_METHOD else 0
            charge(size >> 3, _METHOD + _OF_METHOD.get(name, 0) * size)
            return method(thread, target, name, *arguments)

        return call

    def _method_that_changes(self, method: Function) -> Function:
        """Charge a call of a method that makes a list anew: the copy, and the look at each new element.

        It counts for no statements: on a controller the list is not copied.
        """
        charge = self.charge

        def call(thread: Any, name: str, arguments: list[Any], named: Any, steps: Any, root: Any) -> Any:
            copied = _weight(root) if isinstance(root, (list, Struct)) else 0
            charge(
                0,
                3 * _METHOD + (copied >> 3 if steps == [] else 2 * copied) + 3 * sum(map(size_of, arguments)),
            )
            return method(thread, name, arguments, named, steps, root)

        return call


def call_cost(name: str, *, is_pure: bool) -> tuple[int, int]:
    """Statements and units of a call of a builtin, of the host or a pure one."""
    units = UNITS.get(name, OF_OTHERS)
    return max(_LEAST_OF_PURE if is_pure else _LEAST_OF_HOST, units // _CALL_SHARE), units


def _elements(items: list[Any]) -> int:
    """Elements of a list, with what is in them."""
    return size_of(items) if items and type(items[0]) in (str, Struct) else len(items)


def _weight(value: list[Any] | Struct) -> int:
    """Values that are copied, or counted anew, when something inside `value` changes."""
    if isinstance(value, Struct):
        return value.size
    return len(value) + (value[0].size if value and type(value[0]) is Struct else 0)


def _cells(matrix: Matrix) -> int:
    rows, columns = matrix.shape
    return 2 * rows * columns


def _product(first: Matrix, second: Matrix) -> int:
    """Statements that multiplying two matrices counts for; inverting one takes about as long."""
    rows, columns = first.shape
    return 4 * rows * columns * second.shape[1]
