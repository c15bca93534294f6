"""Name resolution: every variable and function is found before the program runs, as a controller does.

Rules: variables of the program body are global; `global x` makes one from anywhere, `local x` one of this
function only; a plain assignment means the global of that name if there is one anywhere in the program, else
a local; a nested function sees its own locals and the globals, not the locals of enclosing functions; a
function may be used before its definition; names in branches that never run count too.

All errors of a program are collected, the first one in the text is raised.
"""

from collections.abc import Iterable
from typing import Final

from urscript.catalogue import Catalogue
from urscript.catalogue.types import NEVER
from urscript.dialect import MAX_CALL_DEPTH, MAX_LOOP_DEPTH, Dialect
from urscript.errors import (
    ScriptCompileError,
    ScriptContextError,
    ScriptNameError,
    ScriptSyntaxError,
    ScriptTypeError,
)
from urscript.names.analyses import find_maybe_unassigned, mark_recursion, spread_blocking
from urscript.names.scopes import FunctionScope, ResolvedProgram, shape_of, signature_of
from urscript.source import NOWHERE, Source, Span
from urscript.syntax import nodes
from urscript.syntax.nodes import Block, Expression, Statement

MAX_SUGGESTIONS: Final = 40
"""Unknown names of one program for which a suggestion is searched."""


def resolve(
    block: Block,
    source: Source,
    catalogue: Catalogue,
    dialect: Dialect,
    within: ResolvedProgram | None = None,
) -> tuple[ResolvedProgram, list[ScriptCompileError]]:
    """Find every name of a parsed program.

    `within` is what statements of interpreter mode become, with the names that they find.

    Returns:
        What was found, and all errors in the order of the text; with errors the program cannot be compiled.
    """
    program = within or _open_program(block, source)
    resolver = _Resolver(program, catalogue, dialect)
    resolver.declare(program.main)
    for scope in program.functions:
        resolver.declare_locals(scope)
    for scope in program.scopes():
        resolver.look_up(scope)
    mark_recursion(program)
    for scope in program.scopes():
        if scope.depth == MAX_CALL_DEPTH + 1:
            text = f"functions call one another {scope.depth} deep from here on; allowed: {MAX_CALL_DEPTH}"
            resolver.add(ScriptContextError(text), NOWHERE if scope.node is None else scope.node.span)
            break
    spread_blocking(program)
    find_maybe_unassigned(program)
    return program, sorted(resolver.errors, key=lambda error: (error.line, error.column))


