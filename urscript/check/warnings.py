"""The warnings of `urscript check`: the table of rules, and the exception.

A code never changes its meaning and is never reused.
"""

from typing import Final, NamedTuple

from urscript.errors import ScriptError
from urscript.source import Span


class Rule(NamedTuple):
    """One kind of warning.

    Attributes:
        code: For `--ignore`.
        reason: Why this is probably a mistake.
    """

    code: str
    meaning: str
    reason: str


UNUSED_GLOBAL: Final = Rule(
    "W101",
    "a global variable is never read",
    "misspelt elsewhere, or left over; names that begin with _ are exempt",
)
UNUSED_LOCAL: Final = Rule("W102", "a local variable is never read", "as W101")
UNUSED_PARAMETER: Final = Rule("W103", "a parameter is never read", "as W101")
UNUSED_FUNCTION: Final = Rule("W104", "a function is never called", "nothing that runs calls it")
UNUSED_THREAD: Final = Rule("W105", "a thread is never run", "nothing that runs starts it")
BUSY_LOOP: Final = Rule(
    "W106",
    "a loop takes no time and cannot end by itself",
    "nothing it looks at changes within a control cycle, so the controller stops the program",
)
UNCHECKED_READ: Final = Rule(
    "W107",
    "the count of a socket read is never checked",
    "element 0 is the number of received values; after a timeout the others are invalid",
)
UNREACHABLE: Final = Rule(
    "W108", "code is never reached", "it follows return, halt, break, continue or an endless loop"
)
HIDES_BUILTIN: Final = Rule(
    "W109", "a name hides a builtin", "the builtin cannot be called in the scope of the name"
)
DEAD_BRANCH: Final = Rule(
    "W110", "an elif or else is never reached", "a condition before it is always true, or the same"
)
DEFINED_TWICE: Final = Rule(
    "W111", "a function is defined twice", "the last definition is used, also by earlier calls"
)
RUN_OF_DEF: Final = Rule(
    "W112", "a function is run as a thread", "a controller may refuse it; define it with thread"
)
CALL_OF_PROGRAM: Final = Rule(
    "W113",
    "the program is called below its definition",
    "on a port, defining it runs it; the call is a program of its own that does not know the name",
)

UNUSED_VALUE: Final = Rule(
    "W114", "a value is computed and not used", "probably a comparison in place of an assignment"
)
CALL_WITHOUT_HANDLE: Final = Rule(
    "W115",
    "a method is called where nothing has methods",
    "only handles have methods, and lists from 5.15 on; lists and strings have functions instead",
)
REFUSED_ARGUMENT: Final = Rule(
    "W116", "a builtin gets an argument that it refuses", "the call fails when it is reached"
)
DEGREES: Final = Rule(
    "W117",
    "an angle is too large for radians",
    "angles are in radians and speeds of joints in rad/s; d2r(90) converts degrees",
)
MILLIMETRES: Final = Rule(
    "W118",
    "a length is too large for metres",
    "positions are in metres and speeds of the tool in m/s; no arm reaches 3 m",
)
WRONG_COUNT: Final = Rule("W119", "a function of the program gets too many or too few arguments", "as W116")
SHORT_TIME: Final = Rule(
    "W120",
    "a streamed motion command shall take less than a control cycle",
    "it takes a whole one, 8 ms on a CB3 and 2 ms on an e-Series, so a stream of them gets slower",
)

NOTHING_RUNS: Final = Rule(
    "W121", "a text has only definitions, so that nothing runs", "several are no program; only one alone is"
)
IN_NO_MANUAL: Final = Rule(
    "W122",
    "a form that is in no manual: a ';', a bool for a number, a number for a bool",
    "controllers of drivers that have it take it; that all software does is not known",
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
