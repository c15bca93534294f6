"""Nodes of the Python tree of a compiled program; each has a position in the script.

Python keeps the positions in the code object, so the position of an error is found from the traceback and
costs nothing at run time.
"""

from __future__ import annotations

import ast
from typing import Any

from urscript.source import Span


def place(span: Span) -> dict[str, Any]:
    """The position attributes of a Python node."""
    return {
        "lineno": span.line,
        "col_offset": span.column - 1,
        "end_lineno": span.end_line,
        "end_col_offset": span.end_column - 1,
    }


def load(name: str, span: Span) -> ast.Name:
    """`name`."""
    return ast.Name(name, ast.Load(), **place(span))


def store(name: str, value: ast.expr, span: Span) -> ast.Assign:
    """`name = value`."""
    at = place(span)
    return ast.Assign([ast.Name(name, ast.Store(), **at)], value, **at)


def constant(value: Any, span: Span) -> ast.Constant:
    """A literal of a plain type."""
    return ast.Constant(value, **place(span))


def call(function: str, arguments: list[ast.expr], span: Span) -> ast.Call:
    """`function(arguments...)`."""
    at = place(span)
    return ast.Call(ast.Name(function, ast.Load(), **at), arguments, [], **at)


def expression_statement(value: ast.expr, span: Span) -> ast.Expr:
    """`value` alone."""
    return ast.Expr(value, **place(span))


def charge_statements(cost: int, span: Span) -> ast.If:
    """`if (_b := _b - cost) < 0: _over()`: charges statements to the budget of this cycle."""
    at = place(span)
    rest = ast.NamedExpr(
        ast.Name("_b", ast.Store(), **at),
        ast.BinOp(load("_b", span), ast.Sub(), constant(cost, span), **at),
        **at,
    )
    test = ast.Compare(rest, [ast.Lt()], [constant(0, span)], **at)
    return ast.If(test, [expression_statement(call("_over", [], span), span)], [], **at)


def function(name: str, parameters: list[str], body: list[ast.stmt], span: Span) -> ast.FunctionDef:
    """`def name(parameters...): body`."""
    at = place(span)
    arguments = ast.arguments(
        posonlyargs=[],
        args=[ast.arg(parameter, **at) for parameter in parameters],
        kwonlyargs=[],
        kw_defaults=[],
        defaults=[],
    )
    fields: dict[str, Any] = {
        "name": name,
        "args": arguments,
        "body": body,
        "decorator_list": [],
        "type_params": [],
    }
    return ast.FunctionDef(**fields, **at)
