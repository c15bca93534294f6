"""All errors of a program with explanations: each at its cause, with what to write instead.

The parser says where it detected an error, which is what a controller reports. The rules look at the text
around that place, explain the error, and repair a copy of the text so that the parser can find the next one.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final

from urscript.catalogue import CB3_3_15, Catalogue
from urscript.check.arguments import argument_warnings
from urscript.check.flow import flow_warnings
from urscript.check.syntax_rules import RULES
from urscript.check.tokens import Advice, Problem, TokenizedText
from urscript.check.unused import name_warnings, value_warnings
from urscript.check.warnings import ABOUT_VALUES, ScriptWarning
from urscript.check.words import concerns_whole_line, with_hint
from urscript.dialect import Dialect, dialect_for
from urscript.errors import ScriptCompileError, ScriptNameError, ScriptSyntaxError
from urscript.names.scopes import ResolvedProgram
from urscript.program import compiled_program, resolve_source
from urscript.source import Source, as_bytes
from urscript.syntax.parser import find_syntax_errors, parse
from urscript.values import to_script_text

MAX_ERRORS: Final = 20
_MAX_REPAIRS: Final = 60
_MAX_PARSED: Final = 2_000_000
"""Most characters to parse in total: each repair costs one more pass over the text."""


def check_program(
    text: str, *, catalogue: Catalogue = CB3_3_15, dialect: Dialect | None = None, name: str = "<program>"
) -> tuple[Sequence[ScriptCompileError], Sequence[ScriptWarning]]:
    """All errors of a text, and all warnings, both in order; beside errors only those about constant values.

    Names are looked up once the syntax is right.
    """
    source = Source(as_bytes(text), name)
    dialect = dialect or dialect_for(catalogue.version)
    program, errors = resolve_source(source, catalogue, dialect)
    if program is None:
        return find_syntax_errors(source) or errors, ()
    if not errors:
        try:
            compiled_program(program, catalogue, dialect)
        except ScriptCompileError as error:
            errors = [error]
    try:
        return tuple(errors), _find_warnings(program, catalogue, beside_errors=bool(errors))
    except RecursionError:
        # Nearly too deep for the compiler; then there are no warnings.
        return tuple(errors), ()


def _find_warnings(
    program: ResolvedProgram, catalogue: Catalogue, *, beside_errors: bool
) -> list[ScriptWarning]:
    found = list(argument_warnings(program, catalogue))
    if beside_errors:
        found = [warning for warning in found if warning.rule in ABOUT_VALUES]
    else:
        for group in (name_warnings, flow_warnings, value_warnings):
            found += group(program, catalogue)
    for warning in found:
        warning.source = program.source
    return sorted(found, key=lambda warning: (warning.line, warning.column, warning.rule.code))


def check_with_advice(
    text: str, *, catalogue: Catalogue = CB3_3_15, name: str = "<program>"
) -> tuple[Sequence[ScriptCompileError], Sequence[ScriptWarning]]:
    """As `check_program`, with explanations.

    If a program with syntax errors could be repaired, its names and constant values are checked too.
    """
    source = Source(as_bytes(text), name)
    repair = _repair_text(source)
    warnings: Sequence[ScriptWarning] = ()
    if repair.text is not None:
        errors, warnings = check_program(repair.text, catalogue=catalogue, name=name)
        if not repair.found:
            return [with_hint(error) for error in _one_per_line(errors)], warnings
        # A repair moves what is behind it on its line.
        repaired = {error.line for error in repair.found}
        warnings = [one for one in warnings if one.rule in ABOUT_VALUES and one.line not in repaired]
        for warning in warnings:
            warning.source = source
        repair.add_names(errors)
    return repair.found, warnings


def _one_per_line(errors: Sequence[ScriptCompileError]) -> Iterator[ScriptCompileError]:
    """The errors without those on lines that an earlier error explains as a whole."""
    explained_line = 0
    for error in errors:
        if error.line != explained_line:
            yield error
            explained_line = error.line if concerns_whole_line(error) else 0


@dataclass(slots=True)
class _Repair:
    """A text under repair, and its errors.

    Attributes:
        source: The text as it was written.
        text: The repaired text; None if something could not be repaired.
        found: The errors, by line, one a line at most.
        uncertain_names: Names that may be undefined only because a repair removed their definition.
    """

    source: Source
    text: str | None
    found: list[ScriptCompileError] = field(default_factory=list)
    uncertain_names: set[str] = field(default_factory=set)

    def add(self, errors: Sequence[ScriptCompileError]) -> None:
        """Keep one error a line: others are mostly consequences of the first."""
        n_lines = self.source.text.count("\n") + 1
        for error in errors:
            if error.line > n_lines:
                continue  # in an `end` that was added after the text
            if len(self.found) < MAX_ERRORS and all(error.line != other.line for other in self.found):
                # Repairs leave the lines where they are.
                error.source = self.source
                self.found.append(error)
        self.found.sort(key=lambda error: (error.line, error.column))

    def add_names(self, errors: Sequence[ScriptCompileError]) -> None:
        """Keep the errors of names that no repair has caused."""
        for error in errors:
            if not isinstance(error, ScriptNameError) or error.name not in self.uncertain_names:
                error.source = self.source
                self.add([with_hint(error)])

    def edit(self, text: str, advice: Advice, line: int) -> str:
        """The text after the edits of an advice for `line`."""
        if not advice.exact:
            self.uncertain_names.update(re.findall(r"[A-Za-z_]\w*", self.source.line(line)))
        for edit in sorted(advice.edits, reverse=True):
            text = text[: edit.start] + edit.new + text[edit.end :]
        return text


def _repair_text(source: Source) -> _Repair:
    """Find the syntax errors one by one, each after the repair of those before."""
    text = source.text
    repair = _Repair(source, None)
    for _ in range(min(_MAX_REPAIRS, 1 + _MAX_PARSED // (1 + len(text)))):
        error = first_syntax_error(Source(text, source.name))
        if error is None:
            repair.text = text
            return repair
        advice = advise(text, error)
        if advice is None:
            repair.add([error])
            break
        explained = _error_from(advice, error, text, source)
        repair.add([explained])
        if not advice.edits or len(repair.found) >= MAX_ERRORS:
            break
        text = repair.edit(text, advice, explained.line)
    repair.add(find_syntax_errors(Source(text, source.name)))
    return repair


def first_syntax_error(source: Source) -> ScriptSyntaxError | None:
    """The first syntax error of a text, or None."""
    try:
        parse(source)
    except ScriptSyntaxError as error:
        return error
    except RecursionError:
        return None
    return None


def advise(text: str, error: ScriptSyntaxError) -> Advice | None:
    """The advice of the first rule that applies, or None."""
    tokenized = TokenizedText(text)
    offset = tokenized.offset(error.line, error.column)
    index = tokenized.token_at(offset)
    if error.unexpected == "$END":
        index = len(tokenized.tokens) - 1
    problem = Problem(tokenized, error, index)
    return next((advice for rule in RULES if (advice := rule(problem)) is not None), None)


def with_advice(error: ScriptCompileError) -> ScriptCompileError:
    """An error with its explanation, as `check_with_advice` gives it."""
    source = error.source
    if source is None:
        return error
    if isinstance(error, ScriptSyntaxError):
        # No rule is about those of the names, which the parser does not make.
        advice = advise(source.text, error) if first_syntax_error(source) else None
        return error if advice is None else _error_from(advice, error, source.text, source)
    return with_hint(error)


def _error_from(advice: Advice, error: ScriptSyntaxError, text: str, source: Source) -> ScriptSyntaxError:
    tokenized = TokenizedText(text)
    line, column = tokenized.place(advice.start)
    return type(error)(
        to_script_text(advice.message),
        line=line,
        column=column,
        width=max(1, advice.end - advice.start),
        source=source,
        hint=advice.hint and to_script_text(advice.hint),
    )