class _Resolver:
    """Declares the names of one program, then finds what each name is.

    Attributes:
        errors: Those of the program, each with its place and, where it helps, a hint.
    """

    def __init__(self, program: ResolvedProgram, catalogue: Catalogue, dialect: Dialect) -> None:
        self._program = program
        self._catalogue = catalogue
        self._dialect = dialect
        self._n_unknown = 0
        self.errors: list[ScriptCompileError] = []

    def add(self, error: ScriptCompileError, span: Span) -> None:
        """Add an error at its place."""
        width = span.end_column - span.column if span.line == span.end_line else 1
        self.errors.append(error.locate(self._program.source, span.line, span.column, width))

    # --- declarations: nothing is looked up yet ----------------------------------------------------------

    def declare(self, scope: FunctionScope) -> None:
        """Declare the functions of `scope` and its globals, then those of nested functions."""
        if scope is self._program.main and scope.node is not None and scope.node.parameters:
            self.add(ScriptContextError("a program takes no parameters"), scope.node.parameters[0].span)
        for statement in nodes.all_statements(scope.body):
            if isinstance(statement, nodes.Function):
                self._declare_function(statement, scope)
            elif isinstance(statement, (nodes.Assign, nodes.Declaration)) and (
                scope is self._program.main or statement.scope == "global"
            ):
                name = _declared_name(statement)
                if name is not None:
                    self._program.globals.add(name)
                    if statement.scope == "global":
                        self._program.declared_globals[name] = None

    def _declare_function(self, function: nodes.Function, scope: FunctionScope) -> None:
        if function.kind == "sec":
            text = "a secondary program cannot be defined inside another program"
            self.add(ScriptContextError(text), function.span)
        python_name = f"{self._program.prefix}f{len(self._program.functions)}_{function.name}"
        inner = FunctionScope(function.name, function, scope, function.body, python_name)
        scope.functions[function.name] = inner
        self._program.functions.append(inner)
        self.declare(inner)

    def declare_locals(self, scope: FunctionScope) -> None:
        """Declare the locals of a function; all globals of the program are known already."""
        assert scope.node is not None
        for parameter in scope.node.parameters:
            if parameter.name in scope.locals:
                self.add(ScriptContextError(f"duplicate parameter '{parameter.name}'"), parameter.span)
            scope.locals.add(parameter.name)
        for statement in nodes.all_statements(scope.body):
            if not isinstance(statement, (nodes.Assign, nodes.Declaration)) or statement.scope == "global":
                continue
            name = _declared_name(statement)
            if name is not None and (statement.scope == "local" or name not in self._program.globals):
                scope.locals.add(name)

    # --- what each name is -------------------------------------------------------------------------------

    def look_up(self, scope: FunctionScope) -> None:
        if scope.node is not None and scope.parent is not None:
            for parameter in scope.node.parameters:
                if parameter.default is not None:
                    # A default belongs to the enclosing scope and sees no parameters. It runs in the callee.
                    self._expression(parameter.default, scope.default_scope(), runs_in=scope)
        self._block(scope.body, scope, loops=0)

    def _block(self, block: Block, scope: FunctionScope, loops: int) -> None:
        for statement in block:
            self._statement(statement, scope, loops)
            inside = loops + isinstance(statement, nodes.While)
            for inner in nodes.own_blocks(statement):
                self._block(inner, scope, inside)

    def _statement(self, statement: Statement, scope: FunctionScope, loops: int) -> None:
        match statement:
            case nodes.While() if loops == MAX_LOOP_DEPTH:
                message = f"loops are nested more than {MAX_LOOP_DEPTH} deep"
                self.add(ScriptContextError(message), statement.span)
            case nodes.KeywordStatement(keyword="break" | "continue" as word) if not loops:
                self.add(ScriptContextError(f"'{word}' outside a loop"), statement.span)
            case nodes.Join():
                scope.blocks = True
            case nodes.ExpressionStatement(value=nodes.Name(name="pause")) if self._is_pause(scope):
                scope.blocks = True
                self._program.builtins.add("pause")
                return
        for expression in nodes.own_expressions(statement):
            self._expression(expression, scope, scope)

    def _is_pause(self, scope: FunctionScope) -> bool:
        return self._dialect.has_pause and not self._program.is_variable("pause", scope)

    def _expression(self, expression: Expression, scope: FunctionScope, runs_in: FunctionScope) -> None:
        """Look up the names of `expression` in `scope`; `runs_in` is the function that executes it."""
        match expression:
            case nodes.Name(name=name):
                self._variable(name, expression.span, scope)
            case nodes.Call():
                self._call(expression, scope, runs_in)
            case nodes.RunThread():
                self._run(expression, scope)
            case nodes.MethodCall(arguments=arguments):
                # A remote procedure waits for its answer; the type of the value is known at run time only.
                runs_in.blocks = True
                self._argument_order(arguments)
            case nodes.Subscript(target=nodes.Name(name=name), indices=indices) if self._is_array(
                name, scope
            ):
                array = self._catalogue.arrays[name]
                self._program.builtins.update((array.getter, array.setter))
                if len(indices) > 1:
                    self.add(ScriptTypeError(f"{name} takes one index, got 2"), expression.span)
                for index in indices:
                    self._expression(index, scope, runs_in)
                return
            case nodes.IntLiteral(value=value) if value == 2**31:
                self.add(
                    ScriptSyntaxError("this integer does not fit into 32 bits; write a float"),
                    expression.span,
                )
            case nodes.UnaryOperation(operator="-", operand=nodes.IntLiteral()):
                return
        for part in nodes.child_expressions(expression):
            self._expression(part, scope, runs_in)

    def _is_array(self, name: str, scope: FunctionScope) -> bool:
        return name in self._catalogue.arrays and not self._program.is_variable(name, scope)

    def _variable(self, name: str, span: Span, scope: FunctionScope) -> None:
        if self._program.is_variable(name, scope) or name in self._catalogue.variables:
            return
        if name in self._catalogue or scope.find_function(name) is not None:
            hint = f"'{name}' is a function, call it as {name}(...)"
            self.add(ScriptNameError(name, hint=hint), span)
        else:
            self._unknown(name, span, [*scope.locals, *self._program.globals])

    def _call(self, call: nodes.Call, scope: FunctionScope, runs_in: FunctionScope) -> None:
        if not self._argument_order(call.arguments):
            return
        callee = scope.find_function(call.function)
        if callee is not None:
            runs_in.callees.add(callee)
            try:
                signature_of(callee).check_keywords(*shape_of(call.arguments))
            except ScriptTypeError as error:
                self.add(error, call.span)
            return
        builtin = self._catalogue.lookup(call.function)
        if builtin is None:
            self._unknown(call.function, call.span, scope.visible_functions())
            return
        self._program.builtins.add(call.function)
        runs_in.blocks = runs_in.blocks or builtin.may_wait
        try:
            self._catalogue.static_bind(call.function, *shape_of(call.arguments))
        except ScriptTypeError as error:
            self.add(error, call.span)

    def _run(self, run: nodes.RunThread, scope: FunctionScope) -> None:
        callee = scope.find_function(run.thread)
        if callee is None:
            self._unknown(run.thread, run.span, scope.visible_functions())
        elif callee.node is not None and callee.node.parameters:
            self.add(ScriptTypeError(f"cannot run {run.thread}: a thread takes no parameters"), run.span)

    def _argument_order(self, arguments: tuple[nodes.Argument, ...]) -> bool:
        """Positional arguments come before named ones."""
        seen_name = False
        for argument in arguments:
            if argument.name is not None:
                seen_name = True
            elif seen_name:
                self.add(ScriptSyntaxError("positional argument after a named argument"), argument.span)
                return False
        return True

    def _unknown(self, name: str, span: Span, own: Iterable[str]) -> None:
        """Add an unknown name, with a hint; `own` are those of the program that may have been meant."""
        self._n_unknown += 1
        hint = None
        # The searches are slow, so there is a limit.
        if self._n_unknown <= MAX_SUGGESTIONS:
            releases, version = self._catalogue.first_releases(name), self._catalogue.version
            if releases != NEVER:
                hint = f"known since {releases}; this is {version.generation.value} {version}"
            elif alike := self._catalogue.suggest(name, own):
                hint = f"did you mean '{alike}'?"
        name_only = Span(span.line, span.column, span.line, span.column + len(name))
        self.add(ScriptNameError(name, hint=hint), name_only)


