"""Long blocks of a program body in pieces: each becomes a Python function of its own, see `compiler`."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from typing import Final

from urscript.compile.python_tree import function, load, place
from urscript.source import Span
from urscript.syntax import nodes
from urscript.syntax.nodes import Block, Statement
from urscript.syntax.walk import own_blocks

PART: Final = "main_"
"""What the names of these functions begin with; no function of a script is called so."""

LONGEST: Final = 60
"""Statements of a piece, those in its blocks included. Python compiles them in less than a millisecond."""


def pieces(block: Block) -> Iterator[Block]:
    """The statements of `block` in order, in pieces that can stand alone; the last one never does.

    What leaves the block (`break` of a loop around it, `return`) is a piece of one statement.
    """
    if _weight(block) <= LONGEST:
        yield block
        return
    piece: list[Statement] = []
    weight = 0
    for statement in block[:-1]:
        own = 1 + sum(min(_weight(inner), LONGEST) for inner in own_blocks(statement))
        if _leaves(statement):
            if piece:
                yield tuple(piece)
            yield (statement,)
            piece, weight = [], 0
            continue
        if weight + own > LONGEST and piece:
            yield tuple(piece)
            piece, weight = [], 0
        piece.append(statement)
        weight += own
    if piece:
        yield tuple(piece)
    yield block[-1:]


def part(name: str, body: list[ast.stmt], span: Span) -> ast.FunctionDef:
    """The function of a piece: a generator, whether it waits or not; `body` begins with what it declares."""
    at = place(span)
    never = ast.If(ast.Constant(False, **at), [ast.Expr(ast.Yield(None, **at), **at)], [], **at)
    return function(name, [], [body[0], never, *body[1:]], span)


def call_of(name: str, span: Span) -> ast.stmt:
    """`yield from name()`."""
    at = place(span)
    made = ast.Call(load(name, span), [], [], **at)
    return ast.Expr(ast.YieldFrom(made, **at), **at)


def _weight(block: Block) -> int:
    """Statements of a block, those in its blocks included."""
    return sum(1 + sum(map(_weight, own_blocks(statement))) for statement in block)


def _leaves(statement: Statement, in_loop: bool = False) -> bool:
    """Whether control can leave `statement` to somewhere else than behind it, other than by an end of all."""
    match statement:
        case nodes.Return():
            return True
        case nodes.Simple(word="break" | "continue"):
            return not in_loop
    inside = in_loop or isinstance(statement, nodes.While)
    return any(_leaves(inner, inside) for block in own_blocks(statement) for inner in block)
