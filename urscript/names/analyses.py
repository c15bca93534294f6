"""Analyses of a resolved program: what may be read unassigned, may block, is recursive, how deep it calls."""

from collections.abc import Iterable

from urscript.names.scopes import FunctionScope, ResolvedProgram
from urscript.syntax import nodes
from urscript.syntax.nodes import Block, Expression, all_expressions, all_statements, own_expressions


def find_maybe_unassigned(program: ResolvedProgram) -> None:
    """Set `maybe_unassigned` of every function and `maybe_unassigned_globals` of the program."""
    read_elsewhere: set[str] = set()
    for scope in program.functions:
        parameters = {item.name for item in scope.node.parameters} if scope.node else set()
        _AssignmentAnalysis(scope, scope.locals, scope.maybe_unassigned, parameters).block(scope.body)
        read_elsewhere |= _names_read(scope) - scope.locals
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
        """Mark `names` as assigned; append the new ones to `newly_assigned`."""
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


# --- the call graph; every call is visited once ---------------------------------------------------------


def spread_blocking(program: ResolvedProgram) -> None:
    """Mark the functions that may block because one that they call may."""
    callers = _callers(program)
    todo = [scope for scope in program.scopes() if scope.blocks]
    while todo:
        for caller in callers.get(todo.pop(), ()):
            if not caller.blocks:
                caller.blocks = True
                todo.append(caller)


def mark_recursion(program: ResolvedProgram) -> None:
    """Mark the functions that can call themselves, directly or through others, and how deep all call."""
    for members in _components(program):
        callees = {callee for member in members for callee in member.callees}
        is_recursive = len(members) > 1 or not callees.isdisjoint(members)
        below = callees.difference(members)
        # A function of the program that statements belong to knows its depth already.
        depth = max(scope.depth for scope in members)
        depth = max([depth, *(callee.depth + (not is_recursive) for callee in below)])
        for member in members:
            member.recursive, member.depth = is_recursive, depth


def _callers(program: ResolvedProgram) -> dict[FunctionScope, list[FunctionScope]]:
    callers: dict[FunctionScope, list[FunctionScope]] = {}
    for scope in program.scopes():
        for callee in scope.callees:
            callers.setdefault(callee, []).append(scope)
    return callers


def _components(program: ResolvedProgram) -> list[list[FunctionScope]]:
    """Functions that all reach one another, those that others call first (Kosaraju), without recursion."""
    finished: dict[FunctionScope, None] = {}
    seen: set[FunctionScope] = set()
    for root in program.scopes():
        path = [(root, iter(root.callees))] if root not in seen else []
        seen.add(root)
        while path:
            callees = path[-1][1]
            callee = next((callee for callee in callees if callee not in seen), None)
            if callee is None:
                finished[path.pop()[0]] = None
            else:
                seen.add(callee)
                path.append((callee, iter(callee.callees)))
    callers = _callers(program)
    components = []
    while finished:
        members = [finished.popitem()[0]]
        for member in members:
            for caller in callers.get(member, ()):
                if caller in finished:
                    del finished[caller]
                    members.append(caller)
        components.append(members)
    return components[::-1]
