"""Expressions -> Python expressions.

Where the static types are known, the Python operator is emitted, elsewhere a call of the run-time library. A
call that may take time becomes `yield from`. Names: `v_x` local, `g_x` global, `b_f` builtin; the rest of the
names a compiled program uses is listed in `runtime`.
"""

import ast
from typing import Any, Final

from urscript.catalogue import Catalogue
from urscript.catalogue.costs import EXPENSIVE, UNITS
from urscript.compile.inference import NUMERIC, StaticTypes, Type
from urscript.compile.python_tree import ask_after, call, constant, load, place
from urscript.names.scopes import FunctionScope, ResolvedProgram, wrong_count
from urscript.source import Span
from urscript.syntax import nodes
from urscript.syntax.nodes import Expression
from urscript.values import INT_MAX, INT_MIN, Pose

# Operations of an expression after which the code asks whether the program may go on.
_ASK_EVERY: Final = 8
_PLAIN = (bool, int, float, str, type(None))


class ExpressionCompiler:
    """Compiles the expressions of one program.

    Attributes:
        constants: Values that cannot be literals in Python code, by their name.
        asks: Operations of the present statement whose cost depends on values; after it, or after every few
            of them, the code asks whether the program may go on.
        globals_stored: Python names of the globals that the present function stores.
    """

    def __init__(self, program: ResolvedProgram, types: StaticTypes, catalogue: Catalogue) -> None:
        self._program = program
        self._types = types
        self._catalogue = catalogue
        self._changing = {name for (_, name), row in catalogue.methods.items() if row.changes}
        self.constants: dict[str, Any] = {}
        self.asks = 0
        self.globals_stored: set[str] = set()

    def asking(self, made: ast.expr, weight: int = 1) -> ast.expr:
        """An operation whose cost depends on values; a long expression asks in between."""
        before, self.asks = self.asks, self.asks + weight
        return made if before // _ASK_EVERY == self.asks // _ASK_EVERY else ask_after(made)

    def compile(self, expression: Expression, scope: FunctionScope) -> ast.expr:
        """The Python expression with the value of `expression`."""
        span = expression.span
        match expression:
            case nodes.Name(name=name):
                return self._variable(name, span, scope)
            case (
                nodes.BoolLiteral(value=value)
                | nodes.IntLiteral(value=value)
                | nodes.FloatLiteral(value=value)
            ):
                return constant(value, span)
            case nodes.StringLiteral(value=text):
                return constant(text, span)
            case nodes.NoneLiteral():
                return constant(None, span)
            case nodes.BinaryOperation():
                return self._binary(expression, scope)
            case nodes.Call():
                return self._call(expression, scope)
            case nodes.Subscript():
                return self._index(expression, scope)
            case nodes.UnaryOperation():
                return self._prefix(expression, scope)
            case nodes.ListLiteral(items=items):
                values = ast.List(self._all(items, scope), ast.Load(), **place(span))
                are_numbers = self._are_numbers(items, scope)
                return values if are_numbers else self.asking(call("_list", [values], span))
            case nodes.PoseLiteral(items=items):
                return self._pose(items, span, scope)
            case nodes.RunThread(thread=thread):
                callee = scope.find_function(thread)
                assert callee is not None
                names = [load(callee.python_name, span), constant(thread, span)]
                return self.asking(call("_run", [*names, constant(callee.depth, span)], span))
            case nodes.MethodCall():
                return self._method(expression, scope)
            case nodes.Attribute(target=target, name=name):
                return call("_member", [self.compile(target, scope), constant(name, span)], span)
        raise TypeError(f"not an expression: {expression!r}")

    def condition(self, expression: Expression, scope: FunctionScope) -> ast.expr:
        """`expression` as a Python bool."""
        value = self.compile(expression, scope)
        if self._types.of(expression, scope) is Type.BOOL:
            return value
        return call("_truth", [value], expression.span)

    # --- variables and literals --------------------------------------------------------------------------

    def _variable(self, name: str, span: Span, scope: FunctionScope) -> ast.expr:
        if name in scope.locals:
            python_name, maybe_unassigned = f"v_{name}", name in scope.maybe_unassigned
        elif name in self._program.globals:
            python_name = self._program.python_name(name)
            maybe_unassigned = name in self._program.maybe_unassigned_globals
        else:
            return constant(self._catalogue.variables[name].value, span)
        if not maybe_unassigned:
            return load(python_name, span)
        at = place(span)
        is_set = ast.Compare(load(python_name, span), [ast.IsNot()], [load("_UNDEFINED", span)], **at)
        complain = call("_undefined", [constant(name, span)], span)
        return ast.IfExp(is_set, load(python_name, span), complain, **at)

    def _pose(self, items: tuple[Expression, ...], span: Span, scope: FunctionScope) -> ast.expr:
        values = self._all(items, scope)
        if all(isinstance(value, ast.Constant) for value in values) and self._are_numbers(items, scope):
            return self.shared(Pose.of(value.value for value in values), span)  # type: ignore[attr-defined]
        maker = "_Pose" if self._are_numbers(items, scope) else "_pose"
        return call(maker, values, span)

    def shared(self, value: Any, span: Span) -> ast.expr:
        """A constant of any type; lists and poses are never changed, so one object is enough."""
        if type(value) in _PLAIN:
            return constant(value, span)
        name = f"{self._program.prefix}k{len(self.constants)}"
        self.constants[name] = value
        return load(name, span)

    def _all(self, items: tuple[Expression, ...], scope: FunctionScope) -> list[ast.expr]:
        return [self.compile(item, scope) for item in items]

    def _are_numbers(self, items: tuple[Expression, ...], scope: FunctionScope) -> bool:
        return all(self._types.of(item, scope) in NUMERIC for item in items)

    # --- operators ---------------------------------------------------------------------------------------

    def _binary(self, expression: nodes.BinaryOperation, scope: FunctionScope) -> ast.expr:
        operator, span = expression.operator, expression.span
        if operator in ("and", "or", "xor"):
            return self._logic(expression, scope)
        left, right = self.compile(expression.left, scope), self.compile(expression.right, scope)
        left_type, right_type = (
            self._types.of(expression.left, scope),
            self._types.of(expression.right, scope),
        )
        plain = _plain_operation(operator, left, right, (left_type, right_type), span)
        return plain or self.asking(call(_HELPERS[operator], [left, right], span))

    def _logic(self, expression: nodes.BinaryOperation, scope: FunctionScope) -> ast.expr:
        operator, at = expression.operator, place(expression.span)
        if operator == "xor":
            left, right = self.condition(expression.left, scope), self.condition(expression.right, scope)
            return ast.Compare(left, [ast.NotEq()], [right], **at)
        # A chain of one operator is left-associative; a flat list needs no nesting.
        operands: list[Expression] = []
        chain: Expression = expression
        while isinstance(chain, nodes.BinaryOperation) and chain.operator == operator:
            operands.append(chain.right)
            chain = chain.left
        operands.append(chain)
        values = [self.condition(operand, scope) for operand in reversed(operands)]
        return ast.BoolOp(ast.And() if operator == "and" else ast.Or(), values, **at)

    def _prefix(self, expression: nodes.UnaryOperation, scope: FunctionScope) -> ast.expr:
        operand, span = expression.operand, expression.span
        if expression.operator == "not":
            return ast.UnaryOp(ast.Not(), self.condition(operand, scope), **place(span))
        kind = self._types.of(operand, scope)
        value = self.compile(operand, scope)
        if expression.operator == "+":
            return value if kind in NUMERIC else self.asking(call("_pos", [value], span))
        if isinstance(operand, (nodes.IntLiteral, nodes.FloatLiteral)):
            return constant(-operand.value, span)
        if kind is Type.FLOAT:
            return ast.UnaryOp(ast.USub(), value, **place(span))
        return self.asking(call("_neg", [value], span))

    def _index(self, expression: nodes.Subscript, scope: FunctionScope) -> ast.expr:
        target, indices, span = expression.target, expression.indices, expression.span
        array = self.array(target, scope)
        if array is not None:
            return call(f"b_{array.getter}", [load("_T", span), *self._all(indices, scope)], span)
        values = [self.compile(target, scope), *self._all(indices, scope)]
        if len(indices) == 2:
            return call("_cell", values, span)
        constant_index = isinstance(target, nodes.Name) and isinstance(indices[0], nodes.IntLiteral)
        if constant_index and self._types.of(target, scope) in (Type.NUMBERS, Type.POSE):
            return ast.Subscript(values[0], values[1], ast.Load(), **place(span))
        return call("_item", values, span)

    def array(self, target: Expression, scope: FunctionScope) -> Any:
        """The builtin array that `target` names, unless a variable hides it."""
        if not isinstance(target, nodes.Name) or self._program.is_variable(target.name, scope):
            return None
        return self._catalogue.arrays.get(target.name)

    # --- calls -------------------------------------------------------------------------------------------

    def _call(self, expression: nodes.Call, scope: FunctionScope) -> ast.expr:
        callee = scope.find_function(expression.function)
        if callee is not None:
            return self._user_call(expression, callee, scope)
        span = expression.span
        if expression.function == "sync":
            return ast.Yield(load("_NEXT_CYCLE", span), **place(span))
        positional = [argument for argument in expression.arguments if argument.name is None]
        named = {argument.name: argument for argument in expression.arguments if argument.name is not None}
        arguments: list[ast.expr] = [load("_T", span)]
        if self._catalogue[expression.function].any_names:
            arguments.append(constant(tuple(named), span))
        for slot in self._catalogue.static_bind(expression.function, len(positional), tuple(named)):
            if slot[0] == "arg":
                arguments.append(self.compile(positional[slot[1]].value, scope))
            elif slot[0] == "kw":
                arguments.append(self.compile(named[slot[1]].value, scope))
            else:
                arguments.append(self.shared(slot[1], span))
        name = expression.function
        made: ast.expr = call(f"b_{name}", arguments, span)
        if name == "interpreter_mode":
            return self.asking(_interpreter_call(made, scope, span))
        if self._catalogue[name].may_wait:
            made = ast.YieldFrom(made, **place(span))
        return self.asking(made, _ASK_EVERY if UNITS.get(name, 0) >= EXPENSIVE else 1)

    def _user_call(self, expression: nodes.Call, callee: FunctionScope, scope: FunctionScope) -> ast.expr:
        assert callee.node is not None
        span = expression.span
        if refusal := wrong_count(expression, callee):
            return call("_refuse", [constant(refusal, span)], span)
        made = call(callee.python_name, [], span)
        parameters = callee.node.parameters
        given = set()
        for position, argument in enumerate(expression.arguments):
            value = self.compile(argument.value, scope)
            if argument.name is None:
                made.args.append(value)
                given.add(parameters[position].name)
            else:
                made.keywords.append(ast.keyword(f"v_{argument.name}", value, **place(span)))
                given.add(argument.name)
        for parameter in parameters:
            if parameter.name not in given:
                omitted = load("_MISSING", span)
                made.keywords.append(ast.keyword(f"v_{parameter.name}", omitted, **place(span)))
        return self.asking(ast.YieldFrom(made, **place(span)))

    def _method(self, expression: nodes.MethodCall, scope: FunctionScope) -> ast.expr:
        span = expression.span
        positional = [self.compile(a.value, scope) for a in expression.arguments if a.name is None]
        names = [constant(a.name, span) for a in expression.arguments if a.name is not None]
        values = [self.compile(a.value, scope) for a in expression.arguments if a.name is not None]
        at = place(span)
        form: list[ast.expr] = [
            constant(expression.method, span),
            ast.List(positional, ast.Load(), **at),
            ast.Dict(list(names), values, **at),
        ]
        if expression.method in self._changing:
            variable, steps = self.steps(expression.target, scope)
            if variable is not None:
                return self._change(variable, [load("_T", span), *form, steps], span, scope)
        arguments = [load("_T", span), self.compile(expression.target, scope), *form]
        return self.asking(ast.YieldFrom(call("_method", arguments, span), **at))

    def _change(self, variable: str, arguments: list[ast.expr], span: Span, scope: FunctionScope) -> ast.expr:
        """A call that may change variable x.

        `(_m := (yield from _change(..., x)), x := _kept(_m, x), _m[1])[2]`. A handle may have methods of
        the same names, which take time; then x stays as it is.
        """
        at = place(span)
        name = self.stored_name(variable, scope)
        changed: ast.expr = ast.YieldFrom(
            call("_change", [*arguments, self._variable(variable, span, scope)], span), **at
        )
        changed = ast.NamedExpr(ast.Name("_m", ast.Store(), **at), self.asking(changed), **at)
        new: ast.expr = call("_kept", [load("_m", span), load(name, span)], span)
        new = ast.NamedExpr(ast.Name(name, ast.Store(), **at), new, **at)
        result = ast.Subscript(load("_m", span), constant(1, span), ast.Load(), **at)
        every = ast.Tuple([changed, new, result], ast.Load(), **at)
        return ast.Subscript(every, constant(2, span), ast.Load(), **at)

    # --- places ------------------------------------------------------------------------------------------

    def steps(self, target: Expression, scope: FunctionScope) -> tuple[str | None, ast.expr]:
        """The variable that `target` is, or is inside of, and the steps to it (`variables.Step`).

        Without a variable (a call, a builtin array) it is None.
        """
        steps: list[ast.expr] = []
        span = target.span
        while not isinstance(target, nodes.Name):
            if isinstance(target, nodes.Subscript):
                indices = self._all(target.indices, scope)
                steps.append(ast.Tuple(indices, ast.Load(), **place(target.span)))
            elif isinstance(target, nodes.Attribute):
                steps.append(constant(target.name, target.span))
            else:
                return None, constant(None, span)
            target = target.target
        known = self._program.is_variable(target.name, scope)
        return target.name if known else None, ast.List(steps[::-1], ast.Load(), **place(span))

    def stored_name(self, variable: str, scope: FunctionScope, is_global: bool = False) -> str:
        """The Python name under which a variable is stored."""
        if variable in scope.locals and not is_global:
            return f"v_{variable}"
        name = self._program.python_name(variable)
        self.globals_stored.add(name)
        return name


