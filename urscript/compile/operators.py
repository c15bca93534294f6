"""Operators -> Python operators, where the static types of the operands are known."""

from __future__ import annotations

import ast
from typing import Final

from urscript import dialect
from urscript.compile.inference import Type, is_numeric
from urscript.compile.python_tree import call, constant, load, place
from urscript.source import Span
from urscript.values import INT_MAX, INT_MIN

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

HELPERS: Final = {operator: name for operator, (name, _) in (_ARITHMETIC | _COMPARISON).items()}
"""Operator -> the function of the run-time library that does it on values of any type."""


def plain_operation(
    operator: str, left: ast.expr, right: ast.expr, types: tuple[Type, Type], span: Span
) -> ast.expr | None:
    """The operation as one of Python; None where the types need the run-time library."""
    are_numbers = all(map(is_numeric, types))
    if operator in _COMPARISON:
        are_bools = types == (Type.BOOL, Type.BOOL) and operator in ("==", "!=")
        if not are_numbers and not are_bools:
            return None
        return ast.Compare(left, [_COMPARISON[operator][1]()], [right], **place(span))
    if not are_numbers or operator == "%":
        return None
    raw = ast.BinOp(left, _ARITHMETIC[operator][1](), right, **place(span))
    if operator == "/":
        return None if dialect.EXACT_DIVISION_GIVES_INT else raw
    if Type.FLOAT in types:
        return raw
    return _wrapped(raw, span) if types == (Type.INT, Type.INT) else None


def logic(operator: str, values: list[ast.expr], span: Span, *, short_circuit: bool = True) -> ast.expr:
    """Conditions joined by `and`, `or` or `xor`; without `short_circuit` all are evaluated."""
    at = place(span)
    if operator == "xor":
        left, right = values
        return ast.Compare(left, [ast.NotEq()], [right], **at)
    if short_circuit:
        return ast.BoolOp(ast.And() if operator == "and" else ast.Or(), values, **at)
    result = values[0]
    for value in values[1:]:
        result = ast.BinOp(result, ast.BitAnd() if operator == "and" else ast.BitOr(), value, **at)
    return result


def _wrapped(raw: ast.expr, span: Span) -> ast.expr:
    """`_i if INT_MIN <= (_i := raw) <= INT_MAX else _wrap(_i)`: a result of 32 bits."""
    at = place(span)
    bound = ast.NamedExpr(ast.Name("_i", ast.Store(), **at), raw, **at)
    fits = ast.Compare(
        constant(INT_MIN, span), [ast.LtE(), ast.LtE()], [bound, constant(INT_MAX, span)], **at
    )
    return ast.IfExp(fits, load("_i", span), call("_wrap", [load("_i", span)], span), **at)
