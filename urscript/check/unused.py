"""Warnings about what is never used, defined twice, hiding a builtin; methods of values without methods."""

from collections.abc import Iterator
from typing import Final

from urscript.catalogue import Catalogue
from urscript.check import warnings
from urscript.check.warnings import ScriptWarning
from urscript.names.scopes import FunctionScope, ResolvedProgram
from urscript.source import Source, Span
from urscript.syntax import nodes
from urscript.syntax.nodes import Block, Expression, Statement

_MOST_NAMES: Final = 5
Variable = tuple[FunctionScope | None, str]
"""A local of a function, or a global (None) of the program."""


def name_warnings(program: ResolvedProgram, catalogue: Catalogue) -> Iterator[ScriptWarning]:
    """Everything this module warns about, in no order."""
    if not program.is_open:  # statements of interpreter mode may read them
        yield from _unused_variables(program)
    idle = None if program.main.node else nothing_runs(program.main.body, program.source)
    yield from _functions(program) if idle is None else (idle,)
    yield from _hidden_builtins(program, catalogue)


def nothing_runs(block: Block, source: Source) -> ScriptWarning | None:
    """The warning about a text that has only definitions and is not one program; None for any other."""
    definitions = [item for item in block if isinstance(item, nodes.Function)]
    others = any(not isinstance(item, (nodes.Function, nodes.Label)) for item in block)
    if others or not definitions or (len(definitions) == 1 and definitions[0].kind != "thread"):
        return None
    first = definitions[0]
    names = " and ".join(f"'{item.name}'" for item in definitions[:_MOST_NAMES])
    more = f" and {len(definitions) - _MOST_NAMES} more" if len(definitions) > _MOST_NAMES else ""
    call = f"run {first.name}()" if first.kind == "thread" else f"{first.name}()"
    message, hint = f"nothing runs: the text only defines {names}{more}", f"write {call} at its end"
    return ScriptWarning(warnings.NOTHING_RUNS, message, name_of(first, source), hint)


def owner(name: str, scope: FunctionScope, qualifier: str | None = None) -> Variable:
    """The variable of `name` in `scope`, there perhaps assigned to with `global` before it."""
    return (scope if name in scope.locals and qualifier != "global" else None), name


def read_expressions(statement: Statement) -> tuple[Expression, ...]:
    """The expressions a statement reads: storing into `x[i]` reads `i`, not `x`."""
    if not isinstance(statement, nodes.Assign):
        return nodes.own_expressions(statement)
    parts: list[Expression] = [statement.value]
    target: Expression = statement.target
    while isinstance(target, (nodes.Subscript, nodes.Attribute)):
        if isinstance(target, nodes.Subscript):
            parts.extend(target.indices)
        target = target.target
    return tuple(parts)


def expressions_read(program: ResolvedProgram) -> Iterator[tuple[FunctionScope, Expression]]:
    """Every expression that is read, with all its parts, and the scope of its names."""
    for scope in program.scopes():
        for statement in nodes.all_statements(scope.body):
            for expression in read_expressions(statement):
                for part in nodes.all_expressions(expression):
                    yield scope, part
        if scope.parent is not None and scope.node is not None:
            for parameter in scope.node.parameters:
                if parameter.default is not None:
                    for part in nodes.all_expressions(parameter.default):
                        yield scope.default_scope(), part


def declared_variables(program: ResolvedProgram) -> Iterator[tuple[Variable, Span]]:
    """Every declaration of a variable and assignment to a whole variable, without parameters."""
    for scope in program.scopes():
        for statement in nodes.all_statements(scope.body):
            if isinstance(statement, nodes.Declaration):
                name, span = statement.name, statement.span
                span = span._replace(line=span.end_line, column=span.end_column - len(name))
            elif isinstance(statement, nodes.Assign) and isinstance(statement.target, nodes.Name):
                name, span = statement.target.name, statement.target.span
            else:
                continue
            yield owner(name, scope, statement.scope), span


def name_of(function: nodes.Function, source: Source) -> Span:
    """The span of the name of a definition."""
    line, after_word = function.span.line, function.span.column - 1 + len(function.kind)
    column = source.line(line).find(function.name, after_word) + 1
    if not column:
        return function.span._replace(end_line=line, end_column=after_word + 1)
    return Span(line, column, line, column + len(function.name))


# --- never used ------------------------------------------------------------------------------------------


def _unused_variables(program: ResolvedProgram) -> Iterator[ScriptWarning]:
    read = {
        owner(part.name, scope) for scope, part in expressions_read(program) if isinstance(part, nodes.Name)
    }
    parameters = {(scope, name) for scope, name, _ in _parameters(program)}
    seen: set[Variable] = set()
    for variable, span in declared_variables(program):
        scope, name = variable
        if variable in read or variable in seen or variable in parameters or name.startswith("_"):
            continue
        seen.add(variable)
        rule, kind = (warnings.UNUSED_GLOBAL, "global") if scope is None else (warnings.UNUSED_LOCAL, "local")
        yield ScriptWarning(rule, f"{kind} variable '{name}' is never read", span)
    for scope, name, span in _parameters(program):
        if (scope, name) not in read and not name.startswith("_"):
            message = f"parameter '{name}' of '{scope.name}' is never read"
            yield ScriptWarning(warnings.UNUSED_PARAMETER, message, span)