# --- operators ------------------------------------------------------------------------------------------

_ARITHMETIC: Final[dict[str, tuple[str, type[ast.operator]]]] = {
    "+": ("_add", ast.Add),
    "-": ("_sub", ast.Sub),
    "*": ("_mul", ast.Mult),
    "/": ("_div", ast.Div),
    "%": ("_mod", ast.Mod),
}
_COMPARISON: Final[dict[str, tuple[str, type[ast.cmpop]]]] = {
    "==": ("_equal", ast.Eq),
    "!=": ("_unequal", ast.NotEq),
    "<": ("_less", ast.Lt),
    "<=": ("_less_equal", ast.LtE),
    ">": ("_greater", ast.Gt),
    ">=": ("_greater_equal", ast.GtE),
}

_HELPERS: Final = {operator: name for operator, (name, _) in (_ARITHMETIC | _COMPARISON).items()}
"""Operator -> the function of the run-time library that does it on values of any type."""


def _plain_operation(
    operator: str, left: ast.expr, right: ast.expr, types: tuple[Type, Type], span: Span
) -> ast.expr | None:
    """The operation as one of Python; None where the types need the run-time library."""
    are_numbers = NUMERIC.issuperset(types)
    if operator in _COMPARISON:
        are_bools = types == (Type.BOOL, Type.BOOL) and operator in ("==", "!=")
        if not are_numbers and not are_bools:
            return None
        return ast.Compare(left, [_COMPARISON[operator][1]()], [right], **place(span))
    if not are_numbers or operator == "%":
        return None
    raw = ast.BinOp(left, _ARITHMETIC[operator][1](), right, **place(span))
    if operator == "/" or Type.FLOAT in types:
        return raw
    return _wrapped(raw, span) if types == (Type.INT, Type.INT) else None


