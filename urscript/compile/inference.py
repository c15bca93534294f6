"""Type inference over the whole program, so that the compiler can omit run-time checks.

A variable has the type that all assignments to it have in common, a parameter that of all calls, a function
that of all its returns; everything else is ANY. Inference reports no errors: an operation on ANY is checked
at run time.
"""

from collections import deque
from collections.abc import Iterator
from enum import Enum
from typing import Any

from urscript.catalogue import Catalogue
from urscript.names.living_scope import calling_scopes
from urscript.names.scopes import FunctionScope, ResolvedProgram, wrong_count
from urscript.syntax import nodes
from urscript.syntax.nodes import Expression, all_expressions, all_statements, falls_through, own_expressions


class Type(Enum):
    """Static type of a value."""

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


NUMERIC = frozenset({Type.INT, Type.FLOAT, Type.NUMBER})
"""Types of numbers."""

SCALARS = NUMERIC | {Type.BOOL, Type.STRING}
"""Types of variables that need no check when something is assigned to them."""


_ELEMENT = {Type.NEVER: Type.NEVER, Type.POSE: Type.FLOAT, Type.NUMBERS: Type.NUMBER}
"""Types of `x[i]` by that of x."""


def join_types(a: Type, b: Type) -> Type:
    """The least type that has the values of both `a` and `b`."""
    if a is b or b is Type.NEVER:
        return a
    if a is Type.NEVER:
        return b
    return Type.NUMBER if a in NUMERIC and b in NUMERIC else Type.ANY


Symbol = tuple[FunctionScope | None, str] | FunctionScope
"""What has a type: a local of a function, a global (None) of the program, the result of a function."""

Constraint = tuple[Symbol, Expression | None, FunctionScope]
"""A symbol, an expression whose value it gets (None: the end of a function), the scope of the expression."""


class StaticTypes:
    """The types of the variables, parameters and functions of one program."""

    def __init__(self, program: ResolvedProgram, catalogue: Catalogue) -> None:
        self._program = program
        self._catalogue = catalogue
        self._types: dict[Symbol, Type] = dict.fromkeys(_unknown(program), Type.ANY)
        self._solve(list(_constraints(program)))

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
            case nodes.BinaryOperation():
                return self._binary(expression, scope)
            case nodes.Call(function=name):
                return self._call(name, scope)
            case nodes.Subscript(target=target, indices=(_,)):
                return _ELEMENT.get(self.of(target, scope), Type.ANY)
            case nodes.BoolLiteral() | nodes.UnaryOperation(operator="not"):
                return Type.BOOL
            case nodes.StringLiteral():
                return Type.STRING
            case nodes.UnaryOperation(operand=operand):
                kind = self.of(operand, scope)
                return kind if kind in NUMERIC or kind is Type.NEVER else Type.ANY
            case nodes.PoseLiteral():
                return Type.POSE
            case nodes.ListLiteral(items=items) if items:
                kinds = {self.of(item, scope) for item in items}
                if Type.NEVER in kinds:
                    return Type.NEVER
                if kinds <= NUMERIC:
                    return Type.NUMBERS
            case nodes.NoneLiteral():
                return Type.NONE
        return Type.ANY

    def _binary(self, expression: nodes.BinaryOperation, scope: FunctionScope) -> Type:
        operator = expression.operator
        if operator not in _ARITHMETIC:
            return Type.BOOL
        left, right = self.of(expression.left, scope), self.of(expression.right, scope)
        if left is Type.NEVER or right is Type.NEVER:
            return Type.NEVER
        if left in NUMERIC and right in NUMERIC:
            if operator == "/":
                return Type.FLOAT
            if left is Type.INT and right is Type.INT:
                return Type.INT
            return Type.FLOAT if Type.FLOAT in (left, right) else Type.NUMBER
        if operator == "+" and left is Type.STRING and right is Type.STRING:
            return Type.STRING
        if {left, right} <= NUMERIC | {Type.NUMBERS}:
            return Type.NUMBERS
        return Type.ANY

    def _call(self, name: str, scope: FunctionScope) -> Type:
        callee = scope.find_function(name)
        if callee is not None:
            return self._types.get(callee, Type.NEVER)
        builtin = self._catalogue.lookup(name)
        return _declared_type(builtin.returns) if builtin is not None else Type.ANY

    def _solve(self, constraints: list[Constraint]) -> None:
        """Apply all constraints, then again those that read a widened symbol, until no type changes.

        Types only widen, in at most three steps, so each constraint is applied a few times for each symbol
        that it reads.
        """
        readers = self._readers(constraints)
        queued = [True] * len(constraints)
        todo = deque(range(len(constraints)))
        while todo:
            number = todo.popleft()
            queued[number] = False
            symbol, expression, scope = constraints[number]
            old = self._types.get(symbol, Type.NEVER)
            new = join_types(old, Type.NONE if expression is None else self.of(expression, scope))
            if new is not old:
                self._types[symbol] = new
                for reader in readers.get(symbol, ()):
                    if not queued[reader]:
                        queued[reader] = True
                        todo.append(reader)

    def _readers(self, constraints: list[Constraint]) -> dict[Symbol, list[int]]:
        """Numbers of the constraints whose expressions read a symbol, by symbol."""
        readers: dict[Symbol, list[int]] = {}
        for number, (_, expression, scope) in enumerate(constraints):
            for part in all_expressions(expression) if expression is not None else ():
                symbol: Symbol
                if isinstance(part, nodes.Name):
                    symbol = (scope if part.name in scope.locals else None, part.name)
                elif isinstance(part, nodes.Call) and (callee := scope.find_function(part.function)):
                    symbol = callee
                else:
                    continue
                readers.setdefault(symbol, []).append(number)
        return readers


def _constraints(program: ResolvedProgram) -> Iterator[Constraint]:
    for scope in program.scopes():
        for statement in all_statements(scope.body):
            match statement:
                case nodes.Assign(target=nodes.Name(name=name), value=value, scope=qualifier):
                    is_local = name in scope.locals and qualifier != "global"
                    yield (scope if is_local else None, name), value, scope
                case nodes.Return(value=value) if scope.parent is not None:
                    yield scope, value, scope
            for expression in own_expressions(statement):
                yield from _constraints_of_calls(expression, scope)
        if scope.parent is None:
            continue
        if falls_through(scope.body):
            yield scope, None, scope
        outside = scope.default_scope()
        for parameter in scope.node.parameters if scope.node is not None else ():
            if parameter.default is not None:
                yield (scope, parameter.name), parameter.default, outside
                yield from _constraints_of_calls(parameter.default, outside)


def _constraints_of_calls(expression: Expression, scope: FunctionScope) -> Iterator[Constraint]:
    for part in all_expressions(expression):
        if not isinstance(part, nodes.Call):
            continue
        callee = scope.find_function(part.function)
        if callee is None or callee.node is None or wrong_count(part, callee):
            continue
        for position, argument in enumerate(part.arguments):
            name = argument.name or callee.node.parameters[position].name
            yield (callee, name), argument.value, scope


def _unknown(program: ResolvedProgram) -> Iterator[Symbol]:
    """What statements outside of the program may give values of any type (interpreter mode)."""
    if not program.is_open:
        return
    yield from ((None, name) for name in program.globals)
    for scope in program.functions:
        assert scope.node is not None
        yield from ((scope, parameter.name) for parameter in scope.node.parameters)
    for scope in calling_scopes(program):
        yield from ((scope, name) for name in scope.locals)
    yield from (scope for scope in program.main.functions.values() if scope.parent is None)


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
