"""Which program a text is, and what it declares: functions, globals, locals. Nothing is looked up yet."""

from __future__ import annotations

from urscript.errors import ScriptContextError
from urscript.names.name_errors import NameErrors
from urscript.names.scopes import FunctionScope, ResolvedProgram
from urscript.source import Source
from urscript.syntax import nodes
from urscript.syntax.nodes import Block, Statement
from urscript.syntax.walk import all_expressions, all_statements, own_expressions


def open_program(block: Block, source: Source, errors: NameErrors) -> ResolvedProgram:
    """The program: a single definition is the program itself, other text is its body.

    Calls of that program after its definition are ignored: on a port it has run before they come.
    """
    function, calls = _definition_and_calls(block)
    if function is not None:
        if function.parameters:
            errors.add(ScriptContextError("a program takes no parameters"), function.parameters[0].span)
        main = FunctionScope(function.name, function, None, function.body, "main")
        return ResolvedProgram(source, function.kind, function.name, main, calls)
    name = _statement_name(block)
    return ResolvedProgram(source, "statement", name, FunctionScope(name, None, None, block, "main"))


class Declarations:
    """Declares the names of one program."""

    def __init__(self, program: ResolvedProgram, errors: NameErrors) -> None:
        self._program = program
        self._errors = errors

    def declare(self, scope: FunctionScope) -> None:
        """Declare the functions of `scope` and its globals, then those of nested functions."""
        for statement in all_statements(scope.body):
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
            self._errors.add(
                ScriptContextError("a secondary program cannot be defined inside another program"),
                function.span,
            )
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
                self._errors.add(
                    ScriptContextError(f"duplicate parameter '{parameter.name}'"), parameter.span
                )
            scope.locals.add(parameter.name)
        for statement in all_statements(scope.body):
            if not isinstance(statement, (nodes.Assign, nodes.Declaration)) or statement.scope == "global":
                continue
            name = _declared_name(statement)
            if name is not None and (statement.scope == "local" or name not in self._program.globals):
                scope.locals.add(name)


def _statement_name(block: Block) -> str:
    """The name of a program without `def`: the function that its first statement calls.

    Source: key messages of one-line programs on the primary interface.
    """
    for statement in block:
        for expression in own_expressions(statement):
            for part in all_expressions(expression):
                if isinstance(part, nodes.Call):
                    return part.function
        if isinstance(statement, nodes.KeywordStatement):
            return statement.keyword
    return "unnamed"


def _definition_and_calls(block: Block) -> tuple[nodes.Function | None, tuple[Statement, ...]]:
    """The one definition that is the whole program, and calls of it below."""
    items = tuple(item for item in block if not isinstance(item, nodes.Label))
    if not items or not isinstance(items[0], nodes.Function) or items[0].kind == "thread":
        return None, ()
    definition, calls = items[0], items[1:]
    its_call = nodes.ExpressionStatement(nodes.Call(definition.name, ()))
    return (definition, calls) if all(item == its_call for item in calls) else (None, ())


def _declared_name(statement: nodes.Assign | nodes.Declaration) -> str | None:
    if isinstance(statement, nodes.Declaration):
        return statement.name
    return statement.target.name if isinstance(statement.target, nodes.Name) else None
