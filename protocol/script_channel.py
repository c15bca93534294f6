r"""Where one program ends and the next begins on a script port (30001, 30002, 30003).

The ports carry plain text without frames. The rules:

* Lines end in `\n`; a `\r` before it is dropped. A line is read when its `\n` has come.
* A line that begins with `def` or `sec` starts a program. It ends with the line of the `end` that closes all
  blocks: `def sec thread if while` open one, `end` closes one; comments, strings and `$` labels do not count.
  Indentation does not decide, because programs in the field break it (python-urx writes bodies in column 1).
* Outside a program, a line is a program of one statement, or one of the controller's own words
  (`CONTROLLER_WORDS`). Blank lines, comments and labels are ignored.
* In a program whose blocks never close, a `def`, a `sec` or a controller's word in column 1 ends the program:
  it is returned as it is (the compiler reports the error), and a new one begins. Nested functions are
  indented in every known program, and no statement looks like a controller's word.
* A line or program beyond the limits is dropped and reported as `Overflow`. The rest of a dropped program is
  dropped too, up to an `end` in column 1, so that its body does not run line by line.

Sources: URScript manual CB3, chapter 2; the exceptions from python-urx, ur_rtde and ur_modern_driver.
The text is not checked here: the compiler reports errors, at the right line.
"""

import re
from dataclasses import dataclass
from enum import Enum
from typing import Literal, NamedTuple

__all__ = [
    "CONTROLLER_WORDS",
    "ControlLine",
    "ControllerWord",
    "Overflow",
    "ProgramKind",
    "ProgramText",
    "ScriptChannel",
    "ScriptItem",
    "match_controller_word",
]


# --- the controller's words: PolyScope drives the controller with them and clients copied them. The box
# implements them; here they are listed, so that they are not compiled.


@dataclass(frozen=True, slots=True)
class ControllerWord:
    """One row: the words with one space between, whether a number follows, what it does, who sends it."""

    text: str
    takes_number: bool
    effect: str
    source: str


_W = ControllerWord
CONTROLLER_WORDS: tuple[ControllerWord, ...] = (
    _W("power on", False, "as the dashboard command", "UR client library"),
    _W("power off", False, "as the dashboard command", "UR client library"),
    _W("set robotmode run", False, "release the brakes; powers on if needed", "UR client library, SAW"),
    _W("set robotmode freedrive", False, "freedrive, until `set robotmode run`; CB2", "SAW"),
    _W("set unlock protective stop", False, "leave a protective stop", "UR client library"),
    _W("stop program", False, "stop the running program", "UR client library"),
    _W("pause program", False, "pause the running program", "UnderAutomation; wording inferred"),
    _W("resume program", False, "resume the paused program", "UnderAutomation; wording inferred"),
    _W("set speed", True, "speed slider, 0.01 to 1", "pharmbio/robotlab; UnderAutomation"),
    _W("set real", False, "drive the real arm", "python-urx"),
    _W("set sim", False, "drive a simulated arm", "python-urx"),
    _W("confirm user safety parameters", False, "confirm the safety settings", "seen in the field"),
)  # fmt: skip

_BY_TEXT = {word.text: word for word in CONTROLLER_WORDS}
_LONGEST = 64  # characters; a longer line is not a word
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


def match_controller_word(line: str) -> tuple[ControllerWord, str] | None:
    """The row of a line, and its number as text ("" without one); None for any other line.

    Words are lower case; spaces around and between them are ignored.
    """
    if len(line) > _LONGEST:
        return None
    words = line.split()
    row = _BY_TEXT.get(" ".join(words))
    if row is not None:
        return None if row.takes_number else (row, "")
    row = _BY_TEXT.get(" ".join(words[:-1]))
    if row is not None and row.takes_number and _NUMBER.fullmatch(words[-1]):
        return row, words[-1]
    return None


ProgramKind = Literal["def", "sec", "statement"]


class ProgramText(NamedTuple):
    r"""One complete program.

    Attributes:
        text: the lines, each ended by `\n`; line 1 is the `def` line. Bytes above 127 are Latin-1 characters.
        name: after `def` or `sec`; of a statement, the function it calls. "" if the text has none.
        kind: "def" and "statement" replace the running program, "sec" runs beside it.
    """

    text: str
    name: str
    kind: ProgramKind


class ControlLine(NamedTuple):
    """One of the controller's own words: its row's fixed part, and its number as text, "" without one.

    The text is the whole line with single spaces, such as `set speed 0.5`.
    """

    text: str
    word: str
    argument: str


class Overflow(NamedTuple):
    """A line or program that was longer than the limit in bytes, and has been dropped."""

    what: Literal["line", "program"]
    limit: int


ScriptItem = ProgramText | ControlLine | Overflow

MAX_LINE = 64 << 10
"""Longest line in bytes; the longest in the field (a matrix literal) has some kilobytes."""

MAX_PROGRAM = 4 << 20
"""Longest program in bytes; the longest in the field has 50 kB."""

