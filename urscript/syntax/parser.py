"""Text -> tree. The grammar is `grammar.lark`, `_MADE` has the node of each rule; and the errors.

`parse` knows the form of a program only: names, types and scopes are for `resolver`.
The parser is built on first use, once a process (about 0.07 s), then parses 1,000 lines in some 0.05 s.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Final, cast

from urscript.dialect import LONGEST_LABEL, LONGEST_NAME, LONGEST_STRING
from urscript.errors import ScriptLexerError, ScriptSyntaxError
from urscript.source import BLANKS, Source, Span
from urscript.syntax import nodes

if TYPE_CHECKING:
    from lark import Lark, Token
    from lark.exceptions import UnexpectedCharacters, UnexpectedToken


# --- nodes. What the grammar leaves open is decided here: what is a pose, what can be called or assigned to.


_text: Final[Callable[[Any], Any]] = str


def _span(item: Any) -> Span:
    """The span of a node, or of a token, which has four attributes instead."""
    span: Span | None = getattr(item, "span", None)
    return span or Span(item.line, item.column, item.end_line, item.end_column)


def _cover(items: list[Any]) -> Span:
    """The span from the first to the last of `items`."""
    first, last = _span(items[0]), _span(items[-1])
    return Span(first.line, first.column, last.end_line, last.end_column)


def _nodes(items: list[Any]) -> tuple[Any, ...]:
    """The nodes among `items`, without brackets, commas, semicolons and gaps."""
    return tuple(item for item in items if isinstance(item, nodes.Node))


def _syntax_error(message: str, span: Span) -> ScriptSyntaxError:
    return ScriptSyntaxError(message, line=span.line, column=span.column, width=span.end_column - span.column)


def _function(items: list[Any], parameters: tuple[nodes.Parameter, ...]) -> nodes.Function:
    kind, name, *_, body, end = items
    return nodes.Function(_text(kind), str(name), parameters, body, _span(end), span=_cover(items))


def _if(items: list[Any]) -> nodes.If:
    first = nodes.Branch(items[1], items[3], span=_cover(items[:3]))
    rest = (item for item in items[4:] if isinstance(item, nodes.Branch))
    return nodes.If((first, *rest), items[-2], span=_cover(items))


def _declaration(items: list[Any]) -> nodes.Statement:
    scope, name, _, value = items
    if value is None:
        return nodes.Declaration(str(name), _text(scope), span=_cover([scope, name]))
    return nodes.Assign(nodes.Name(str(name), span=_span(name)), value, _text(scope), span=_cover(items))


def _assignment(items: list[Any]) -> nodes.Assign:
    target, _, value = items
    if not isinstance(nodes.root_of(target), nodes.Name):
        message = "cannot assign to this expression, only to a variable or an element of one"
        raise _syntax_error(message, target.span)
    return nodes.Assign(target, value, span=_cover(items))


def _call(items: list[Any]) -> nodes.Expression:
    callee, _, arguments, _ = items
    if isinstance(callee, nodes.Name):
        return nodes.Call(callee.name, arguments, span=_cover(items))
    if isinstance(callee, nodes.Attribute):
        return nodes.MethodCall(callee.target, callee.name, arguments, span=_cover(items))
    raise _syntax_error("cannot call this expression, only a function by its name", callee.span)


def _index(items: list[Any]) -> nodes.Expression:
    target, indices = items[0], _nodes(items[1:])
    # `p` is an ordinary name: only six items make it a pose. Source: maker's driver script.
    if len(indices) == 6 and isinstance(target, nodes.Name) and target.name == "p":
        return nodes.PoseLiteral(indices, span=_cover(items))
    if len(indices) > 2:
        message = f"an index has 1 or 2 values, a pose p[...] 6, not {len(indices)}"
        raise _syntax_error(message, _cover(items))
    return nodes.Subscript(target, indices, span=_cover(items))


def _arguments(items: list[Any]) -> tuple[nodes.Argument, ...]:
    return tuple(
        item if isinstance(item, nodes.Argument) else nodes.Argument(item, span=item.span)
        for item in _nodes(items)
    )


def _integer(items: list[Any]) -> nodes.IntLiteral:
    if len(items[0]) > 10 or int(items[0]) > 2**31:
        raise _syntax_error("this integer does not fit into 32 bits; write a float", _span(items[0]))
    return nodes.IntLiteral(int(items[0]), span=_span(items[0]))


_MADE: Final[dict[str, Callable[[list[Any]], Any]]] = {
    "start": lambda items: items[0],
    "block": _nodes,
    "function": lambda items: _function(items, items[3]),
    "thread": lambda items: _function(items, ()),
    "params": _nodes,
    "param": lambda items: nodes.Parameter(str(items[0]), items[2], span=_span(items[0])),
    "if_": _if,
    "elif_": lambda items: nodes.Branch(items[1], items[3], span=_cover(items[:3])),
    "while_": lambda items: nodes.While(items[1], items[3], span=_cover(items)),
    "simple": lambda items: nodes.KeywordStatement(_text(items[0]), span=_span(items[0])),
    "return_": lambda items: nodes.Return(items[1], span=_cover(items if items[1] else items[:1])),
    "join": lambda items: nodes.Join(items[1], span=_cover(items)),
    "kill": lambda items: nodes.Kill(items[1], span=_cover(items)),
    "declare": _declaration,
    "assign": _assignment,
    "call_for_effect": lambda items: nodes.ExpressionStatement(items[0], span=items[0].span),
    "label": lambda items: nodes.Label(str(items[0])[1:].strip(BLANKS), span=_span(items[0])),
    "binary": lambda items: nodes.BinaryOperation(str(items[1]), items[0], items[2], span=_cover(items)),
    "prefix": lambda items: nodes.UnaryOperation(
        "not" if items[0] == "!" else _text(items[0]), items[1], span=_cover(items)
    ),
    "call": _call,
    "index": _index,
    "member": lambda items: nodes.Attribute(items[0], str(items[2]), span=_cover(items)),
    "args": _arguments,
    "named_argument": lambda items: nodes.Argument(items[2], str(items[0]), span=_cover(items)),
    "integer": _integer,
    "float_": lambda items: nodes.FloatLiteral(float(items[0]), str(items[0]), span=_span(items[0])),
    "string": lambda items: nodes.StringLiteral(str(items[0])[1:-1], span=_span(items[0])),
    "true": lambda items: nodes.BoolLiteral(True, span=_span(items[0])),
    "false": lambda items: nodes.BoolLiteral(False, span=_span(items[0])),
    "none": lambda items: nodes.NoneLiteral(span=_span(items[0])),
    "name": lambda items: nodes.Name(str(items[0]), span=_span(items[0])),
    "group": lambda items: items[1],
    "list_": lambda items: nodes.ListLiteral(_nodes(items), span=_cover(items)),
    "run": lambda items: nodes.RunThread(str(items[1]), span=_cover(items)),
}
"""Rule of the grammar -> what is made of its tokens and finished nodes, which are in order."""


def parse(source: Source) -> nodes.Block:
    """The statements and definitions of `source`, in order.

    Raises:
        ScriptSyntaxError: The text does not follow the grammar; the place is the first token that
            cannot follow the text before it (a missing bracket is detected at the next statement).
        ScriptLexerError: A character or number that starts no token, a name, string or label too long.
    """
    from lark.exceptions import UnexpectedCharacters, UnexpectedToken

    try:
        _check_lengths(source)
        return cast(nodes.Block, _lark().parse(source.text))
    except UnexpectedToken as error:
        raise _unexpected_token(error, source) from None
    except UnexpectedCharacters as error:
        raise _unexpected_character(error, source) from None
    except ScriptSyntaxError as error:
        error.source = source
        raise


_LONGEST: Final = {
    "NAME": (LONGEST_NAME, 0, "a name"),
    "STRING": (LONGEST_STRING, 2, "a string"),
    "LABEL": (LONGEST_LABEL, 1, "a label"),
}
"""Terminal -> most characters, without so many of its signs."""

_MAY_BE_TOO_LONG: Final = re.compile(
    rf'\w{{{LONGEST_NAME + 1}}}|"[^"\n]{{{LONGEST_STRING + 1}}}|\$[^\n]{{{LONGEST_LABEL + 1}}}', re.ASCII
)


def _check_lengths(source: Source) -> None:
    """Look at the tokens one by one, if there may be one that is too long."""
    if _MAY_BE_TOO_LONG.search(source.text) is None:
        return
    for token in _lark().lex(source.text):
        most, signs, what = _LONGEST.get(token.type, (len(token), 0, ""))
        if len(token) - signs > most:
            text = f"{what} of {len(token) - signs} characters; allowed: up to {most}"
            raise ScriptLexerError(text, line=token.line or 1, column=token.column or 1, width=len(token))


_MOST_ERRORS = 20


def find_syntax_errors(source: Source) -> list[ScriptSyntaxError]:
    """The first syntax errors of `source`: after each the parser continues with the next statement."""
    from lark.exceptions import UnexpectedCharacters, UnexpectedInput, UnexpectedToken

    errors: list[ScriptSyntaxError] = []
    lost_openers = 0

    def note(error: ScriptSyntaxError) -> None:
        # Further errors on a line are mostly consequences of the first.
        if all(error.line != earlier.line for earlier in errors):
            errors.append(error)

    def recover(error: UnexpectedInput) -> bool:
        nonlocal lost_openers
        if isinstance(error, UnexpectedCharacters):
            note(_unexpected_character(error, source))
        elif isinstance(error, UnexpectedToken):
            if error.token.type == "END" and lost_openers:
                lost_openers -= 1
                return True
            note(_unexpected_token(error, source))
            if error.token.type == "$END":
                return False
            lost_openers += _drop_statement(error)
        return len(errors) < _MOST_ERRORS

    try:
        _lark().parse(source.text, on_error=recover)
    except UnexpectedInput:
        pass
    except ScriptSyntaxError as error:
        error.source = source
        note(error)
    return errors


def _drop_statement(error: UnexpectedToken) -> int:
    """Remove the incomplete statement from the stack; keep a token that can start or end a statement.

    Returns:
        Number of block openers that were removed: as many `end`s will be superfluous.
    """
    parser: Any = error.interactive_parser
    state = parser.parser_state
    lost = 0
    while state.value_stack and not _is_between_statements(parser.accepts()):
        state.state_stack.pop()
        lost += getattr(state.value_stack.pop(), "type", "") in _BLOCK_OPENERS
    if error.token.type in parser.accepts():
        parser.feed_token(error.token)
    return lost


def _is_between_statements(accepted: set[str]) -> bool:
    """Whether a statement can start and its block can end: after a block only `end` or `else` can follow."""
    return "NAME" in accepted and not accepted.isdisjoint({"END", "$END"})


def prepare() -> None:
    """Build the parser now, so that the first program need not wait for it."""
    _lark()


@cache
def _lark() -> Lark:
    return make_parser(SimpleNamespace(**_MADE))


def make_parser(transformer: Any) -> Lark:
    """A parser of the language; without a transformer its tree has every bracket and comma."""
    from importlib.resources import files

    from lark import Lark

    grammar = files("urscript.syntax").joinpath("grammar.lark").read_text(encoding="utf-8")
    # The basic lexer, not the contextual one: a reserved word is reserved everywhere.
    return Lark(grammar, parser="lalr", lexer="basic", keep_all_tokens=True, transformer=transformer)


# --- errors --------------------------------------------------------------------------------------------

_SPELLING = {
    "LPAR": "'('",
    "RPAR": "')'",
    "LSQB": "'['",
    "RSQB": "']'",
    "COLON": "':'",
    "COMMA": "','",
    "EQUAL": "'='",
    "DOT": "'.'",
    "NAME": "a name",
    "END": "'end'",
}
"""Display names of the tokens that a message lists as expected; others are not listed."""

_BLOCK_OPENERS = frozenset({"DEF", "SEC", "THREAD", "IF", "WHILE"})


def _unexpected_token(error: UnexpectedToken, source: Source) -> ScriptSyntaxError:
    token, accepted = error.token, error.accepts or error.expected
    if token.type == "$END":
        found = _unexpected_end(source)
    else:
        wanted = {_SPELLING[name] for name in accepted if name in _SPELLING}
        if "RUN" in accepted:
            wanted -= {"'('", "'['", "a name"}
            wanted.add("a value")
        message = f"unexpected '{token}'"
        # Where a new statement could start, the list of what may follow is too long to help.
        if wanted and "WHILE" not in accepted:
            message += f", expected {' or '.join(sorted(wanted))}"
        found = ScriptSyntaxError(
            message, line=token.line or 1, column=token.column or 1, width=len(token), source=source
        )
    found.unexpected, found.accepted = token.type, frozenset(accepted)
    return found


def _unexpected_end(source: Source) -> ScriptSyntaxError:
    """The error for a text that ends inside a statement; names the innermost open block."""
    open_blocks: list[Token] = []
    last: Token | None = None
    for last in _lark().lex(source.text):
        if last.type in _BLOCK_OPENERS:
            open_blocks.append(last)
        elif last.type == "END" and open_blocks:
            open_blocks.pop()
    line, column = (last.end_line or 1, last.end_column or 1) if last else (1, 1)
    message = "unexpected end of the program"
    if open_blocks:
        opener = open_blocks[-1]
        message += f", '{opener}' of line {opener.line} has no 'end'"
    return ScriptSyntaxError(message, line=line, column=column, source=source)


def _unexpected_character(error: UnexpectedCharacters, source: Source) -> ScriptLexerError:
    char = source.text[error.pos_in_stream or 0]
    if char == '"':
        message = "unterminated string: no closing '\"' on its line"
    elif char.isdigit() or char == ".":
        message = "malformed number"
    else:
        message = f"unexpected character {char!r}"
    return ScriptLexerError(message, line=error.line, column=error.column, source=source)
