"""Static types where they are evident, so that the compiler can leave run-time checks out.

A sound guess over the whole program: a variable has the type that all assignments to it share, a parameter
the one of all calls, a function the one of all its returns; everything else is ANY. Nothing here can make
a program fail: an operation on ANY is checked when it runs.
"""

from __future__ import annotations

from collections import deque
from enum import Enum
from typing import Any

from urscript import dialect
from urscript.catalogue import Catalogue
from urscript.names.scopes import FunctionScope, ResolvedProgram
from urscript.syntax import nodes
from urscript.syntax.nodes import Expression
from urscript.syntax.walk import all_expressions, all_statements, falls_through, own_expressions


class Type(Enum):
    """What is known about a value before the program runs."""

    NEVER = "no value yet"
    INT = "int"
    FLOAT = "float"
    NUMBER = "int or float"
    BOOL = "bool"
    STRING = "string"
    NUMBERS = "list of numbers"
    POSE = "pose"
    NONE = "none"
    ANY = "any"


_NUMBERS = frozenset({Type.INT, Type.FLOAT, Type.NUMBER})
SCALARS = _NUMBERS | {Type.BOOL, Type.STRING}
"""Types of variables that need no check when something is assigned to them."""


_ELEMENT = {Type.NEVER: Type.NEVER, Type.POSE: Type.FLOAT, Type.NUMBERS: Type.NUMBER}
"""Types of `x[i]` by that of x."""


def is_number(kind: Type) -> bool:
    """Whether values of this type are numbers."""
    return kind in _NUMBERS


def join(a: Type, b: Type) -> Type:
    """The type of something that is sometimes `a`, sometimes `b`."""
    if a is b or b is Type.NEVER:
        return a
    if a is Type.NEVER:
        return b
    return Type.NUMBER if a in _NUMBERS and b in _NUMBERS else Type.ANY


Goal = tuple[FunctionScope | None, str] | FunctionScope
"""What has a type: a local of a function, a global (None) of the program, the result of a function."""

Flow = tuple[Goal, Expression | None, FunctionScope]
"""Where a value goes, the expression it comes from (None: the end of a function), the scope it is read in."""


class StaticTypes:
    """The types of the variables, parameters and functions of one program."""

    def __init__(self, program: ResolvedProgram, catalogue: Catalogue) -> None:
        self._program = program
        self._catalogue = catalogue
        self._types: dict[Goal, Type] = {}
        self._flows = _Flows(program)
        self._settle()

    def variable(self, name: str, scope: FunctionScope) -> Type:
        """The type of variable `name` as seen in `scope`."""
        if name in scope.locals:
            return self._types.get((scope, name), Type.NEVER)
        if name in self._program.globals:
            return self._types.get((None, name), Type.NEVER)
        return Type.FLOAT

    def of(self, expression: Expression, scope: FunctionScope) -> Type:
        """The type of `expression` in `scope`."""
        match expression:
            case nodes.Name(name=name):
                return self.variable(name, scope)
            case nodes.IntLiteral():
                return Type.INT
            case nodes.FloatLiteral():
                return Type.FLOAT
            case nodes.Binary():
                return self._binary(expression, scope)
            case nodes.Call(function=name):
                return self._call(name, scope)
            case nodes.Index(target=target, indices=(_,)):
                return _ELEMENT.get(self.of(target, scope), Type.ANY)
            case nodes.BoolLiteral() | nodes.Prefix(operator="not"):
                return Type.BOOL
            case nodes.StringLiteral():
                return Type.STRING
            case nodes.Prefix(operand=operand):
                kind = self.of(operand, scope)
                return kind if kind in _NUMBERS or kind is Type.NEVER else Type.ANY
            case nodes.PoseLiteral():
                return Type.POSE
            case nodes.ListLiteral(items=items) if items:
                kinds = {self.of(item, scope) for item in items}
                if Type.NEVER in kinds:
                    return Type.NEVER
                if kinds <= _NUMBERS:
                    return Type.NUMBERS
            case nodes.NoneLiteral():
                return Type.NONE
        return Type.ANY

    def _binary(self, expression: nodes.Binary, scope: FunctionScope) -> Type:
        operator = expression.operator
        if operator not in _ARITHMETIC:
            return Type.BOOL
        left, right = self.of(expression.left, scope), self.of(expression.right, scope)
        if left is Type.NEVER or right is Type.NEVER:
            return Type.NEVER
        if left in _NUMBERS and right in _NUMBERS:
            if operator == "/":
                return Type.NUMBER if dialect.EXACT_DIVISION_GIVES_INT else Type.FLOAT
            if left is Type.INT and right is Type.INT:
                return Type.INT
            return Type.FLOAT if Type.FLOAT in (left, right) else Type.NUMBER
        if operator == "+" and left is Type.STRING and right is Type.STRING:
            return Type.STRING
        if {left, right} <= _NUMBERS | {Type.NUMBERS}:
            return Type.NUMBERS
        return Type.ANY

    def _call(self, name: str, scope: FunctionScope) -> Type:
        callee = scope.find_function(name)
        if callee is not None:
            return self._types.get(callee, Type.NEVER)
        builtin = self._catalogue.lookup(name)
        return _declared_type(builtin.returns) if builtin is not None else Type.ANY

    def _settle(self) -> None:
        """Go through all flows, then again through those that read what has widened, until nothing does.

        Types only ever widen, and in three steps at most, so each flow is looked at a few times for each
        thing that it reads.
        """
        flows = self._flows.all
        readers = self._readers(flows)
        queued = [True] * len(flows)
        todo = deque(range(len(flows)))
        while todo:
            number = todo.popleft()
            queued[number] = False
            goal, expression, scope = flows[number]
            old = self._types.get(goal, Type.NEVER)
            new = join(old, Type.NONE if expression is None else self.of(expression, scope))
            if new is not old:
                self._types[goal] = new
                for reader in readers.get(goal, ()):
                    if not queued[reader]:
                        queued[reader] = True
                        todo.append(reader)

    def _readers(self, flows: list[Flow]) -> dict[Goal, list[int]]:
        """The flows whose expressions read a variable or the result of a function, by that."""
        readers: dict[Goal, list[int]] = {}
        for number, (_, expression, scope) in enumerate(flows):
            for part in all_expressions(expression) if expression is not None else ():
                goal: Goal
                if isinstance(part, nodes.Name):
                    goal = (scope if part.name in scope.locals else None, part.name)
                elif isinstance(part, nodes.Call) and (callee := scope.find_function(part.function)):
                    goal = callee
                else:
                    continue
                readers.setdefault(goal, []).append(number)
        return readers


