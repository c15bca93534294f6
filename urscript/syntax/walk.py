"""Traversal of a tree: expressions of a statement, parts of an expression, nested statements."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from functools import cache
from typing import Any

from urscript.syntax import nodes
from urscript.syntax.nodes import Block, Expression, Statement


def child_expressions(expression: Expression) -> tuple[Expression, ...]:
    """The direct parts of an expression, in the order they are evaluated."""
    match expression:
        case nodes.BinaryOperation(left=left, right=right):
            return left, right
        case nodes.Call(arguments=arguments):
            return tuple(argument.value for argument in arguments)
        case nodes.UnaryOperation(operand=operand):
            return (operand,)
        case nodes.Subscript(target=target, indices=indices):
            return target, *indices
        case nodes.ListLiteral(items=items) | nodes.PoseLiteral(items=items):
            return items
        case nodes.MethodCall(target=target, arguments=arguments):
            return target, *(argument.value for argument in arguments)
        case nodes.Attribute(target=target):
            return (target,)
    return ()


def own_expressions(statement: Statement) -> tuple[Expression, ...]:
    """The expressions a statement evaluates itself, not those of the blocks in it.

    An assignment to `x[i]` lists `x[i]` after the value, one to a plain name lists the value only.
    """
    match statement:
        case nodes.Assign(target=nodes.Name(), value=value):
            return (value,)
        case nodes.Assign(target=target, value=value):
            return value, target
        case nodes.ExpressionStatement(value=value):
            return (value,)
        case nodes.If(branches=branches):
            return tuple(branch.condition for branch in branches)
        case nodes.While(condition=condition):
            return (condition,)
        case nodes.Return(value=result) if result is not None:
            return (result,)
        case nodes.Join(thread=thread) | nodes.Kill(thread=thread):
            return (thread,)
    return ()


def own_blocks(statement: Statement) -> tuple[Block, ...]:
    """The blocks inside an `if` or `while`; the body of a function belongs to its own scope."""
    match statement:
        case nodes.If(branches=branches, else_body=else_body):
            return (*(branch.body for branch in branches), else_body or ())
        case nodes.While(body=body):
            return (body,)
    return ()


def all_statements(block: Block) -> Iterator[Statement]:
    """Every statement of a block and of the blocks in it, in the order of the text."""
    for statement in block:
        yield statement
        for inner in own_blocks(statement):
            yield from all_statements(inner)


def all_expressions(expression: Expression) -> Iterator[Expression]:
    """An expression and every part of it."""
    yield expression
    for part in child_expressions(expression):
        yield from all_expressions(part)


def same_tree(first: Block, second: Block) -> bool:
    """Whether two trees are equal, as by `==`, for trees of any depth."""
    todo: list[tuple[Any, Any]] = [(first, second)]
    while todo:
        one, other = todo.pop()
        if type(one) is not type(other):
            return False
        if isinstance(one, nodes.Node):
            names = _meaning(type(one).__name__)
            todo += [(getattr(one, name), getattr(other, name)) for name in names]
        elif isinstance(one, tuple):
            if len(one) != len(other):
                return False
            todo += zip(one, other, strict=True)
        elif one != other:
            return False
    return True


@cache
def _meaning(kind: str) -> tuple[str, ...]:
    """The fields of a node of that kind that count when trees are compared."""
    return tuple(item.name for item in fields(getattr(nodes, kind)) if item.compare)


def falls_through(block: Block) -> bool:
    """Whether control can reach the end of the block: not every branch of its last statement returns."""
    if not block:
        return True
    match block[-1]:
        case nodes.Return():
            return False
        case nodes.KeywordStatement(keyword="halt"):
            return False
        case nodes.If(branches=branches, else_body=else_body) if else_body is not None:
            return falls_through(else_body) or any(falls_through(branch.body) for branch in branches)
    return True
