"""Resolved program -> Python code object.

Every function and thread becomes one Python function of a flat module. All are generators, so that a program
can stand still anywhere: it waits, or has used up the units of a cycle. Variables of the program body are
module globals, so threads and nested functions share them. `runtime` provides the other names the code uses.

Statements and units are charged at loop iterations and function entries, not one by one (see `_Cost`). After
a statement with operations whose cost depends on values, the code asks whether it may go on.
"""

from __future__ import annotations

import ast
import marshal
from array import array
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass
from types import CodeType
from typing import Any, Final, NamedTuple

from urscript.catalogue import Catalogue
from urscript.compile.expressions import ExpressionCompiler
from urscript.compile.inference import NUMERIC, SCALARS, StaticTypes, Type
from urscript.compile.python_tree import ask, call, charge, constant, discarded, function, load, place, store
from urscript.errors import ScriptContextError
from urscript.names.scopes import FunctionScope, ResolvedProgram
from urscript.source import Span
from urscript.syntax import nodes
from urscript.syntax.nodes import Block, Expression, Statement, child_expressions


@dataclass(frozen=True, slots=True)
class CompiledCode:
    """The functions of a program.

    Attributes:
        code: Python's code object, marshalled; executed, it defines the functions.
        constants: Values the code refers to by name.
        function_names: Python function -> function of the script.
        positions: Python function -> positions of its instructions in the script.
        file_name: The pseudo file name of the functions.
    """

    code: bytes
    constants: dict[str, Any]
    function_names: dict[str, str]
    positions: dict[str, PositionTable]
    file_name: str


def compile_resolved(program: ResolvedProgram, catalogue: Catalogue, file_name: str) -> CompiledCode:
    """Compile a program without errors to Python.

    Raises:
        ScriptContextError: Something is nested deeper than Python can; loops are limited before.
    """
    types = StaticTypes(program, catalogue)
    expressions = ExpressionCompiler(program, types, catalogue)
    functions: list[ast.stmt] = []
    function_names: dict[str, str] = {}
    try:
        for scope in program.scopes():
            for made in _FunctionCompiler(program, types, expressions, scope).compile():
                function_names[made.name] = scope.name
                functions.append(made)
        code = compile(ast.Module(functions, []), file_name, "exec", dont_inherit=True)
    except SyntaxError as error:
        raise ScriptContextError(
            f"the program cannot be compiled: {error.msg}",
            line=error.lineno or 1,
            column=(error.offset or 0) + 1,
            source=program.source,
        ) from None
    positions = {item.co_name: _table(item) for item in code.co_consts if isinstance(item, CodeType)}
    return CompiledCode(marshal.dumps(code), expressions.constants, function_names, positions, file_name)


