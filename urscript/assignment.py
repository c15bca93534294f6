"""Which variables may be read before anything was assigned to them.

Only those need a test at every read; for all others the order of the text shows that they are set.
"""

from __future__ import annotations

from urscript import nodes
from urscript.nodes import Block, Expression
from urscript.scopes import FunctionScope, ResolvedProgram
from urscript.walk import all_expressions, all_statements, own_expressions


def find_unsure(program: ResolvedProgram) -> None:
    """Fill `unsure` of every function and `unsure_globals` of the program."""
    read_elsewhere: set[str] = set()
    for scope in program.functions:
        parameters = {item.name for item in scope.node.parameters} if scope.node else set()
        flow = _Flow(scope, scope.locals, scope.unsure)
        flow.block(scope.body, parameters)
        for name in _names_read(scope):
            if name not in scope.locals:
                read_elsewhere.add(name)
    flow = _Flow(program.main, program.globals, program.unsure_globals)
    flow.block(program.main.body, set())
    # What only functions assign is set in an order that the text does not show.
    if flow.set_before_calls is not None:
        program.unsure_globals |= (read_elsewhere & program.globals) - flow.set_before_calls


def _names_read(scope: FunctionScope) -> set[str]:
    """Names in the expressions of a function, its defaults included."""
    expressions = [e for statement in all_statements(scope.body) for e in own_expressions(statement)]
    if scope.node is not None:
        expressions += [item.default for item in scope.node.parameters if item.default is not None]
    return {
        part.name
        for expression in expressions
        for part in all_expressions(expression)
        if isinstance(part, nodes.Name)
    }


class _Flow:
    """Walks one body in order.

    Attributes:
        names: The variables watched.
        unsure: Receives those read too early.
        set_before_calls: What is set at every call of a user function; None without such a call.
    """

    def __init__(self, scope: FunctionScope, names: set[str], unsure: set[str]) -> None:
        self.scope = scope
        self.names = names
        self.unsure = unsure
        self.set_before_calls: set[str] | None = None

    def block(self, block: Block, known: set[str]) -> set[str]:
        """Walk `block` where `known` are surely set; returns those surely set after it."""
        for statement in block:
            match statement:
                case nodes.Assign(target=nodes.Name(name=name), value=value):
                    self.expression(value, known)
                    known = known | {name}
                case nodes.If(arms=arms, otherwise=otherwise):
                    known = self.branches(arms, otherwise, known)
                case nodes.While(condition=condition, body=body):
                    self.expression(condition, known)
                    self.block(body, known)
                case nodes.Declare(name=name):
                    # A bare declaration sets nothing.
                    if name not in known:
                        self.unsure.add(name)
                case _:
                    for expression in own_expressions(statement):
                        self.expression(expression, known)
        return known

    def branches(self, arms: tuple[nodes.Arm, ...], otherwise: Block | None, known: set[str]) -> set[str]:
        """Walk all branches of an `if`; a variable is set after it when every branch sets it."""
        outcomes = []
        for arm in arms:
            self.expression(arm.condition, known)
            outcomes.append(self.block(arm.body, known))
        outcomes.append(self.block(otherwise or (), known))
        return set.intersection(*outcomes)

    def expression(self, expression: Expression, known: set[str]) -> None:
        """Note what `expression` reads that is not surely set."""
        for part in all_expressions(expression):
            if isinstance(part, nodes.Name):
                if part.name in self.names and part.name not in known:
                    self.unsure.add(part.name)
            elif isinstance(part, (nodes.Call, nodes.Run)):
                name = part.function if isinstance(part, nodes.Call) else part.thread
                if self.scope.find_function(name) is not None:
                    self.set_before_calls = known & (
                        known if self.set_before_calls is None else self.set_before_calls
                    )