_HEADER = re.compile(r"[ \t]*(def|sec)(?![A-Za-z0-9_])[ \t]*([A-Za-z_][A-Za-z0-9_]*)?")
_COUNTED = re.compile(
    r'"[^"]*"?'  # a string; an unterminated one ends with its line
    r"|#.*"
    r"|(?<![A-Za-z0-9_.])(def|sec|thread|if|while|end)(?![A-Za-z0-9_])"
)
_CALL = re.compile(r"(?<![A-Za-z0-9_])([A-Za-z_][A-Za-z0-9_]*)[ \t]*\(")
_NAME = re.compile(r"[ \t]*([A-Za-z_][A-Za-z0-9_]*)")
_COLUMN_1_END = re.compile(r"end(?![A-Za-z0-9_])")


class _State(Enum):
    OUTSIDE = "outside"
    IN_PROGRAM = "in a program"
    DROPPING = "dropping the rest of a program that was too long"


class ScriptChannel:
    """Bytes of one connection in, programs and controller words out. The split of the bytes does not matter.

    Lines and programs beyond the longest [bytes] are dropped.
    """

    def __init__(self, max_line: int = MAX_LINE, max_program: int = MAX_PROGRAM) -> None:
        self._max_line = max_line
        self._max_program = max_program
        self._partial = bytearray()  # the incomplete line
        self._skipping_line = False
        self._state = _State.OUTSIDE
        self._text = bytearray()  # the incomplete program
        self._depth = 0
        self._kind: ProgramKind = "def"
        self._name = ""

    @property
    def pending(self) -> int:
        """Bytes of an incomplete line or program; they are lost if the connection ends."""
        return len(self._text) + len(self._partial)

    def feed(self, data: bytes) -> list[ScriptItem]:
        """Add received bytes and return what is complete. Never raises."""
        items: list[ScriptItem] = []
        if b"\n" not in data:
            if not self._skipping_line:
                self._partial += data
                self._check_partial(items)
            return items
        # Joined once per newline, so a long line in many pieces stays linear.
        *lines, rest = (bytes(self._partial) + data).split(b"\n")
        self._partial.clear()
        if self._skipping_line:
            del lines[0]
            self._skipping_line = False
        for line in lines:
            if len(line) > self._max_line:
                self._overflow("line", items)
            else:
                self._take_line(line.removesuffix(b"\r").decode("latin-1"), items)
        self._partial += rest
        self._check_partial(items)
        return items

    def drop(self) -> None:
        """Drop the incomplete line and program, and the rest of them that is still to come."""
        self._skipping_line = self._skipping_line or bool(self._partial)
        self._partial.clear()
        self._drop_program()

    def _check_partial(self, items: list[ScriptItem]) -> None:
        if len(self._partial) > self._max_line:
            self._partial.clear()
            self._skipping_line = True
            self._overflow("line", items)

    def _drop_program(self) -> None:
        if self._state is _State.IN_PROGRAM:
            self._state = _State.DROPPING
            self._text.clear()

    def _overflow(self, what: Literal["line", "program"], items: list[ScriptItem]) -> None:
        self._drop_program()
        items.append(Overflow(what, self._max_line if what == "line" else self._max_program))

    def _take_line(self, line: str, items: list[ScriptItem]) -> None:
        if self._state is _State.OUTSIDE:
            self._take_outside(line, items)
        elif self._begins_new_program(line):
            if self._state is _State.IN_PROGRAM:
                items.append(self._finish())
            self._state = _State.OUTSIDE
            self._take_outside(line, items)
        elif self._state is _State.IN_PROGRAM:
            self._take_body(line, items)
        elif _COLUMN_1_END.match(line):  # of the program that we are dropping
            self._state = _State.OUTSIDE

    def _take_outside(self, line: str, items: list[ScriptItem]) -> None:
        stripped = line.strip()
        if not stripped or stripped[0] in "#$":
            return
        header = _HEADER.match(line)
        if header:
            self._state = _State.IN_PROGRAM
            self._kind = "def" if header[1] == "def" else "sec"
            self._name = header[2] or ""
            self._depth = 0
            self._take_body(line, items)
            return
        matched = match_controller_word(line)
        if matched:
            word, argument = matched
            items.append(ControlLine(f"{word.text} {argument}".rstrip(), word.text, argument))
            return
        code = line.partition("#")[0]
        called = _CALL.search(code) or _NAME.match(code)
        items.append(ProgramText(line + "\n", called[1] if called else "", "statement"))

    def _take_body(self, line: str, items: list[ScriptItem]) -> None:
        self._text += line.encode("latin-1") + b"\n"
        if len(self._text) > self._max_program:
            self._overflow("program", items)
        elif self._closes(line):
            self._state = _State.OUTSIDE
            items.append(self._finish())

    def _closes(self, line: str) -> bool:
        """Count the blocks of one line; True when the last one closes. The rest of the line is not read."""
        if line.lstrip().startswith("$"):
            return False
        for counted in _COUNTED.finditer(line):
            keyword = counted[1]
            if keyword == "end":
                self._depth -= 1
                if self._depth <= 0:
                    return True
            elif keyword:
                self._depth += 1
        return False

    @staticmethod
    def _begins_new_program(line: str) -> bool:
        if not line or line[0] in " \t":
            return False
        return _HEADER.match(line) is not None or match_controller_word(line) is not None

    def _finish(self) -> ProgramText:
        program = ProgramText(self._text.decode("latin-1"), self._name, self._kind)
        self._text.clear()
        return program
