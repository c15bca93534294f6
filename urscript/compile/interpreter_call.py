"""The call of `interpreter_mode`: the statements that it runs read and change the locals of its function.

Nobody else sees the locals of a function that waits in a call. So they are handed over at the beginning and
taken back at the end:

    ((_l := (yield from _interpret(b_interpreter_mode(...), "f0_name", {"l_x": v_x})), v_x := _l[0]), None)[1]
"""

from __future__ import annotations

import ast

from urscript.compile.python_tree import call, constant, load, place
from urscript.names.scopes import FunctionScope
from urscript.source import Span


def interpreter_call(made: ast.expr, scope: FunctionScope, span: Span) -> ast.expr:
    """The expression of a call; its value is None.

    Args:
        made: The call of the builtin, which returns where the statements come from.
        scope: Of the function that calls it.
        span: Of the call.
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
