"""Text -> tree. The grammar is `grammar.lark`, `_TreeBuilder` makes the nodes; and the errors.

`parse` knows the form of a program only: names, types and scopes are for `resolver`.
The parser is built on first use, once a process (about 0.07 s), then parses 1,000 lines in some 0.05 s.
"""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING, Any, Final, cast

from urscript.dialect import LONGEST_LABEL, LONGEST_NAME, LONGEST_STRING
from urscript.errors import ScriptLexerError, ScriptSyntaxError
from urscript.source import BLANKS, Source, Span
from urscript.syntax import nodes

if TYPE_CHECKING:
    from lark import Lark, Token
    from lark.exceptions import UnexpectedCharacters, UnexpectedToken


# --- nodes. What the grammar leaves open is decided here: what is a pose, what can be called or assigned to.


def _span(item: Any) -> Span:
    """The span of a node or token; lark's own tokens, in texts with errors, have four attributes instead."""
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


class _TreeBuilder:
    """One method per rule of the grammar; each gets the rule's tokens and finished nodes in order."""

    def start(self, items: list[Any]) -> nodes.Block:
        return cast(nodes.Block, items[0])

    def block(self, items: list[Any]) -> nodes.Block:
        return _nodes(items)

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
        return _nodes(items)

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
        target, indices = items[0], _nodes(items[1:])
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
        return nodes.ListLiteral(_nodes(items), span=_cover(items))

    def run(self, items: list[Any]) -> nodes.RunThread:
        return nodes.RunThread(str(items[1]), span=_cover(items))


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
    return make_parser(_TreeBuilder())


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
    accepted = error.accepts or error.expected
    found = (
        _unexpected_end(source) if error.token.type == "$END" else _unexpected(error.token, accepted, source)
    )
    found.unexpected, found.accepted = error.token.type, frozenset(accepted)
    return found


def _unexpected(token: Token, accepted: set[str], source: Source) -> ScriptSyntaxError:
    wanted = {_SPELLING[name] for name in accepted if name in _SPELLING}
    if "RUN" in accepted:
        wanted -= {"'('", "'['", "a name"}
        wanted.add("a value")
    message = f"unexpected '{token}'"
    # Where a new statement could start, the list of what may follow is too long to help.
    if wanted and "WHILE" not in accepted:
        message += f", expected {' or '.join(sorted(wanted))}"
    return ScriptSyntaxError(
        message, line=token.line or 1, column=token.column or 1, width=len(token), source=source
    )


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
