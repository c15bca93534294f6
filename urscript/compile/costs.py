"""What code costs: statements, which have a limit, and units of work, which are time (see `run.metering`).

Both are known for a block before it runs; bodies of loops are counted at their iterations. What depends on
values, such as the length of a list, is charged when it runs. The weights come from measurements on one core
of 2026, in tenths of a unit of 50 ns.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, NamedTuple

from urscript.compile.inference import SCALARS, StaticTypes, Type, is_numeric
from urscript.names.scopes import FunctionScope
from urscript.syntax import nodes
from urscript.syntax.nodes import Block, Expression, Statement
from urscript.syntax.walk import child_expressions

_STATEMENT: Final = 6
_OF_NUMBERS: Final = 3
_LEAF: Final = 1
_STORE_ITEM: Final = 40
_STORE_CHECKED: Final = 12
_WEIGHTS: Final[dict[type[Expression], int]] = {
    nodes.BinaryOperation: 32,
    nodes.UnaryOperation: 8,
    nodes.Subscript: 14,
    nodes.Call: 30,
    nodes.MethodCall: 60,
    nodes.ListLiteral: 10,
    nodes.PoseLiteral: 40,
}
_ITEMS_OF_A_STATEMENT: Final = 16


class Cost(NamedTuple):
    """What one execution costs at most.

    Attributes:
        statements: As the language counts them.
        tenths: Of units.
    """

    statements: int
    tenths: int

    @property
    def extra(self) -> int:
        """Units beyond one a statement."""
        return max(0, self.tenths // 10 - self.statements)


def block_cost(block: Block, types: StaticTypes, scope: FunctionScope) -> Cost:
    """The cost of `block` in the function of `scope`."""
    statements = tenths = 0
    for statement in block:
        if isinstance(statement, nodes.If):
            conditions = [branch.condition for branch in statement.branches]
            bodies = [branch.body for branch in statement.branches]
            costs = [block_cost(body, types, scope) for body in [*bodies, statement.else_body or ()]]
            statements += 1 + max(cost.statements for cost in costs)
            tenths += max(cost.tenths for cost in costs) + expression_cost(conditions, types, scope)
        elif not isinstance(statement, (nodes.Function, nodes.Label)):
            statements += 1
            tenths += _STATEMENT + _statement_cost(statement, types, scope)
            value = getattr(statement, "value", None)
            if isinstance(value, nodes.ListLiteral):
                statements += len(value.items) // _ITEMS_OF_A_STATEMENT
    return Cost(statements, tenths)


def _statement_cost(statement: Statement, types: StaticTypes, scope: FunctionScope) -> int:
    match statement:
        case nodes.Assign(target=nodes.Name(name=name), value=value):
            checked = types.variable(name, scope) not in SCALARS
            return _STORE_CHECKED * checked + expression_cost((value,), types, scope)
        case nodes.Assign(target=target, value=value):
            return _STORE_ITEM + expression_cost((target, value), types, scope)
        case nodes.While(condition=condition):
            return expression_cost((condition,), types, scope)
        case nodes.ExpressionStatement(value=value) | nodes.Return(value=value):
            return 0 if value is None else expression_cost((value,), types, scope)
    return 0


def expression_cost(expressions: Iterable[Expression], types: StaticTypes, scope: FunctionScope) -> int:
    """Tenths of units of evaluating `expressions` and all their parts."""
    tenths = 0
    todo = list(expressions)
    while todo:
        one = todo.pop()
        if isinstance(one, nodes.BinaryOperation):
            operands = types.of(one.left, scope), types.of(one.right, scope)
            tenths += _OF_NUMBERS if _is_quick(one.operator, *operands) else _WEIGHTS[type(one)]
        elif not isinstance(one, nodes.Call) or scope.find_function(one.function) is not None:
            tenths += _WEIGHTS.get(type(one), _LEAF)  # builtins are charged when they are called
        todo += child_expressions(one)
    return tenths


def _is_quick(operator: str, left: Type, right: Type) -> bool:
    """Whether the operator is one of Python's in the compiled code (see `expressions`)."""
    if operator in ("and", "or", "xor"):
        return True
    if not (is_numeric(left) and is_numeric(right)) or operator == "%":
        return False
    return operator not in ("+", "-", "*") or Type.FLOAT in (left, right) or left is right is Type.INT
