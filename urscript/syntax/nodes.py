"""The syntax tree of a program: frozen nodes, each with its span of the text.

The comparison of trees ignores spans and the spelling of numbers.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from functools import cache
from typing import Any, Literal

from urscript.source import NOWHERE, Span


@dataclass(frozen=True, slots=True)
class Node:
    """A node of the tree."""

    span: Span = field(default=NOWHERE, compare=False, repr=False, kw_only=True)


class Expression(Node):
    """A node with a value."""

    __slots__ = ()


class Statement(Node):
    """A node of a block."""

    __slots__ = ()


Block = tuple[Statement, ...]

# --- expressions ---------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class NoneLiteral(Expression):
    """`None`."""


@dataclass(frozen=True, slots=True)
class BoolLiteral(Expression):
    """`True`, `False`."""

    value: bool


@dataclass(frozen=True, slots=True)
class IntLiteral(Expression):
    """Decimal digits; never negative, a sign is a `UnaryOperation`."""

    value: int


@dataclass(frozen=True, slots=True)
class FloatLiteral(Expression):
    """`1.5`, `.5`, `1e-10`; `text` is the spelling, kept for printing."""

    value: float
    text: str = field(default="", compare=False)


@dataclass(frozen=True, slots=True)
class StringLiteral(Expression):
    """Text between double quotes, without them; one character a byte."""

    value: str


@dataclass(frozen=True, slots=True)
class ListLiteral(Expression):
    """`[a, b]`; a list of lists is a matrix."""

    items: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class PoseLiteral(Expression):
    """`p[x, y, z, rx, ry, rz]`: always six items."""

    items: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class Name(Expression):
    """A variable."""

    name: str


@dataclass(frozen=True, slots=True)
class UnaryOperation(Expression):
    """`-x`, `+x`, `not x` (also written `!x`)."""

    operator: Literal["-", "+", "not"]
    operand: Expression


@dataclass(frozen=True, slots=True)
class BinaryOperation(Expression):
    """Two operands: arithmetic, comparison, `and`, `or`, `xor`."""

    operator: str
    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True)
class Argument(Node):
    """One argument of a call; `name` is None for a positional one."""

    value: Expression
    name: str | None = None


@dataclass(frozen=True, slots=True)
class Call(Expression):
    """A call of a function by its name; functions are not values."""

    function: str
    arguments: tuple[Argument, ...]


@dataclass(frozen=True, slots=True)
class MethodCall(Expression):
    """A call of a method of a value: `handle.method(x)`."""

    target: Expression
    method: str
    arguments: tuple[Argument, ...]


@dataclass(frozen=True, slots=True)
class Subscript(Expression):
    """`x[i]` or, in a matrix, `x[row, column]`."""

    target: Expression
    indices: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class Attribute(Expression):
    """`x.member` of a struct."""

    target: Expression
    name: str


@dataclass(frozen=True, slots=True)
class RunThread(Expression):
    """`run thread_name()`: starts a thread, its value is the handle."""

    thread: str


# --- statements ----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Assign(Statement):
    """`x = value`, `x[i] = value`, `global x = value`, `local x = value`."""

    target: Name | Subscript | Attribute
    value: Expression
    scope: Literal["global", "local"] | None = None


@dataclass(frozen=True, slots=True)
class Declaration(Statement):
    """`global x` or `local x` without a value."""

    name: str
    scope: Literal["global", "local"]


@dataclass(frozen=True, slots=True)
class ExpressionStatement(Statement):
    """An expression as a statement."""

    value: Expression


@dataclass(frozen=True, slots=True)
class Branch(Node):
    """One condition of an `if` and its block."""

    condition: Expression
    body: Block


@dataclass(frozen=True, slots=True)
class If(Statement):
    """`if` and `elif` branches in order, and the `else` block (None when absent)."""

    branches: tuple[Branch, ...]
    else_body: Block | None = None


@dataclass(frozen=True, slots=True)
class While(Statement):
    """`while condition:`."""

    condition: Expression
    body: Block


@dataclass(frozen=True, slots=True)
class Return(Statement):
    """`return value`; `value` is None for a bare `return`."""

    value: Expression | None = None


@dataclass(frozen=True, slots=True)
class Join(Statement):
    """`join handle`: wait for a thread."""

    thread: Expression


@dataclass(frozen=True, slots=True)
class Kill(Statement):
    """`kill handle`: stop a thread and its children."""

    thread: Expression


@dataclass(frozen=True, slots=True)
class KeywordStatement(Statement):
    """A statement that is one keyword."""

    keyword: Literal["break", "continue", "halt", "enter_critical", "exit_critical"]


@dataclass(frozen=True, slots=True)
class Label(Statement):
    """`$ 12 "Move"`: a node of PolyScope's program tree; `text` is the line after the `$`."""

    text: str