class _FunctionCompiler:
    """Compiles one function, thread or program body."""

    def __init__(
        self,
        program: ResolvedProgram,
        types: StaticTypes,
        expressions: ExpressionCompiler,
        scope: FunctionScope,
    ) -> None:
        self._program = program
        self._types = types
        self._expressions = expressions
        self._scope = scope

    def compile(self) -> list[ast.FunctionDef]:
        """The Python function, after those that compute its defaults."""
        scope = self._scope
        self._expressions.globals_stored = stored = {"_b", "_x"}
        parameters: list[str] = []
        defaults: list[ast.FunctionDef] = []
        prologue: list[ast.stmt] = []
        types = self._types
        span = scope.node.span if scope.node is not None else _first_span(scope.body)
        span = Span(span.line, span.column, span.line, span.column + 1)
        if scope.parent is not None and scope.node is not None:
            for parameter in scope.node.parameters:
                parameters.append(f"v_{parameter.name}")
                if parameter.default is not None:
                    name = f"{scope.python_name}_{parameter.name}"
                    default = self._default(name, parameter.default)
                    defaults.append(default)
                    prologue.append(self._fill_in(parameter, default))
        cost = _block_cost(scope.body, types, scope)
        prologue[:0] = charge(cost.statements + 1, cost.extra, span)
        for name in sorted(scope.locals - {name.removeprefix("v_") for name in parameters}):
            # Others are neither read before they are assigned nor compared with their old value.
            if name in scope.maybe_unassigned or types.variable(name, scope) not in SCALARS:
                prologue.append(store(f"v_{name}", load("_UNDEFINED", span), span))
        body = self._block(scope.body)
        if scope.recursive:
            body = self._with_depth(body, span)
        declared = ast.Global(sorted(stored), **place(span))
        whole = function(scope.python_name, parameters, [declared, *prologue, *body], span)
        return [*defaults, whole]

    def _default(self, name: str, value: Expression) -> ast.FunctionDef:
        """A function of its own for each default: it runs in the call, but sees globals only."""
        own, self._expressions.globals_stored = self._expressions.globals_stored, set()
        result = self._expressions.compile(value, self._scope.default_scope())
        stored, self._expressions.globals_stored = self._expressions.globals_stored, own
        at = place(value.span)
        body: list[ast.stmt] = [ast.Global(sorted(stored), **at)] if stored else []
        return function(name, [], [*body, ast.Return(result, **at)], value.span)

    def _fill_in(self, parameter: nodes.Parameter, default: ast.FunctionDef) -> ast.stmt:
        """`if v_x is _MISSING: v_x = default()`."""
        span = parameter.span
        at = place(span)
        value: ast.expr = call(default.name, [], span)
        if any(isinstance(node, (ast.Yield, ast.YieldFrom)) for node in ast.walk(default)):
            value = ast.YieldFrom(value, **at)
        left_out = ast.Compare(load(f"v_{parameter.name}", span), [ast.Is()], [load("_MISSING", span)], **at)
        return ast.If(left_out, [store(f"v_{parameter.name}", value, span)], [], **at)

    def _with_depth(self, body: list[ast.stmt], span: Span) -> list[ast.stmt]:
        """`_d = _enter(_T)`, then `body` with `_leave(_d)` in a `finally`."""
        at = place(span)
        enter = store("_d", call("_enter", [load("_T", span)], span), span)
        leave = discarded(call("_leave", [load("_d", span)], span), span)
        return [enter, ast.Try(body, [], [], [leave], **at)]

    # --- statements --------------------------------------------------------------------------------------

    def _block(self, block: Block) -> list[ast.stmt]:
        result: list[ast.stmt] = []
        for statement in block:
            self._expressions.asks = 0
            result += self._statement(statement)
            if self._expressions.asks and not isinstance(statement, nodes.Return):
                result.append(ask(statement.span))
        return result or [ast.Pass(**place(_first_span(block)))]

    def _statement(self, statement: Statement) -> list[ast.stmt]:
        span, scope = statement.span, self._scope
        at = place(span)
        match statement:
            case nodes.Assign():
                return [self._assign(statement)]
            case nodes.ExpressionStatement(value=value):
                return [discarded(self._effect(value), span)]
            case nodes.If(branches=branches, else_body=else_body):
                return self._if(branches, else_body)
            case nodes.While(condition=condition, body=body):
                test = self._expressions.condition(condition, scope)
                asks = self._expressions.asks
                cost = _block_cost(body, self._types, scope)
                tenths = cost.tenths + _expression_cost((condition,), self._types, scope)
                cost = _Cost(max(1, cost.statements), tenths)
                turn = charge(cost.statements, cost.extra, condition.span)
                loop = ast.While(test, [*turn, *self._block(body)], [], **at)
                self._expressions.asks = asks
                return [loop]
            case nodes.Return(value=value):
                result = None if value is None else self._expressions.compile(value, scope)
                return [ast.Return(result, **at)]
            case nodes.Join(thread=thread):
                joined = call("_join", [load("_T", span), self._expressions.compile(thread, scope)], span)
                return [discarded(ast.YieldFrom(joined, **at), span)]
            case nodes.Kill(thread=thread):
                killed = call("_kill", [load("_T", span), self._expressions.compile(thread, scope)], span)
                return [discarded(killed, span)]
            case nodes.KeywordStatement(keyword="break"):
                return [ast.Break(**at)]
            case nodes.KeywordStatement(keyword="continue"):
                return [ast.Continue(**at)]
            case nodes.KeywordStatement(keyword="halt"):
                return [discarded(call("_halt", [], span), span)]
            case nodes.Label(text=text):
                target = ast.Attribute(load("_T", span), "label", ast.Store(), **at)
                return [ast.Assign([target], constant(text, span), **at)]
        # Definitions are compiled separately, declarations need no code. A critical section needs none: a
        # thread is interrupted only in calls that take time, and those release it.
        return []

    def _effect(self, value: Expression) -> ast.expr:
        if isinstance(value, nodes.Name) and value.name == "pause" and "pause" in self._program.builtins:
            made = call("b_pause", [load("_T", value.span)], value.span)
            return ast.YieldFrom(made, **place(value.span))
        return self._expressions.compile(value, self._scope)

    def _if(self, branches: tuple[nodes.Branch, ...], else_body: Block | None) -> list[ast.stmt]:
        """From the last branch to the first, without recursion for chains of any length."""
        rest = self._block(else_body) if else_body else []
        self._expressions.asks = 0
        tests = [self._expressions.condition(branch.condition, self._scope) for branch in branches]
        asks = self._expressions.asks
        for branch, test in zip(reversed(branches), reversed(tests), strict=True):
            rest = [ast.If(test, self._block(branch.body), rest, **place(branch.span))]
        self._expressions.asks = asks
        return rest

    def _assign(self, statement: nodes.Assign) -> ast.stmt:
        target, span, scope = statement.target, statement.span, self._scope
        value = self._expressions.compile(statement.value, scope)
        # The old value is read after the new one is computed, because the computation may take time in which
        # another thread changes the variable.
        if not isinstance(target, nodes.Name):
            return self._assign_inside(target, value, span)
        name = self._expressions.stored_name(target.name, scope, statement.scope == "global")
        holder = scope if name.startswith("v_") else self._program.main
        if self._types.variable(target.name, holder) not in SCALARS:
            value = call("_assign", [value, load(name, span), constant(target.name, span)], span)
        return store(name, value, span)

    def _assign_inside(
        self, target: nodes.Subscript | nodes.Attribute, value: ast.expr, span: Span
    ) -> ast.stmt:
        """`x[i] = value`, `x.member = value`, `x[i].member[j] = value`."""
        expressions, scope = self._expressions, self._scope
        inner = target.target
        if isinstance(target, nodes.Subscript):
            array = expressions.array(inner, scope)
            indices = [expressions.compile(index, scope) for index in target.indices]
            if array is not None:
                made = call(f"b_{array.setter}", [load("_T", span), *indices, value], span)
                return discarded(made, span)
            helper = "_store_item" if len(indices) == 1 else "_store_cell"
        else:
            helper, indices = "_store_member", [constant(target.name, span)]
        if isinstance(inner, nodes.Name):
            name = inner.name
            arguments = [value, *indices, expressions.compile(inner, scope)]
        else:
            helper = "_store_inside"
            variable, steps = expressions.steps(target, scope)
            if variable is None:  # an element of a builtin array has nothing inside: this ends the program
                arguments = [value, *indices, expressions.compile(inner, scope)]
                return discarded(call("_store_item", arguments, span), span)
            name = variable
            arguments = [value, steps, expressions.compile(nodes.Name(name, span=span), scope)]
        changed = expressions.asking(call(helper, arguments, span))
        return store(expressions.stored_name(name, scope), changed, span)


