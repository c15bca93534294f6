"""Definite assignment: which variables may be read before a value is assigned to them.

Only those need a test at every read; for all others the order of the statements shows that they have a value.
"""

from __future__ import annotations

from collections.abc import Iterable

from urscript.names.scopes import FunctionScope, ResolvedProgram
from urscript.syntax import nodes
from urscript.syntax.nodes import Block, Expression
from urscript.syntax.walk import all_expressions, all_statements, own_expressions


def find_maybe_unassigned(program: ResolvedProgram) -> None:
    """Set `maybe_unassigned` of every function and `maybe_unassigned_globals` of the program."""
    read_elsewhere: set[str] = set()
    for scope in program.functions:
        parameters = {item.name for item in scope.node.parameters} if scope.node else set()
        _AssignmentAnalysis(scope, scope.locals, scope.maybe_unassigned, parameters).block(scope.body)
        for name in _names_read(scope):
            if name not in scope.locals:
                read_elsewhere.add(name)
    analysis = _AssignmentAnalysis(program.main, program.globals, program.maybe_unassigned_globals, set())
    analysis.block(program.main.body)
    # The order of assignments in functions is not known.
    if program.is_open:
        program.maybe_unassigned_globals |= program.globals
    elif analysis.set_before_calls is not None:
        program.maybe_unassigned_globals |= (read_elsewhere & program.globals) - analysis.set_before_calls


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


class _AssignmentAnalysis:
    """Walks one body in order, in time that is linear in its length.

    Attributes:
        names: The variables to analyse.
        maybe_unassigned: Receives those that may be read too early.
        assigned: Those with a value at the present statement.
        set_before_calls: Variables with a value at every call of a user function; None without such a call.
    """

    def __init__(
        self, scope: FunctionScope, names: set[str], maybe_unassigned: set[str], assigned: set[str]
    ) -> None:
        self.scope = scope
        self.names = names
        self.maybe_unassigned = maybe_unassigned
        self.assigned = assigned
        self.set_before_calls: set[str] | None = None
        self._left: set[str] = set()

    def block(self, block: Block) -> list[str]:
        """Walk `block`; returns the variables that it assigns for the first time."""
        newly_assigned: list[str] = []
        for statement in block:
            match statement:
                case nodes.Assign(target=nodes.Name(name=name), value=value):
                    self.expression(value)
                    self.assign([name], newly_assigned)
                case nodes.If(branches=branches, else_body=else_body):
                    self.assign(self.branches(branches, else_body), newly_assigned)
                case nodes.While(condition=condition, body=body):
                    self.expression(condition)
                    self.leave_block(self.block(body))
                case nodes.Declaration(name=name):
                    # A declaration assigns no value.
                    if name not in self.assigned:
                        self.maybe_unassigned.add(name)
                case _:
                    for expression in own_expressions(statement):
                        self.expression(expression)
        return newly_assigned

    def branches(self, branches: tuple[nodes.Branch, ...], else_body: Block | None) -> set[str]:
        """Walk all branches of an `if`; a variable is assigned after it if every branch assigns it."""
        outcomes = []
        for branch in branches:
            self.expression(branch.condition)
            outcomes.append(self.block(branch.body))
            self.leave_block(outcomes[-1])
        outcomes.append(self.block(else_body or ()))
        self.leave_block(outcomes[-1])
        return set.intersection(*map(set, outcomes))

    def assign(self, names: Iterable[str], newly_assigned: list[str]) -> None:
        """Mark `names` as assigned; append those that were not to `newly_assigned`."""
        for name in names:
            if name not in self.assigned:
                self.assigned.add(name)
                newly_assigned.append(name)

    def leave_block(self, names: list[str]) -> None:
        """Leave a block: outside of it, its assignments are not certain."""
        self.assigned.difference_update(names)
        self._left.update(names)

    def expression(self, expression: Expression) -> None:
        """Record the variables that `expression` reads and that may have no value."""
        for part in all_expressions(expression):
            if isinstance(part, nodes.Name):
                if part.name in self.names and part.name not in self.assigned:
                    self.maybe_unassigned.add(part.name)
            elif isinstance(part, (nodes.Call, nodes.RunThread)):
                name = part.function if isinstance(part, nodes.Call) else part.thread
                if self.scope.find_function(name) is not None:
                    self.record_call()

    def record_call(self) -> None:
        """Remove from `set_before_calls` what is not assigned at this call."""
        if self.set_before_calls is None:
            self.set_before_calls = set(self.assigned)
        else:
            self.set_before_calls -= self._left - self.assigned
        self._left.clear()
