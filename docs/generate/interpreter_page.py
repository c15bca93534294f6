"""The page docs/protocol/interpreter.md, made from the words and reasons of the protocol and the budgets."""

from __future__ import annotations

from collections.abc import Iterator

from docs.generate.page_parts import table
from protocol.interpreter import CLEANED_UP, INVALID_STATE, MAX_LINE, TOO_MANY, Word
from protocol.ur_types import Ports
from ur_emulator.budgets import BUDGETS
from ur_emulator.machine.models.generations import E_SERIES

_DOES = {
    Word.ABORT: "end the `movej` or `movel` that moves the arm, of whatever program; the arm comes to rest",
    Word.SKIP_BUFFER: "drop the lines that have not begun",
    Word.LAST_EXECUTED: "id of the last line that has begun",
    Word.LAST_INTERPRETED: "id of the last line that was accepted",
    Word.LAST_CLEARED: "id of the last line that was cleared",
    Word.UNEXECUTED: "number of lines that `skipbuffer` would drop",
}
_ACTS = (Word.ABORT, Word.SKIP_BUFFER)

_REASONS = (
    (INVALID_STATE, "no program runs"),
    ("Compile error: ..., Syntax error: ...", "the line cannot be compiled; the reason is that of the log"),
    (
        TOO_MANY,
        f"{BUDGETS.interpreter_lines} lines, or {BUDGETS.interpreter_names} functions and variables, were "
        "interpreted since they were cleared, or too much waits",
    ),
    (CLEANED_UP, "interpreter mode began with an empty queue, or `skipbuffer` came before the line's turn"),
)

_PORT = Ports().interpreter
_FIRST = E_SERIES.interpreter_since
_SINCE = f"{_FIRST.major}.{_FIRST.minor}" if _FIRST is not None else "no version"

_INTRODUCTION = f"""\
# Interpreter mode: port {_PORT}

Made from `protocol/interpreter.py`, `docs/generate/interpreter_page.py` and `ur_emulator/budgets.py` by
`make docs`.

A program that calls `interpreter_mode()` waits, and runs statements that clients send to port
{_PORT} meanwhile. e-Series software from {_SINCE} on has this port, CB3 has not.

```sh
pip install ur-hil
ur-emulator serve --robot ur5e
```

```python
import socket

PROGRAM = b"def waiting():\\n  interpreter_mode()\\nend\\n"

with socket.create_connection(("127.0.0.1", 30002)) as script:
    script.sendall(PROGRAM)
with socket.create_connection(("127.0.0.1", {_PORT})) as robot, robot.makefile("r") as answers:
    for line in ("x = 1", "x = x + 1", "end_interpreter()"):
        answer = "discard"
        while answer.startswith("discard"):  # until the program has begun
            robot.sendall(f"{{line}}\\n".encode())
            answer = answers.readline()
        print(answer, end="")  # ack: 1: x = 1
```

## Lines

* A line holds one or more whole statements, or one word of the table below, and ends in `\\n`. A function
  stands on one line: `def f(): textmsg("hello") end`. A line has at most {MAX_LINE} bytes; a client that
  sends a longer one is disconnected. A blank line gets no answer.
* A line that can be compiled becomes part of the running program and gets `ack: <id>: <line>`. Ids begin
  at 1 with each program. The main thread runs the lines one after the other. All statements of a line
  compile, or none runs.
* A line that cannot be interpreted gets `discard: <reason>: <line>`.
* Statements see what the place of the call sees: global variables, functions, threads, and the locals
  of the function that calls `interpreter_mode()`, which keep the changes. They cannot declare new
  global variables. Other new variables belong to the interpreter; later lines see them.
* Lines that come before the program is in interpreter mode wait; `interpreter_mode()` drops them,
  `interpreter_mode(clearQueueOnEnter=False)` runs them.
* `clear_interpreter()` removes all functions and variables of lines and stops the threads that they
  started. `end_interpreter()`, which any thread may call, leaves the mode after the line that runs, and
  clears too unless the mode was entered with `clearOnEnd=False`. Lines that come after one of the two
  wait until it is done.
* A run-time error in a line ends the program, as in any statement.
* Clients take turns, a line each. Lines of a client that has disconnected are executed.
"""

_WORDS = """\
## Words

A word stands alone on its line and acts at once, before lines that wait. Words that ask get
`state: <number>: <word>`. The others get `ack: <number>: <word>`, whose number has no meaning.
"""

_DISCARDS = """\
## Reasons of a discard

The manual names none. These are what public clients look for, or chosen ([fidelity](../fidelity.md)).
"""

_LOG = """\
## Log

Flight reports and support files contain the log of interpreter mode: `interpreter.log` with a line
`e: <id> c: <id> : <line>` for each accepted line (the last id that had begun, its own id),
`interpreter.0.log` with what was cleared last, `interpreter.saved.log` with what `clearOnEnd=False`
has kept.
"""


def render() -> str:
    """Return the page."""
    return "\n".join(
        (
            _INTRODUCTION,
            _WORDS,
            *table(("word", "does or tells", "answer"), _words()),
            "",
            _DISCARDS,
            *table(("reason", "when"), _REASONS),
            "",
            _LOG,
        )
    )


def _words() -> Iterator[tuple[str, ...]]:
    for word in Word:
        answer = "ack" if word in _ACTS else "state"
        yield f"`{word.value}`", _DOES[word], f"`{answer}: <number>: {word.value}`"