@dataclass(frozen=True, slots=True)
class Parameter(Node):
    """A parameter of a function; `default` is None when the caller must give it."""

    name: str
    default: Expression | None = None


@dataclass(frozen=True, slots=True)
class Function(Statement):
    """`def`, `sec` or `thread` with its body; `end_span` is the closing `end`."""

    kind: Literal["def", "sec", "thread"]
    name: str
    parameters: tuple[Parameter, ...]
    body: Block
    end_span: Span = field(default=NOWHERE, compare=False, repr=False)


# --- walks: parts of an expression, expressions of a statement, nested statements -----------------------


def child_expressions(expression: Expression) -> tuple[Expression, ...]:
    """The direct parts of an expression, in the order they are evaluated."""
    match expression:
        case BinaryOperation(left=left, right=right):
            return left, right
        case Call(arguments=arguments):
            return tuple(argument.value for argument in arguments)
        case UnaryOperation(operand=operand):
            return (operand,)
        case Subscript(target=target, indices=indices):
            return target, *indices
        case ListLiteral(items=items) | PoseLiteral(items=items):
            return items
        case MethodCall(target=target, arguments=arguments):
            return target, *(argument.value for argument in arguments)
        case Attribute(target=target):
            return (target,)
    return ()


def root_of(target: Expression) -> Expression:
    """What elements and members are taken of in the end: `x` of `x[i].member`."""
    while isinstance(target, (Subscript, Attribute)):
        target = target.target
    return target


def own_expressions(statement: Statement) -> tuple[Expression, ...]:
    """The expressions a statement evaluates itself, not those of the blocks in it.

    An assignment to `x[i]` lists `x[i]` after the value, one to a plain name lists the value only.
    """
    match statement:
        case Assign(target=Name(), value=value):
            return (value,)
        case Assign(target=target, value=value):
            return value, target
        case ExpressionStatement(value=value):
            return (value,)
        case If(branches=branches):
            return tuple(branch.condition for branch in branches)
        case While(condition=condition):
            return (condition,)
        case Return(value=result) if result is not None:
            return (result,)
        case Join(thread=thread) | Kill(thread=thread):
            return (thread,)
    return ()


def own_blocks(statement: Statement) -> tuple[Block, ...]:
    """The blocks inside an `if` or `while`; the body of a function belongs to its own scope."""
    match statement:
        case If(branches=branches, else_body=else_body):
            return (*(branch.body for branch in branches), else_body or ())
        case While(body=body):
            return (body,)
    return ()


def all_statements(block: Block) -> Iterator[Statement]:
    """Every statement of a block and of the blocks in it, in the order of the text."""
    for statement in block:
        yield statement
        for inner in own_blocks(statement):
            yield from all_statements(inner)


def all_expressions(expression: Expression) -> Iterator[Expression]:
    """An expression and every part of it, in the order of the text."""
    todo = [expression]
    while todo:
        part = todo.pop()
        yield part
        todo += reversed(child_expressions(part))


def same_tree(first: Block, second: Block) -> bool:
    """Whether two trees are equal, as by `==`, for trees of any depth."""
    todo: list[tuple[Any, Any]] = [(first, second)]
    while todo:
        one, other = todo.pop()
        if type(one) is not type(other):
            return False
        if isinstance(one, Node):
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
    return tuple(item.name for item in fields(globals()[kind]) if item.compare)


def falls_through(block: Block) -> bool:
    """Whether control can reach the end of the block: not every branch of its last statement returns."""
    if not block:
        return True
    match block[-1]:
        case Return():
            return False
        case KeywordStatement(keyword="halt"):
            return False
        case If(branches=branches, else_body=else_body) if else_body is not None:
            return falls_through(else_body) or any(falls_through(branch.body) for branch in branches)
    return True
