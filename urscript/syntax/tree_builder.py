"""The rules of the grammar as nodes: one method for each rule of `grammar.lark`, called by the parser.

What the grammar leaves open is decided here: what is a pose, what can be called, what can be assigned to.
"""

# ruff: noqa: D102 - a method is the rule of the grammar that it is named after
from __future__ import annotations

from typing import Any, cast

from urscript.errors import ScriptSyntaxError
from urscript.source import BLANKS, Span
from urscript.syntax import nodes


def _span(item: Any) -> Span:
    """The span of a node or token; lark's own tokens, in texts with errors, have four attributes instead."""
    span: Span | None = getattr(item, "span", None)
    return span or Span(item.line, item.column, item.end_line, item.end_column)


def _cover(items: list[Any]) -> Span:
    """The span from the first to the last of `items`."""
    first, last = _span(items[0]), _span(items[-1])
    return Span(first.line, first.column, last.end_line, last.end_column)


def _expressions(items: list[Any]) -> tuple[Any, ...]:
    """The nodes among `items`, without brackets, commas and gaps."""
    return tuple(item for item in items if isinstance(item, nodes.Node))


def _syntax_error(message: str, span: Span) -> ScriptSyntaxError:
    return ScriptSyntaxError(message, line=span.line, column=span.column, width=span.end_column - span.column)