def _parameters(program: ResolvedProgram) -> Iterator[tuple[FunctionScope, str, Span]]:
    for scope in program.functions:
        assert scope.node is not None
        for parameter in scope.node.parameters:
            yield scope, parameter.name, parameter.span


def _functions(program: ResolvedProgram) -> Iterator[ScriptWarning]:
    runs: dict[FunctionScope, set[FunctionScope]] = {scope: set() for scope in program.scopes()}
    for scope, part in expressions_read(program):
        callee = scope.find_function(part.thread) if isinstance(part, nodes.RunThread) else None
        if callee is None or not isinstance(part, nodes.RunThread):
            continue
        if scope in runs:
            runs[scope].add(callee)
        if not callee.is_thread:
            message = f"'{part.thread}' is run as a thread but defined with 'def'"
            yield ScriptWarning(warnings.RUN_OF_DEF, message, part.span)
    reached: set[FunctionScope] = set()
    todo = program.scopes() if program.is_open else [program.main]
    while todo:
        scope = todo.pop()
        if scope not in reached:
            reached.add(scope)
            todo.extend(scope.callees | runs[scope])
    for scope in program.functions:
        assert scope.node is not None
        span = name_of(scope.node, program.source)
        if scope.parent is not None and scope.parent.functions[scope.name] is not scope:
            message = f"'{scope.name}' is defined twice here; the last definition is used"
            yield ScriptWarning(warnings.DEFINED_TWICE, message, span)
        elif scope not in reached and not scope.name.startswith("_"):
            rule, what = (
                (warnings.UNUSED_THREAD, "thread '{}' is never run")
                if scope.is_thread
                else (warnings.UNUSED_FUNCTION, "function '{}' is never called")
            )
            yield ScriptWarning(rule, what.format(scope.name), span)


# --- hiding ----------------------------------------------------------------------------------------------


def _hidden_builtins(program: ResolvedProgram, catalogue: Catalogue) -> Iterator[ScriptWarning]:
    parameters = list(_parameters(program))
    seen: set[Variable] = {(scope, name) for scope, name, _ in parameters}
    hiding: list[tuple[str, str, Span]] = []
    for variable, span in declared_variables(program):
        if variable not in seen:
            seen.add(variable)
            hiding.append(("variable", variable[1], span))
    hiding += (("parameter", name, span) for _, name, span in parameters)
    for scope in program.functions:
        assert scope.node is not None
        what = scope.node.kind.replace("def", "function")
        hiding.append((what, scope.name, name_of(scope.node, program.source)))
    for what, name, span in hiding:
        if name in catalogue or name in catalogue.variables or name in catalogue.arrays:
            yield ScriptWarning(warnings.HIDES_BUILTIN, f"{what} '{name}' hides the builtin", span)


# --- values ---------------------------------------------------------------------------------------------


def value_warnings(program: ResolvedProgram, catalogue: Catalogue) -> Iterator[ScriptWarning]:
    """Everything this module warns about, in no order."""
    for scope in program.scopes():
        for statement in nodes.all_statements(scope.body):
            if isinstance(statement, nodes.ExpressionStatement) and not _has_effect(statement.value):
                message, hint = _unused(statement.value)
                yield ScriptWarning(warnings.UNUSED_VALUE, message, statement.span, hint)
    if "rpc_factory" in program.builtins or catalogue.methods:
        return
    for _, part in expressions_read(program):
        if isinstance(part, nodes.MethodCall):
            message = f"nothing in this program has a method '{part.method}'"
            hint = _FUNCTIONS.get(part.method)
            yield ScriptWarning(warnings.CALL_WITHOUT_HANDLE, message, part.span, hint)


_FUNCTIONS = {
    "append": "a list has a fixed length; write one that is long enough",
    "length": "write length(x)",
    "size": "write length(x)",
    "len": "write length(x)",
    "count": "write length(x)",
    "find": "write str_find(x, target)",
    "index": "write str_find(x, target)",
    "format": "write str_cat(x, y)",
    "strip": "write str_sub(x, first, length)",
    "split": "write str_find and str_sub",
}
"""Replacements for methods of lists and strings in other languages."""


def _has_effect(value: Expression) -> bool:
    is_pause = isinstance(value, nodes.Name) and value.name == "pause"
    return is_pause or isinstance(value, (nodes.Call, nodes.MethodCall, nodes.RunThread))


def _unused(value: Expression) -> tuple[str, str | None]:
    match value:
        case nodes.BinaryOperation(operator="==", left=nodes.Name(name=name)):
            return "the result of this comparison is not used", f"write {name} = ... to assign"
        case nodes.BinaryOperation(
            operator="+" | "-" as operator, right=nodes.UnaryOperation(operator=sign)
        ) if sign == operator:
            hint = f"there is no '{operator}{operator}': write x = x {operator} 1"
            return "a value is computed and not used", hint
    return "a value is computed and not used", None
