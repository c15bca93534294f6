"""Hypothesis strategies of syntax trees: every node, in every place where the grammar can put it; words."""

from hypothesis import strategies as st
from tree_printer import print_expression

from urscript.syntax import nodes

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


def _arguments(values):
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
        st.builds(nodes.Call, st.sampled_from(FUNCTIONS), _arguments(values)),
        st.builds(nodes.MethodCall, values, variables, _arguments(values)),
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