def _first_span(block: Block) -> Span:
    return block[0].span if block else Span(1, 1, 1, 2)


# --- costs ----------------------------------------------------------------------------------------------
#
# Statements, which have a limit, and units of work, which are time (see `run.metering`). Both are known for a
# block before it runs; bodies of loops are counted at their iterations. What depends on values, such as the
# length of a list, is charged when it runs. The weights come from measurements on one core of 2026, in tenths
# of a unit of 50 ns.

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


class _Cost(NamedTuple):
    """What one execution costs at most."""

    statements: int
    tenths: int

    @property
    def extra(self) -> int:
        """Units beyond one a statement."""
        return max(0, self.tenths // 10 - self.statements)


def _block_cost(block: Block, types: StaticTypes, scope: FunctionScope) -> _Cost:
    statements = tenths = 0
    for statement in block:
        if isinstance(statement, nodes.If):
            conditions = [branch.condition for branch in statement.branches]
            bodies = [branch.body for branch in statement.branches]
            costs = [_block_cost(body, types, scope) for body in [*bodies, statement.else_body or ()]]
            statements += 1 + max(cost.statements for cost in costs)
            tenths += max(cost.tenths for cost in costs) + _expression_cost(conditions, types, scope)
        elif not isinstance(statement, (nodes.Function, nodes.Label)):
            statements += 1
            tenths += _STATEMENT + _statement_cost(statement, types, scope)
            value = getattr(statement, "value", None)
            if isinstance(value, nodes.ListLiteral):
                statements += len(value.items) // _ITEMS_OF_A_STATEMENT
    return _Cost(statements, tenths)


def _statement_cost(statement: Statement, types: StaticTypes, scope: FunctionScope) -> int:
    match statement:
        case nodes.Assign(target=nodes.Name(name=name), value=value):
            checked = types.variable(name, scope) not in SCALARS
            return _STORE_CHECKED * checked + _expression_cost((value,), types, scope)
        case nodes.Assign(target=target, value=value):
            return _STORE_ITEM + _expression_cost((target, value), types, scope)
        case nodes.While(condition=condition):
            return _expression_cost((condition,), types, scope)
        case nodes.ExpressionStatement(value=value) | nodes.Return(value=value):
            return 0 if value is None else _expression_cost((value,), types, scope)
    return 0


def _expression_cost(expressions: Iterable[Expression], types: StaticTypes, scope: FunctionScope) -> int:
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
    if not NUMERIC.issuperset((left, right)) or operator == "%":
        return False
    return operator not in ("+", "-", "*") or Type.FLOAT in (left, right) or left is right is Type.INT


# --- positions ------------------------------------------------------------------------------------------
#
# Python finds a line or a column by reading the table of a function from its beginning, which takes 40 ms at
# the end of 100,000 statements. This one is made once, when the program is compiled, and searched by halves.

_WORD = 2  # bytes of an instruction of Python
_MOST_COLUMNS = 0xFFFF


@dataclass(frozen=True, slots=True)
class PositionTable:
    """Where each instruction of a compiled function stands in the script.

    Attributes:
        starts: Instructions at which another position begins, ascending.
        lines: In the script, from 1; of each start.
        columns: From 1.
    """

    starts: array[int]
    lines: array[int]
    columns: array[int]

    def at(self, offset: int) -> tuple[int, int]:
        """Line and column of the instruction at byte `offset`."""
        i = bisect_right(self.starts, offset // _WORD) - 1
        return (self.lines[i], self.columns[i]) if i >= 0 else (1, 1)


def _table(code: CodeType) -> PositionTable:
    table = PositionTable(array("I"), array("I"), array("H"))
    last: tuple[int | None, int | None] | None = None
    for i, (line, _, column, _) in enumerate(code.co_positions()):
        if (line, column) != last:
            last = line, column
            table.starts.append(i)
            table.lines.append(line or 1)
            table.columns.append(min(_MOST_COLUMNS, 1 if column is None else column + 1))
    return table
