"""All errors of the language, one tree.

    ScriptError                      anything wrong with a program, with its place in the text
    ├── ScriptCompileError           found before the program runs
    │   ├── ScriptSyntaxError        the text does not follow the grammar
    │   │   └── ScriptLexerError     a character or number that no token starts with
    │   ├── ScriptNameError          a name that is neither defined nor built in
    │   ├── ScriptTypeError          wrong number or names of arguments
    │   └── ScriptContextError       a statement in the wrong context (`break` outside a loop)
    └── ScriptRuntimeError           raised by an operation or a builtin while the program runs
        └── ScriptBudgetError        a thread computed too long in one cycle

Code that raises `ScriptRuntimeError` gives the message only: the runtime adds the place of the call.
`wire_text` is what a controller puts into a runtime-exception message, `log_text` what its log shows,
`render()` is for terminals. This module must not import the rest of the language.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Final, NamedTuple, Self

if TYPE_CHECKING:
    from urscript.source import Source


_LONGEST_LINE: Final = 1_000
"""Characters of a line that a message shows."""


class StackEntry(NamedTuple):
    """One entry of the call stack of a run-time error: the function and the place in it."""

    function: str
    line: int
    column: int


class ScriptError(Exception):
    """Something wrong with a program.

    Attributes:
        message: One line: what was given, what is allowed, what to do.
        line: From 1; 0 while the place is not known.
        column: From 1; 0 while the place is not known.
        width: Number of characters the caret line underlines.
        source: The text the place refers to.
        hint: A suggestion such as a similar name.
    """

    kind: ClassVar[str] = "Error"

    def __init__(
        self,
        message: str,
        *,
        line: int = 0,
        column: int = 0,
        width: int = 1,
        source: Source | None = None,
        hint: str | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.line = line
        self.column = column
        self.width = width
        self.source = source
        self.hint = hint

    def locate(self, source: Source | None, line: int, column: int, width: int = 1) -> Self:
        """Add the place, unless one is known already; returns itself."""
        if not self.line:
            self.source, self.line, self.column, self.width = source, line, column, width
        return self

    @property
    def wire_text(self) -> str:
        """The text of the runtime-exception message on the primary interface."""
        return self.log_text

    @property
    def log_text(self) -> str:
        """The line in the controller's log and popup."""
        return f"{self.kind}: {self.message}"

    def headline(self) -> str:
        """One line: file, line, column, kind, message, hint."""
        where = self.source.name if self.source else "<program>"
        place = f"{where}:{self.line}:{self.column}: " if self.line else ""
        hint = f" ({self.hint})" if self.hint else ""
        return f"{place}{self.kind}: {self.message}{hint}"

    def render(self) -> str:
        """The headline, the source line and a caret line."""
        if self.source is None or not self.line:
            return self.headline()
        return f"{self.headline()}\n{self.source.caret(self.line, self.column, self.width)}"

    def __str__(self) -> str:
        return self.headline()


class ScriptCompileError(ScriptError):
    """Found before the program runs."""

    kind = "Compile error"


class ScriptSyntaxError(ScriptCompileError):
    """The text does not follow the grammar; the place is where the parser detected it.

    Attributes:
        unexpected: Terminal of the grammar that was found; empty if none was.
    """

    kind = "Syntax error"
    unexpected: str = ""
    accepted: frozenset[str] = frozenset()

    @property
    def wire_text(self) -> str:
        """`syntax_error_on_line:<n>:<that line, spaces included>:`. Source: captures of e-Series 5.x.

        A long line is cut (U): clients hold packages of 2000 bytes.
        """
        text = self.source.line(self.line)[:_LONGEST_LINE] if self.source else ""
        return f"syntax_error_on_line:{self.line}:{text}:"


class ScriptLexerError(ScriptSyntaxError):
    """A character, number or string that no token of the language starts with."""

    kind = "Lexer exception"


class ScriptNameError(ScriptCompileError):
    """A name that is neither defined in the program nor built in."""

    def __init__(self, name: str, *, line: int = 0, column: int = 0, hint: str | None = None) -> None:
        super().__init__(
            f"name '{name}' is not defined", line=line, column=column, width=len(name), hint=hint
        )
        self.name = name

    @property
    def wire_text(self) -> str:
        """`compile_error_name_not_found:<name>:`. Source: primary interface captures."""
        return f"compile_error_name_not_found:{self.name}:"


class ScriptTypeError(ScriptCompileError):
    """Arguments that do not fit the signature, seen before the program runs."""

    kind = "Type error"


class ScriptContextError(ScriptCompileError):
    """A statement or name in the wrong context."""

    kind = "Contextual error"


class ScriptRuntimeError(ScriptError):
    """Raised by an operation or a builtin while the program runs.

    Attributes:
        stack: The call stack, outermost call first; the last entry is the place of the error.
    """

    kind = "Runtime error"
    stack: tuple[StackEntry, ...] = ()

    @property
    def log_text(self) -> str:
        """`Runtime error (<line>:<column>): <text>`. Source: controller log, 5.12."""
        place = f" ({self.line}:{self.column})" if self.line else ""
        return f"{self.kind}{place}: {self.message}"

    @property
    def wire_text(self) -> str:
        """The bare text: the message carries line and column in fields of its own."""
        return self.message


class ScriptBudgetError(ScriptRuntimeError):
    """A thread computed too long in one control cycle. Source: CB3 3.4 log text."""

    def __init__(self) -> None:
        super().__init__(
            "The program used too much time without instructing the robot what to do. "
            "Consider using a Wait or sync() to split long program sequences that do not move the robot."
        )
