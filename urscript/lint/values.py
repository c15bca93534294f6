"""Warnings about values: unused results, methods of values without methods."""

from __future__ import annotations

from collections.abc import Iterator

from urscript.catalogue import Catalogue
from urscript.lint.names import expressions_read
from urscript.lint.rules import CALL_WITHOUT_HANDLE, UNUSED_VALUE, ScriptWarning
from urscript.names.scopes import ResolvedProgram
from urscript.syntax import nodes
from urscript.syntax.nodes import Expression
from urscript.syntax.walk import all_statements


def value_warnings(program: ResolvedProgram, catalogue: Catalogue) -> Iterator[ScriptWarning]:
    """Everything this module warns about, in no order."""
    for scope in program.scopes():
        for statement in all_statements(scope.body):
            if isinstance(statement, nodes.ExpressionStatement) and not _has_effect(statement.value):
                message, hint = _unused(statement.value)
                yield ScriptWarning(UNUSED_VALUE, message, statement.span, program.source, hint)
    if "rpc_factory" in program.builtins or catalogue.methods:
        return
    for _, part in expressions_read(program):
        if isinstance(part, nodes.MethodCall):
            message = f"nothing in this program has a method '{part.method}'"
            hint = _FUNCTIONS.get(part.method)
            yield ScriptWarning(CALL_WITHOUT_HANDLE, message, part.span, program.source, hint)


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
    """Message and hint for an unused value."""
    match value:
        case nodes.BinaryOperation(operator="==", left=nodes.Name(name=name)):
            return "the result of this comparison is not used", f"write {name} = ... to assign"
        case nodes.BinaryOperation(
            operator="+" | "-" as operator, right=nodes.UnaryOperation(operator=sign)
        ) if sign == operator:
            hint = f"there is no '{operator}{operator}': write x = x {operator} 1"
            return "a value is computed and not used", hint
    return "a value is computed and not used", None
