"""Tree -> text in the canonical layout, which parses to the same tree; for tests with random trees.

Two blanks a level, one statement a line, only the brackets that are needed. Comments, blank lines and spare
brackets are not in the tree, so they are not printed; `formatter` keeps them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final

from urscript.formatter import INDENT
from urscript.syntax import nodes
from urscript.syntax.nodes import Block, Expression, Statement

_LEVEL: Final = {"or": 1, "xor": 2, "and": 3, "not": 4, "compare": 5, "+": 6, "-": 6, "*": 7, "/": 7, "%": 7}
_UNARY: Final = 8
_POSTFIX: Final = 9
"""How tightly an operator binds; language notes, precedence table."""


def print_program(program: Block) -> str:
    """The text of a whole tree, one line feed at the end of each line."""
    return "".join(f"{line}\n" for line in _block(program, ""))


def print_expression(expression: Expression) -> str:
    """The text of one expression."""
    return _expression(expression, 0)


def _block(block: Block, indent: str) -> Iterator[str]:
    for statement in block:
        yield from _statement(statement, indent)


def _statement(statement: Statement, indent: str) -> Iterator[str]:
    deeper = indent + INDENT
    match statement:
        case nodes.Function(kind=kind, name=name, parameters=parameters, body=body):
            yield f"{indent}{kind} {name}({', '.join(map(_parameter, parameters))}):"
            yield from _block(body, deeper)
            yield f"{indent}end"
        case nodes.If(branches=branches, else_body=else_body):
            for word, branch in zip(["if"] + ["elif"] * (len(branches) - 1), branches, strict=True):
                yield f"{indent}{word} {_expression(branch.condition, 0)}:"
                yield from _block(branch.body, deeper)
            if else_body is not None:
                yield f"{indent}else:"
                yield from _block(else_body, deeper)
            yield f"{indent}end"
        case nodes.While(condition=condition, body=body):
            yield f"{indent}while {_expression(condition, 0)}:"
            yield from _block(body, deeper)
            yield f"{indent}end"
        case _:
            yield indent + _short_statement(statement)


def _short_statement(statement: Statement) -> str:
    """A statement of one line."""
    match statement:
        case nodes.Assign(target=target, value=value, scope=scope):
            lead = f"{scope} " if scope else ""
            return f"{lead}{_expression(target, 0)} = {_expression(value, 0)}"
        case nodes.Declaration(name=name, scope=scope):
            return f"{scope} {name}"
        case nodes.ExpressionStatement(value=value):
            return _expression(value, 0)
        case nodes.Return(value=value):
            return "return" if value is None else f"return {_expression(value, 0)}"
        case nodes.Join(thread=thread):
            return f"join {_expression(thread, 0)}"
        case nodes.Kill(thread=thread):
            return f"kill {_expression(thread, 0)}"
        case nodes.KeywordStatement(keyword=word):
            return word
        case nodes.Label(text=text):
            return f"$ {text}" if text else "$"
    raise TypeError(f"not a statement: {statement!r}")


def _parameter(parameter: nodes.Parameter) -> str:
    if parameter.default is None:
        return parameter.name
    return f"{parameter.name}={_expression(parameter.default, 0)}"


def _expression(expression: Expression, level: int) -> str:
    """The text of `expression` where nothing that binds looser than `level` may stand without brackets."""
    text, own_level = _bare(expression)
    return f"({text})" if own_level < level else text


def _bare(expression: Expression) -> tuple[str, int]:
    match expression:
        case nodes.NoneLiteral():
            return "None", _POSTFIX
        case nodes.BoolLiteral(value=truth):
            return str(truth), _POSTFIX
        case nodes.IntLiteral(value=number):
            return str(number), _POSTFIX
        case nodes.FloatLiteral(value=real, text=spelling):
            return spelling or repr(real), _POSTFIX
        case nodes.StringLiteral(value=string):
            return f'"{string}"', _POSTFIX
        case nodes.ListLiteral(items=items):
            return f"[{_list(items)}]", _POSTFIX
        case nodes.PoseLiteral(items=items):
            return f"p[{_list(items)}]", _POSTFIX
        case nodes.Name(name=name):
            return name, _POSTFIX
        case nodes.Call(function=function, arguments=arguments):
            return f"{function}({_arguments(arguments)})", _POSTFIX
        case nodes.MethodCall(target=target, method=method, arguments=arguments):
            return f"{_target(target)}.{method}({_arguments(arguments)})", _POSTFIX
        case nodes.Subscript(target=target, indices=indices):
            return f"{_target(target)}[{_list(indices)}]", _POSTFIX
        case nodes.Attribute(target=target, name=name):
            return f"{_target(target)}.{name}", _POSTFIX
        case nodes.RunThread(thread=thread):
            return f"run {thread}()", _POSTFIX
        case nodes.UnaryOperation(operator="not", operand=operand):
            return f"not {_expression(operand, _LEVEL['not'])}", _LEVEL["not"]
        case nodes.UnaryOperation(operator=operator, operand=operand):
            return f"{operator}{_expression(operand, _UNARY)}", _UNARY
        case nodes.BinaryOperation(operator=operator, left=left, right=right):
            level = _LEVEL.get(operator, _LEVEL["compare"])
            # Comparisons do not chain, so neither side of one may be another.
            left_level = level + 1 if level == _LEVEL["compare"] else level
            return f"{_expression(left, left_level)} {operator} {_expression(right, level + 1)}", level
    raise TypeError(f"not an expression: {expression!r}")


def _target(expression: Expression) -> str:
    """What stands before a dot or an index; a bare number there would run into the dot."""
    text = _expression(expression, _POSTFIX)
    return f"({text})" if isinstance(expression, (nodes.IntLiteral, nodes.FloatLiteral)) else text


def _list(items: Iterable[Expression]) -> str:
    return ", ".join(_expression(item, 0) for item in items)


def _arguments(arguments: Iterable[nodes.Argument]) -> str:
    return ", ".join(
        (f"{argument.name}=" if argument.name else "") + _expression(argument.value, 0)
        for argument in arguments
    )
