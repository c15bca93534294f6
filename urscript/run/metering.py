"""Charges the budget of a cycle for operations that take longer than a statement: arrays, strings, builtins.

The compiler counts statements. An operation on a matrix, or a call of inverse kinematics, takes as long as
hundreds of them; without a charge, a loop of it would block the control cycle for minutes before the budget
is exceeded. An operation that costs more than the rest of the budget is not started.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from urscript.errors import ScriptBudgetError
from urscript.values import Matrix

COSTS: Final = {
    "get_inverse_kin": 300,
    "get_inverse_kin_has_solution": 300,
    "is_within_safety_limits": 300,
    "str_cat": 30,
    "to_str": 30,
    "textmsg": 30,
    "popup": 30,
    "socket_send_line": 30,
    "socket_send_string": 30,
}
"""Builtin -> number of statements that a call counts for (C): the slowest ones, by measurement."""

HOST_COST: Final = 10
"""Of every other builtin of the host."""

PURE_COST: Final = 3
"""Of every other pure function."""

START_COST: Final = 100
"""Of starting a thread."""

_OF_TWO: Final = ("_add", "_sub", "_mul", "_div", "_mod", "_equal", "_unequal")
_OF_ONE_ARRAY: Final = ("_neg", "_pos", "_list", "_store_item", "_store_cell")
"""Operations of compiled programs whose operands may be arrays (see `runtime`)."""

_SCALARS: Final = frozenset({int, float, bool})

Function = Callable[..., Any]


class Meter:
    """Subtracts costs from the budget of the running thread.

    Args:
        namespace: The globals of the compiled program; `_b` is what is left for this cycle.
    """

    def __init__(self, namespace: dict[str, Any]) -> None:
        self._namespace = namespace

    def charge(self, statements: int) -> None:
        """Charge the cost of `statements`; raises ScriptBudgetError when it exceeds the budget."""
        left = self._namespace["_b"] - statements
        self._namespace["_b"] = left
        if left < 0:
            raise ScriptBudgetError

    def operations(self, names: Mapping[str, Any]) -> dict[str, Function]:
        """The operations of `names` that may get arrays, charged for each element."""
        pairs = {name: self._pair(names[name], name == "_mul") for name in _OF_TWO}
        return pairs | {name: self._change(names[name]) for name in _OF_ONE_ARRAY}

    def function(self, function: Function, cost: int, name: str) -> Function:
        """A builtin, charged for the call and for arrays among its arguments."""
        charge = self.charge
        cubic = name == "inv"

        def call(*arguments: Any) -> Any:
            work = cost
            for argument in arguments:
                kind = type(argument)
                if kind is list or kind is str:
                    work += len(argument) >> 3
                elif kind is Matrix:
                    work += _product(argument, argument) if cubic else _cells(argument)
            charge(work)
            return function(*arguments)

        return call

    def checked(self, function: Function, cost: int, check: Callable[[Sequence[Any]], None]) -> Function:
        """A builtin without long arguments, charged for the call; its arguments are checked."""
        namespace = self._namespace

        def call(thread: Any, *arguments: Any) -> Any:
            namespace["_b"] = left = namespace["_b"] - cost
            if left < 0:
                raise ScriptBudgetError
            check(arguments)
            return function(thread, *arguments)

        return call

    def _pair(self, operation: Function, product: bool) -> Function:
        charge = self.charge

        def operate(a: Any, b: Any) -> Any:
            first, second = type(a), type(b)
            if first in _SCALARS and second in _SCALARS:
                return operation(a, b)
            if first is list or first is str:
                charge(len(a) >> 3)
            elif first is Matrix:
                charge(_product(a, b) if product and second is Matrix else _cells(a))
            elif second is list:
                charge(len(b) >> 3)
            elif second is Matrix:
                charge(_cells(b))
            return operation(a, b)

        return operate

    def _change(self, operation: Function) -> Function:
        """Charge an operation whose array is its last argument: a literal, a sign, a store."""
        charge = self.charge

        def operate(*arguments: Any) -> Any:
            array = arguments[-1]
            if type(array) is list:
                charge(len(array) >> 3)
            elif type(array) is Matrix:
                charge(_cells(array))
            return operation(*arguments)

        return operate


def _cells(matrix: Matrix) -> int:
    rows, columns = matrix.shape
    return 2 * rows * columns


def _product(first: Matrix, second: Matrix) -> int:
    """Statements that multiplying two matrices counts for; inverting one takes about as long."""
    rows, columns = first.shape
    return 4 * rows * columns * second.shape[1]
