"""Nodes of the Python tree of a compiled program; each has a position in the script.

Python keeps the positions in the code object, so the position of an error is found from the traceback and
costs nothing at run time.
"""

import ast
from typing import Any

from urscript.source import Span


def place(span: Span) -> dict[str, Any]:
    """The position attributes of a Python node; nobody asks for its end."""
    return {"lineno": span.line, "col_offset": span.column - 1}


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


def discarded(value: ast.expr, span: Span) -> ast.Expr:
    """`value` as a statement; what it is, is not used."""
    return ast.Expr(value, **place(span))


def charge(statements: int, extra: int, span: Span) -> list[ast.stmt]:
    """`_x += extra`, `if (_b := _b - cost) < 0: yield _OUT_OF_UNITS`: charges a block before it runs."""
    at = place(span)
    rest = ast.NamedExpr(
        ast.Name("_b", ast.Store(), **at),
        ast.BinOp(load("_b", span), ast.Sub(), constant(statements + extra, span), **at),
        **at,
    )
    pay = _ask(rest, span)
    if not extra:
        return [pay]
    beyond = ast.AugAssign(ast.Name("_x", ast.Store(), **at), ast.Add(), constant(extra, span), **at)
    return [beyond, pay]


def ask(span: Span) -> ast.If:
    """`if _b < 0: yield _OUT_OF_UNITS`: asks whether the program may go on in this cycle."""
    return _ask(load("_b", span), span)


def ask_after(value: ast.expr) -> ast.expr:
    """`(value, _b < 0 and (yield _OUT_OF_UNITS))[0]`: `value`, then the question of `ask`."""
    line, column = value.lineno, value.col_offset + 1
    span = Span(line, column, line, column)
    at = place(span)
    wait = ast.BoolOp(ast.And(), [_is_used_up(load("_b", span), span), _wait(span)], **at)
    both = ast.Tuple([value, wait], ast.Load(), **at)
    return ast.Subscript(both, constant(0, span), ast.Load(), **at)


def _ask(left: ast.expr, span: Span) -> ast.If:
    return ast.If(_is_used_up(left, span), [discarded(_wait(span), span)], [], **place(span))


def _is_used_up(left: ast.expr, span: Span) -> ast.Compare:
    return ast.Compare(left, [ast.Lt()], [constant(0, span)], **place(span))


def _wait(span: Span) -> ast.Yield:
    return ast.Yield(load("_OUT_OF_UNITS", span), **place(span))


def function(name: str, parameters: list[str], body: list[ast.stmt], span: Span) -> ast.FunctionDef:
    """`def name(parameters...): body`."""
    at = place(span)
    names = [ast.arg(parameter, **at) for parameter in parameters]
    arguments = ast.arguments(posonlyargs=[], args=names, kwonlyargs=[], kw_defaults=[], defaults=[])
    later: dict[str, Any] = {"type_params": []}  # which Python 3.11 does not know
    return ast.FunctionDef(name, arguments, body, [], **later, **at)