# --- which program a text is ------------------------------------------------------------------------------


def _open_program(block: Block, source: Source) -> ResolvedProgram:
    """The program: a single definition is the program itself, other text is its body.

    Calls of that program after its definition are ignored: on a port it has run before they come.
    """
    items = tuple(item for item in block if not isinstance(item, nodes.Label))
    if items and isinstance(items[0], nodes.Function) and items[0].kind != "thread":
        definition, calls = items[0], items[1:]
        its_call = nodes.ExpressionStatement(nodes.Call(definition.name, ()))
        if all(item == its_call for item in calls):
            main = FunctionScope(definition.name, definition, None, definition.body, "main")
            return ResolvedProgram(source, definition.kind, definition.name, main, calls)
    name = _statement_name(block)
    return ResolvedProgram(source, "statement", name, FunctionScope(name, None, None, block, "main"))


def _statement_name(block: Block) -> str:
    """The name of a program without `def`: the function that its first statement calls.

    Source: key messages of one-line programs on the primary interface.
    """
    for statement in block:
        for expression in nodes.own_expressions(statement):
            for part in nodes.all_expressions(expression):
                if isinstance(part, nodes.Call):
                    return part.function
        if isinstance(statement, nodes.KeywordStatement):
            return statement.keyword
    return "unnamed"


def _declared_name(statement: nodes.Assign | nodes.Declaration) -> str | None:
    if isinstance(statement, nodes.Declaration):
        return statement.name
    return statement.target.name if isinstance(statement.target, nodes.Name) else None
