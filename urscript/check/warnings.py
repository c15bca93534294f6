"""The warnings of `urscript check`: the table of rules, and the exception.

A code never changes its meaning and is never reused.
"""

from typing import Final, NamedTuple

from urscript.errors import ScriptError
from urscript.source import Span


class Rule(NamedTuple):
    """One kind of warning: its code, for `--ignore`, and what is wrong.

    Why it is probably a mistake stands in the table of docs/urscript-tool.md.
    """

    code: str
    meaning: str


UNUSED_GLOBAL: Final = Rule("W101", "a global variable is never read")
UNUSED_LOCAL: Final = Rule("W102", "a local variable is never read")
UNUSED_PARAMETER: Final = Rule("W103", "a parameter is never read")
UNUSED_FUNCTION: Final = Rule("W104", "a function is never called")
UNUSED_THREAD: Final = Rule("W105", "a thread is never run")
BUSY_LOOP: Final = Rule("W106", "a loop takes no time and cannot end by itself")
UNCHECKED_READ: Final = Rule("W107", "the count of a socket read is never checked")
UNREACHABLE: Final = Rule("W108", "code is never reached")
HIDES_BUILTIN: Final = Rule("W109", "a name hides a builtin")
DEAD_BRANCH: Final = Rule("W110", "an elif or else is never reached")
DEFINED_TWICE: Final = Rule("W111", "a function is defined twice")
RUN_OF_DEF: Final = Rule("W112", "a function is run as a thread")
CALL_OF_PROGRAM: Final = Rule("W113", "the program is called below its definition")
UNUSED_VALUE: Final = Rule("W114", "a value is computed and not used")
CALL_WITHOUT_HANDLE: Final = Rule("W115", "a method is called where nothing has methods")
REFUSED_ARGUMENT: Final = Rule("W116", "a builtin gets an argument that it refuses")
DEGREES: Final = Rule("W117", "an angle is too large for radians")
MILLIMETRES: Final = Rule("W118", "a length is too large for metres")
WRONG_COUNT: Final = Rule("W119", "a function of the program gets too many or too few arguments")
SHORT_TIME: Final = Rule("W120", "a streamed motion command shall take less than a control cycle")
NOTHING_RUNS: Final = Rule("W121", "a text has only definitions, so that nothing runs")
IN_NO_MANUAL: Final = Rule(
    "W122", "a form that is in no manual: a ';', a bool for a number, a number for a bool"
)

RULES: Final = tuple(value for value in tuple(globals().values()) if isinstance(value, Rule))

ABOUT_VALUES: Final = frozenset({REFUSED_ARGUMENT, DEGREES, MILLIMETRES, SHORT_TIME, IN_NO_MANUAL})
"""Those that are shown beside errors too: they do not follow from them."""


class ScriptWarning(ScriptError):
    """Allowed but probably a mistake: the row of the table, and the span of the text that it concerns."""

    kind = "Warning"

    def __init__(self, rule: Rule, message: str, span: Span, hint: str | None = None) -> None:
        width = span.end_column - span.column if span.line == span.end_line else 1
        super().__init__(message, line=span.line, column=span.column, width=width, hint=hint)
        self.rule = rule
        self.span = span

    def headline(self) -> str:
        """One line, with the code at its end."""
        return f"{super().headline()} [{self.rule.code}]"
