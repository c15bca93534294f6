"""Text -> tree. The grammar is `grammar.lark`, `tree_builder` makes the nodes, this module the errors.

`parse` knows the form of a program only: names, types and scopes are for `resolver`.
The parser is built on first use, once a process (about 0.07 s), then parses 1,000 lines in some 0.05 s.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any, cast

from urscript.errors import ScriptLexerError, ScriptSyntaxError
from urscript.source import Source
from urscript.syntax import nodes
from urscript.syntax.tree_builder import TreeBuilder

if TYPE_CHECKING:
    from lark import Lark, Token
    from lark.exceptions import UnexpectedCharacters, UnexpectedToken


def parse(source: Source) -> nodes.Block:
    """The statements and definitions of `source`, in order.

    Raises:
        ScriptSyntaxError: The text does not follow the grammar; the place is the first token that
            cannot follow the text before it (a missing bracket is detected at the next statement).
        ScriptLexerError: A character or number that starts no token.
    """
    from lark.exceptions import UnexpectedCharacters, UnexpectedToken

    try:
        return cast(nodes.Block, _lark().parse(source.text))
    except UnexpectedToken as error:
        raise _unexpected_token(error, source) from None
    except UnexpectedCharacters as error:
        raise _unexpected_character(error, source) from None
    except ScriptSyntaxError as error:
        error.source = source
        raise


def find_syntax_errors(source: Source, limit: int = 20) -> list[ScriptSyntaxError]:
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
        return len(errors) < limit

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
    from importlib.resources import files

    from lark import Lark

    grammar = files("urscript.syntax").joinpath("grammar.lark").read_text(encoding="utf-8")
    # The basic lexer, not the contextual one: a reserved word is reserved everywhere.
    return Lark(grammar, parser="lalr", lexer="basic", keep_all_tokens=True, transformer=TreeBuilder())


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