class _Flows:
    """Which expressions end up in which variable, and which are results of which function."""

    def __init__(self, program: ResolvedProgram) -> None:
        self.all: list[Flow] = []
        for scope in program.scopes():
            self._statements(scope)
            if scope.node is not None and scope.parent is not None:
                self._defaults(scope, scope.node, scope.around())

    def _statements(self, scope: FunctionScope) -> None:
        for statement in all_statements(scope.body):
            match statement:
                case nodes.Assign(target=nodes.Name(name=name), value=value, scope=qualifier):
                    is_local = name in scope.locals and qualifier != "global"
                    self.all.append(((scope if is_local else None, name), value, scope))
                case nodes.Return(value=value) if scope.parent is not None:
                    self.all.append((scope, value, scope))
            for expression in own_expressions(statement):
                self._calls(expression, scope)
        if scope.parent is not None and falls_through(scope.body):
            self.all.append((scope, None, scope))

    def _defaults(self, scope: FunctionScope, node: nodes.Function, outside: FunctionScope) -> None:
        for parameter in node.parameters:
            if parameter.default is not None:
                self.all.append(((scope, parameter.name), parameter.default, outside))
                self._calls(parameter.default, outside)

    def _calls(self, expression: Expression, scope: FunctionScope) -> None:
        for part in all_expressions(expression):
            if not isinstance(part, nodes.Call):
                continue
            callee = scope.find_function(part.function)
            if callee is None or callee.node is None:
                continue
            for position, argument in enumerate(part.arguments):
                name = argument.name or callee.node.parameters[position].name
                self.all.append(((callee, name), argument.value, scope))


_ARITHMETIC = frozenset("+-*/%")
_DECLARED = {
    "None": Type.NONE,
    "bool": Type.BOOL,
    "int": Type.INT,
    "float": Type.FLOAT,
    "string": Type.STRING,
    "number": Type.NUMBER,
    "int or float": Type.NUMBER,
    "pose": Type.POSE,
    "pose m": Type.POSE,
    "list of number + 1": Type.NUMBERS,
}


def _declared_type(returns: str) -> Any:
    """The type a catalogue row declares for its result, read from the words before the unit."""
    kind = returns.partition(",")[0]
    if kind.startswith("list of ") and kind.removeprefix("list of ").isdigit():
        return Type.NUMBERS
    return _DECLARED.get(kind, Type.ANY)
