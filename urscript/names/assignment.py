"""Which variables may be read before anything was assigned to them.

Only those need a test at every read; for all others the order of the text shows that they are set.
"""

from __future__ import annotations

from collections.abc import Iterable

from urscript.names.scopes import FunctionScope, ResolvedProgram
from urscript.syntax import nodes
from urscript.syntax.nodes import Block, Expression
from urscript.syntax.walk import all_expressions, all_statements, own_expressions


def find_unsure(program: ResolvedProgram) -> None:
    """Fill `unsure` of every function and `unsure_globals` of the program."""
    read_elsewhere: set[str] = set()
    for scope in program.functions:
        parameters = {item.name for item in scope.node.parameters} if scope.node else set()
        _Flow(scope, scope.locals, scope.unsure, parameters).block(scope.body)
        for name in _names_read(scope):
            if name not in scope.locals:
                read_elsewhere.add(name)
    flow = _Flow(program.main, program.globals, program.unsure_globals, set())
    flow.block(program.main.body)
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
    """Walks one body in order; the time it takes grows with the length of the text and nothing else.

    Attributes:
        names: The variables watched.
        unsure: Receives those read too early.
        known: Those surely set where the walk is.
        set_before_calls: What is set at every call of a user function; None without such a call.
    """

    def __init__(self, scope: FunctionScope, names: set[str], unsure: set[str], known: set[str]) -> None:
        self.scope = scope
        self.names = names
        self.unsure = unsure
        self.known = known
        self.set_before_calls: set[str] | None = None
        self._forgotten: set[str] = set()

    def block(self, block: Block) -> list[str]:
        """Walk `block`; returns what is known after it and was not before."""
        learnt: list[str] = []
        for statement in block:
            match statement:
                case nodes.Assign(target=nodes.Name(name=name), value=value):
                    self.expression(value)
                    self.learn([name], learnt)
                case nodes.If(arms=arms, otherwise=otherwise):
                    self.learn(self.branches(arms, otherwise), learnt)
                case nodes.While(condition=condition, body=body):
                    self.expression(condition)
                    self.forget(self.block(body))
                case nodes.Declare(name=name):
                    # A bare declaration sets nothing.
                    if name not in self.known:
                        self.unsure.add(name)
                case _:
                    for expression in own_expressions(statement):
                        self.expression(expression)
        return learnt

    def branches(self, arms: tuple[nodes.Arm, ...], otherwise: Block | None) -> set[str]:
        """Walk all branches of an `if`; a variable is set after it when every branch sets it."""
        outcomes = []
        for arm in arms:
            self.expression(arm.condition)
            outcomes.append(self.block(arm.body))
            self.forget(outcomes[-1])
        outcomes.append(self.block(otherwise or ()))
        self.forget(outcomes[-1])
        return set.intersection(*map(set, outcomes))

    def learn(self, names: Iterable[str], learnt: list[str]) -> None:
        """From here on `names` are known; those that were not before go into `learnt` too."""
        for name in names:
            if name not in self.known:
                self.known.add(name)
                learnt.append(name)

    def forget(self, names: list[str]) -> None:
        """Leave a block: what it taught is not sure outside of it."""
        self.known.difference_update(names)
        self._forgotten.update(names)

    def expression(self, expression: Expression) -> None:
        """Note what `expression` reads that is not surely set."""
        for part in all_expressions(expression):
            if isinstance(part, nodes.Name):
                if part.name in self.names and part.name not in self.known:
                    self.unsure.add(part.name)
            elif isinstance(part, (nodes.Call, nodes.Run)):
                name = part.function if isinstance(part, nodes.Call) else part.thread
                if self.scope.find_function(name) is not None:
                    self.note_call()

    def note_call(self) -> None:
        """Keep of `set_before_calls` what is known at this call too: all but what was forgotten since."""
        if self.set_before_calls is None:
            self.set_before_calls = set(self.known)
        else:
            self.set_before_calls -= self._forgotten - self.known
        self._forgotten.clear()
