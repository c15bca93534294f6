"""Texts of programs for tests: by hand, from trees, and random ones.

`print_program` writes a tree in the canonical layout, which parses to the same tree: two blanks a level, one
statement a line, only the brackets that are needed. Comments, blank lines and spare brackets are not in the tree, so
they are not printed; `formatter` keeps them. The strategies of Hypothesis have every node, in every place where the
grammar can put it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, Final

from hypothesis import strategies as st

from urscript.formatter import INDENT
from urscript.syntax import nodes
from urscript.syntax.nodes import Block, Expression, Statement


def program_of(*lines: str) -> str:
    """The text of a program `p` with these lines, as if typed by hand: indented all alike."""
    return "def p():\n" + "".join(f"  {line}\n" for line in lines) + "end\n"


# --- trees to text


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
            yield indent + _FORMS[type(statement)](statement)


def _parameter(parameter: nodes.Parameter) -> str:
    default = "" if parameter.default is None else f"={print_expression(parameter.default)}"
    return f"{parameter.name}{default}"


def _expression(expression: Expression, level: int) -> str:
    """The text of `expression` where nothing that binds looser than `level` may stand without brackets."""
    text = _FORMS[type(expression)](expression)
    return f"({text})" if _level(expression) < level else text


def _level(expression: Expression) -> int:
    match expression:
        case nodes.UnaryOperation(operator=operator):
            return _LEVEL["not"] if operator == "not" else _UNARY
        case nodes.BinaryOperation(operator=operator):
            return _LEVEL.get(operator, _LEVEL["compare"])
    return _POSTFIX


def _binary(operation: nodes.BinaryOperation) -> str:
    level = _level(operation)
    # Comparisons do not chain, so neither side of one may be another.
    left = _expression(operation.left, level + (level == _LEVEL["compare"]))
    return f"{left} {operation.operator} {_expression(operation.right, level + 1)}"


def _target(expression: Expression) -> str:
    """What stands before a dot or an index; a bare number there would run into the dot."""
    text = _expression(expression, _POSTFIX)
    return f"({text})" if isinstance(expression, (nodes.IntLiteral, nodes.FloatLiteral)) else text


def _list(items: Iterable[Expression]) -> str:
    return ", ".join(map(print_expression, items))


def _arguments(arguments: Iterable[nodes.Argument]) -> str:
    return ", ".join(
        f"{item.name}={print_expression(item.value)}" if item.name else print_expression(item.value)
        for item in arguments
    )


_FORMS: Final[dict[type, Callable[[Any], str]]] = {
    nodes.NoneLiteral: lambda _: "None",
    nodes.BoolLiteral: lambda it: str(it.value),
    nodes.IntLiteral: lambda it: str(it.value),
    nodes.FloatLiteral: lambda it: it.text or repr(it.value),
    nodes.StringLiteral: lambda it: f'"{it.value}"',
    nodes.ListLiteral: lambda it: f"[{_list(it.items)}]",
    nodes.PoseLiteral: lambda it: f"p[{_list(it.items)}]",
    nodes.Name: lambda it: it.name,
    nodes.Call: lambda it: f"{it.function}({_arguments(it.arguments)})",
    nodes.MethodCall: lambda it: f"{_target(it.target)}.{it.method}({_arguments(it.arguments)})",
    nodes.Subscript: lambda it: f"{_target(it.target)}[{_list(it.indices)}]",
    nodes.Attribute: lambda it: f"{_target(it.target)}.{it.name}",
    nodes.RunThread: lambda it: f"run {it.thread}()",
    nodes.UnaryOperation: lambda it: it.operator.replace("not", "not ") + _expression(it.operand, _level(it)),
    nodes.BinaryOperation: _binary,
    # statements of one line
    nodes.Assign: lambda it: f"{it.scope or ''} {_list([it.target])} = {_list([it.value])}".lstrip(),
    nodes.Declaration: lambda it: f"{it.scope} {it.name}",
    nodes.ExpressionStatement: lambda it: print_expression(it.value),
    nodes.Return: lambda it: "return" if it.value is None else f"return {print_expression(it.value)}",
    nodes.Join: lambda it: f"join {print_expression(it.thread)}",
    nodes.Kill: lambda it: f"kill {print_expression(it.thread)}",
    nodes.KeywordStatement: lambda it: it.keyword,
    nodes.Label: lambda it: f"$ {it.text}".rstrip(" "),
}
"""The text of each kind of node that stands on one line."""


# --- random trees and words


VARIABLES = ["a", "b", "c", "type", "time", "p", "_x1"]
FUNCTIONS = ["f", "g", "sync", "norm", "to_str", "movej"]
OPERATORS = ["+", "-", "*", "/", "%", "==", "!=", "<", ">", "<=", ">=", "and", "or", "xor"]
SIMPLE = ["break", "continue", "halt", "enter_critical", "exit_critical"]
_WORDS = """
def sec thread end if elif else while break continue return run kill join halt global local and or xor not
enter_critical exit_critical True False None ( ) [ ] : , = == != < > <= >= + - * / % . ! x p foo() sync() 1 2.5
.5 1e3 99999999999 0x1f $ # "s" " ; { } ' \\ ä \x00
"""
WORDS = [*_WORDS.split(), "\n"]
"""For texts that are hardly ever programs."""

numbers = st.one_of(
    st.integers(-(2**31), 2**31 - 1),
    st.floats(allow_nan=False, allow_infinity=False, width=32),
    st.sampled_from([0, 1, -1, 0.0, 2**31 - 1, -(2**31)]),
)
variables = st.sampled_from(VARIABLES)
names = variables.map(nodes.Name)
texts = st.text(st.characters(max_codepoint=255, exclude_characters='"\n'), max_size=6)
literals = st.one_of(
    st.integers(0, 2**31 - 1).map(nodes.IntLiteral),
    st.floats(0, 1e30).map(nodes.FloatLiteral),
    st.booleans().map(nodes.BoolLiteral),
    texts.map(nodes.StringLiteral),
    st.just(nodes.NoneLiteral()),
    names,
    st.just(nodes.RunThread("t")),
)


def _some_arguments(values):
    positional = st.lists(st.builds(nodes.Argument, values), max_size=3)
    named = st.lists(st.builds(nodes.Argument, values, variables), max_size=2)
    return st.tuples(positional, named).map(lambda parts: tuple(parts[0] + parts[1]))


def _is_no_pose(index):
    return not (index.target == nodes.Name("p") and len(index.indices) == 6)


def _compound(values):
    indices = st.lists(values, min_size=1, max_size=2).map(tuple)
    return st.one_of(
        st.builds(nodes.ListLiteral, st.lists(values, max_size=4).map(tuple)),
        st.builds(nodes.PoseLiteral, st.lists(values, min_size=6, max_size=6).map(tuple)),
        st.builds(nodes.UnaryOperation, st.sampled_from(["-", "+", "not"]), values),
        st.builds(nodes.BinaryOperation, st.sampled_from(OPERATORS), values, values),
        st.builds(nodes.Call, st.sampled_from(FUNCTIONS), _some_arguments(values)),
        st.builds(nodes.MethodCall, values, variables, _some_arguments(values)),
        st.builds(nodes.Attribute, values, variables),
        st.builds(nodes.Subscript, values, indices).filter(_is_no_pose),
    )


expressions = st.recursive(literals, _compound, max_leaves=10)
targets = st.recursive(
    names,
    lambda inner: st.one_of(
        st.builds(nodes.Subscript, inner, st.lists(expressions, min_size=1, max_size=2).map(tuple)),
        st.builds(nodes.Attribute, inner, variables),
    ),
    max_leaves=3,
)


def _starts_a_statement(expression):
    """Whether its text cannot be read as going on with the statement before."""
    return print_expression(expression)[0] not in "([-+"


short_statements = st.one_of(
    st.builds(nodes.Assign, targets, expressions),
    st.builds(nodes.Assign, names, expressions, st.sampled_from(["global", "local"])),
    st.builds(nodes.Declaration, variables, st.sampled_from(["global", "local"])),
    st.builds(nodes.ExpressionStatement, expressions.filter(_starts_a_statement)),
    st.builds(nodes.Return, expressions),
    st.builds(nodes.Kill, expressions),
    st.builds(nodes.Join, expressions),
    st.sampled_from(SIMPLE).map(nodes.KeywordStatement),
    st.sampled_from(["", '3 "MoveJ"', '12 "Größe" "noBreak"', "def x():"]).map(nodes.Label),
)
parameters = st.lists(
    st.builds(nodes.Parameter, variables, st.none() | expressions),
    max_size=3,
    unique_by=lambda parameter: parameter.name,
).map(tuple)


def _block_of(statements):
    """Statements, at their end perhaps a `return` without a value: in front of a value it would take it."""
    ends = st.sampled_from([(), (nodes.Return(None),)])
    return st.tuples(st.lists(statements, max_size=4), ends).map(lambda parts: (*parts[0], *parts[1]))


def _blocks(statements):
    block = _block_of(statements)
    branches = st.lists(st.builds(nodes.Branch, expressions, block), min_size=1, max_size=3).map(tuple)
    return st.one_of(
        st.builds(nodes.If, branches, st.none() | block),
        st.builds(nodes.While, expressions, block),
        st.builds(nodes.Function, st.sampled_from(["def", "sec"]), st.sampled_from(FUNCTIONS), parameters, block),
        st.builds(nodes.Function, st.just("thread"), st.just("t"), st.just(()), block),
    )  # fmt: skip


statements = st.recursive(short_statements, _blocks, max_leaves=8)
programs = _block_of(statements)


def node_classes(value):
    """The classes of all nodes in a tree."""
    found = set()
    if isinstance(value, nodes.Node):
        found.add(type(value))
        for name in value.__dataclass_fields__:
            found |= node_classes(getattr(value, name))
    elif isinstance(value, tuple):
        for item in value:
            found |= node_classes(item)
    return found