class TreeBuilder:
    """One method per rule of the grammar; each gets the rule's tokens and finished nodes in order."""

    def start(self, items: list[Any]) -> nodes.Block:
        return cast(nodes.Block, items[0])

    def block(self, items: list[Any]) -> nodes.Block:
        return tuple(items)

    # definitions

    def function(self, items: list[Any]) -> nodes.Function:
        kind, name, _, parameters, _, _, body, end = items
        return nodes.Function(
            cast(Any, str(kind)), str(name), parameters, body, _span(end), span=_cover(items)
        )

    def thread(self, items: list[Any]) -> nodes.Function:
        _, name, _, _, _, body, end = items
        return nodes.Function("thread", str(name), (), body, _span(end), span=_cover(items))

    def params(self, items: list[Any]) -> tuple[nodes.Parameter, ...]:
        return _expressions(items)

    def param(self, items: list[Any]) -> nodes.Parameter:
        name, _, default = items
        return nodes.Parameter(str(name), default, span=_span(name))

    # statements

    def if_(self, items: list[Any]) -> nodes.If:
        first = nodes.Branch(items[1], items[3], span=_cover(items[:3]))
        rest = tuple(item for item in items[4:] if isinstance(item, nodes.Branch))
        else_body = items[-2]
        return nodes.If((first, *rest), else_body, span=_cover([items[0], items[-1]]))

    def elif_(self, items: list[Any]) -> nodes.Branch:
        return nodes.Branch(items[1], items[3], span=_cover(items[:3]))

    def while_(self, items: list[Any]) -> nodes.While:
        return nodes.While(items[1], items[3], span=_cover(items))

    def simple(self, items: list[Any]) -> nodes.KeywordStatement:
        return nodes.KeywordStatement(cast(Any, str(items[0])), span=_span(items[0]))

    def return_(self, items: list[Any]) -> nodes.Return:
        word, value = items
        return nodes.Return(value, span=_cover([word, word if value is None else value]))

    def join(self, items: list[Any]) -> nodes.Join:
        return nodes.Join(items[1], span=_cover(items))

    def kill(self, items: list[Any]) -> nodes.Kill:
        return nodes.Kill(items[1], span=_cover(items))

    def declare(self, items: list[Any]) -> nodes.Statement:
        word, name, _, value = items
        scope = cast(Any, str(word))
        if value is None:
            return nodes.Declaration(str(name), scope, span=_cover([word, name]))
        target = nodes.Name(str(name), span=_span(name))
        return nodes.Assign(target, value, scope, span=_cover(items))

    def assign(self, items: list[Any]) -> nodes.Assign:
        target, _, value = items
        root = target
        while isinstance(root, (nodes.Subscript, nodes.Attribute)):
            root = root.target
        if not isinstance(root, nodes.Name):
            raise _syntax_error(
                "cannot assign to this expression, only to a variable or an element of one", target.span
            )
        return nodes.Assign(target, value, span=_cover(items))

    def call_for_effect(self, items: list[Any]) -> nodes.ExpressionStatement:
        return nodes.ExpressionStatement(items[0], span=items[0].span)

    def label(self, items: list[Any]) -> nodes.Label:
        return nodes.Label(str(items[0])[1:].strip(BLANKS), span=_span(items[0]))

    # expressions

    def binary(self, items: list[Any]) -> nodes.BinaryOperation:
        left, operator, right = items
        return nodes.BinaryOperation(str(operator), left, right, span=_cover(items))

    def prefix(self, items: list[Any]) -> nodes.UnaryOperation:
        operator = "not" if items[0] == "!" else str(items[0])
        return nodes.UnaryOperation(cast(Any, operator), items[1], span=_cover(items))

    def call(self, items: list[Any]) -> nodes.Expression:
        callee, _, arguments, _ = items
        if isinstance(callee, nodes.Name):
            return nodes.Call(callee.name, arguments, span=_cover(items))
        if isinstance(callee, nodes.Attribute):
            return nodes.MethodCall(callee.target, callee.name, arguments, span=_cover(items))
        raise _syntax_error("cannot call this expression, only a function by its name", callee.span)

    def index(self, items: list[Any]) -> nodes.Expression:
        target, indices = items[0], _expressions(items[1:])
        # `p` is an ordinary name: only six items make it a pose. Source: maker's driver script.
        if len(indices) == 6 and isinstance(target, nodes.Name) and target.name == "p":
            return nodes.PoseLiteral(indices, span=_cover(items))
        if len(indices) > 2:
            raise _syntax_error(
                f"an index has 1 or 2 values, a pose p[...] 6, not {len(indices)}", _cover(items)
            )
        return nodes.Subscript(target, indices, span=_cover(items))

    def member(self, items: list[Any]) -> nodes.Attribute:
        return nodes.Attribute(items[0], str(items[2]), span=_cover(items))

    def args(self, items: list[Any]) -> tuple[nodes.Argument, ...]:
        return tuple(
            item if isinstance(item, nodes.Argument) else nodes.Argument(item, span=item.span)
            for item in items
            if isinstance(item, (nodes.Argument, nodes.Expression))
        )

    def named_argument(self, items: list[Any]) -> nodes.Argument:
        return nodes.Argument(items[2], str(items[0]), span=_cover(items))

    def integer(self, items: list[Any]) -> nodes.IntLiteral:
        span = _span(items[0])
        if len(items[0]) > 10 or int(items[0]) > 2**31:
            raise _syntax_error("this integer does not fit into 32 bits; write a float", span)
        return nodes.IntLiteral(int(items[0]), span=span)

    def float_(self, items: list[Any]) -> nodes.FloatLiteral:
        return nodes.FloatLiteral(float(items[0]), str(items[0]), span=_span(items[0]))

    def string(self, items: list[Any]) -> nodes.StringLiteral:
        return nodes.StringLiteral(str(items[0])[1:-1], span=_span(items[0]))

    def true(self, items: list[Any]) -> nodes.BoolLiteral:
        return nodes.BoolLiteral(True, span=_span(items[0]))

    def false(self, items: list[Any]) -> nodes.BoolLiteral:
        return nodes.BoolLiteral(False, span=_span(items[0]))

    def none(self, items: list[Any]) -> nodes.NoneLiteral:
        return nodes.NoneLiteral(span=_span(items[0]))

    def name(self, items: list[Any]) -> nodes.Name:
        return nodes.Name(str(items[0]), span=_span(items[0]))

    def group(self, items: list[Any]) -> nodes.Expression:
        return cast(nodes.Expression, items[1])

    def list_(self, items: list[Any]) -> nodes.ListLiteral:
        return nodes.ListLiteral(_expressions(items), span=_cover(items))

    def run(self, items: list[Any]) -> nodes.RunThread:
        return nodes.RunThread(str(items[1]), span=_cover(items))
