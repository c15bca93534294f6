"""All errors of a program for people: each with the place where one would look, and what to write.

The parser says where it noticed an error, which is what a controller reports. Here rules look at the text
around that place, say what was meant, and repair a copy of the text so that the next error can be found.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final

from urscript.advice import blocks, brackets, characters, statements
from urscript.advice.names import tells_of_line, with_hint
from urscript.advice.problem import Advice, Problem, Rule
from urscript.advice.rough_tokens import RoughText
from urscript.catalogue import CB3_3_15, Catalogue
from urscript.errors import ScriptCompileError, ScriptNameError, ScriptSyntaxError
from urscript.lint.rules import ScriptWarning
from urscript.program import check_program
from urscript.source import Source, as_bytes
from urscript.syntax.parser import find_syntax_errors, parse
from urscript.values import to_script_text

RULES: Final[tuple[Rule, ...]] = (
    characters.quotes,
    characters.comment,
    statements.foreign_statement,
    characters.number,
    characters.open_string,
    characters.sign,
    characters.pose_parts,
    statements.walrus,
    statements.anonymous_function,
    blocks.else_if,
    statements.in_place,
    statements.doubled_operator,
    statements.function_head,
    statements.reserved_word,
    brackets.decimal_comma,
    brackets.trailing_comma,
    brackets.inside_brackets,
    statements.value_with_if,
    brackets.closes_nothing,
    brackets.never_closed,
    statements.comparison_chain,
    statements.word_operator,
    statements.assignment_as_value,
    brackets.tuples,
    brackets.missing_comma,
    blocks.foreign_end,
    blocks.missing_colon,
    statements.missing_value,
    blocks.extra_end,
    blocks.missing_end,
)
"""In the order they are asked; the first that knows what was meant counts."""

MAX_ERRORS: Final = 20
_MAX_REPAIRS: Final = 60
_MAX_READ: Final = 2_000_000
"""Characters to parse in all: every repair costs one more pass over the text."""


def check_for_people(
    text: str, *, catalogue: Catalogue = CB3_3_15, name: str = "<program>"
) -> tuple[Sequence[ScriptCompileError], Sequence[ScriptWarning]]:
    """As `program.check_program`, in words for the author of the program.

    Names are looked up beside syntax errors too, as far as the text could be repaired.
    """
    source = Source(as_bytes(text), name)
    mending = _mend(source)
    if mending.text is not None:
        errors, warnings = check_program(mending.text, catalogue=catalogue, name=name)
        if not mending.found:
            return [with_hint(error) for error in _one_for_each(errors)], warnings
        mending.add_names(errors)
    return mending.found, ()


def _one_for_each(errors: Sequence[ScriptCompileError]) -> Iterator[ScriptCompileError]:
    """The errors without those on lines that another one has told all of."""
    told = 0
    for error in errors:
        if error.line != told:
            yield error
            told = error.line if tells_of_line(error) else 0


@dataclass(slots=True)
class _Mending:
    """What was found while a text was repaired.

    Attributes:
        source: The text as it was written.
        text: What it has become; None if something could not be repaired.
        found: The errors, by line, one a line at most.
        doubtful: Names that may be unknown only because what makes them was left out.
    """

    source: Source
    text: str | None
    found: list[ScriptCompileError] = field(default_factory=list)
    doubtful: set[str] = field(default_factory=set)

    def add(self, errors: Sequence[ScriptCompileError]) -> None:
        """Keep one error a line: more are most often echoes of the first."""
        n_lines = self.source.text.count("\n") + 1
        for error in errors:
            if error.line > n_lines:
                continue  # in an `end` that was put behind the text
            if len(self.found) < MAX_ERRORS and all(error.line != other.line for other in self.found):
                # Repairs leave the lines where they are.
                error.source = self.source
                self.found.append(error)
        self.found.sort(key=lambda error: (error.line, error.column))

    def add_names(self, errors: Sequence[ScriptCompileError]) -> None:
        """Keep what is unknown for another reason than a repair."""
        for error in errors:
            if not isinstance(error, ScriptNameError) or error.name not in self.doubtful:
                error.source = self.source
                self.add([with_hint(error)])

    def repair(self, text: str, advice: Advice, line: int) -> str:
        """The text with the edits of an advice about `line`."""
        if not advice.sure:
            self.doubtful.update(re.findall(r"[A-Za-z_]\w*", self.source.line(line)))
        for edit in sorted(advice.edits, reverse=True):
            text = text[: edit.start] + edit.new + text[edit.end :]
        return text


def _mend(source: Source) -> _Mending:
    """Find the syntax errors one after the other, each in the text without those before."""
    text = source.text
    mending = _Mending(source, None)
    for _ in range(min(_MAX_REPAIRS, 1 + _MAX_READ // (1 + len(text)))):
        error = first_syntax_error(Source(text, source.name))
        if error is None:
            mending.text = text
            return mending
        advice = advise(text, error)
        if advice is None:
            mending.add([error])
            break
        told = _told(advice, error, text, source)
        mending.add([told])
        if not advice.edits or len(mending.found) >= MAX_ERRORS:
            break
        text = mending.repair(text, advice, told.line)
    mending.add(find_syntax_errors(Source(text, source.name)))
    return mending


def first_syntax_error(source: Source) -> ScriptSyntaxError | None:
    """What the parser says of a text; None if it is right."""
    try:
        parse(source)
    except ScriptSyntaxError as error:
        return error
    except RecursionError:
        return None
    return None


def advise(text: str, error: ScriptSyntaxError) -> Advice | None:
    """What the first rule says that knows the error; None if no rule does."""
    rough = RoughText(text)
    offset = rough.offset(error.line, error.column)
    index = rough.piece_at(offset)
    if error.unexpected == "$END":
        index = len(rough.pieces) - 1
    problem = Problem(rough, error, index)
    return next((advice for rule in RULES if (advice := rule(problem)) is not None), None)


def explained(error: ScriptCompileError) -> ScriptCompileError:
    """One error as `check_for_people` words it."""
    source = error.source
    if source is None:
        return error
    if isinstance(error, ScriptSyntaxError):
        advice = advise(source.text, error)
        return error if advice is None else _told(advice, error, source.text, source)
    return with_hint(error)


def _told(advice: Advice, error: ScriptSyntaxError, text: str, source: Source) -> ScriptSyntaxError:
    rough = RoughText(text)
    line, column = rough.place(advice.start)
    return type(error)(
        to_script_text(advice.message),
        line=line,
        column=column,
        width=max(1, advice.end - advice.start),
        source=source,
        hint=advice.hint and to_script_text(advice.hint),
    )