def _wrapped(raw: ast.expr, span: Span) -> ast.expr:
    """`_i if INT_MIN <= (_i := raw) <= INT_MAX else _wrap(_i)`: a result of 32 bits."""
    at = place(span)
    bound = ast.NamedExpr(ast.Name("_i", ast.Store(), **at), raw, **at)
    fits = ast.Compare(
        constant(INT_MIN, span), [ast.LtE(), ast.LtE()], [bound, constant(INT_MAX, span)], **at
    )
    return ast.IfExp(fits, load("_i", span), call("_wrap", [load("_i", span)], span), **at)


def _interpreter_call(made: ast.expr, scope: FunctionScope, span: Span) -> ast.expr:
    """The call of `interpreter_mode`: the statements that it runs read and change the locals of its function.

    Nobody else sees the locals of a function that waits in a call. So they are handed over at the beginning
    and taken back at the end:

        ((_l := (yield from _interpret(b_interpreter_mode(...), "f0", {"l_x": v_x})), v_x := _l[0]), None)[1]

    `made` is the call of the builtin, which returns where the statements come from.
    """
    at = place(span)
    names = sorted(scope.locals)
    keys: list[ast.expr | None] = [constant(f"l_{name}", span) for name in names]
    values = ast.Dict(keys, [load(f"v_{name}", span) for name in names], **at)
    run = ast.YieldFrom(call("_interpret", [made, constant(scope.python_name, span), values], span), **at)
    steps: list[ast.expr] = [ast.NamedExpr(ast.Name("_l", ast.Store(), **at), run, **at)]
    for i, name in enumerate(names):
        value = ast.Subscript(load("_l", span), constant(i, span), ast.Load(), **at)
        steps.append(ast.NamedExpr(ast.Name(f"v_{name}", ast.Store(), **at), value, **at))
    both = ast.Tuple([ast.Tuple(steps, ast.Load(), **at), constant(None, span)], ast.Load(), **at)
    return ast.Subscript(both, constant(1, span), ast.Load(), **at)
