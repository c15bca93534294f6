"""The page docs/protocol/scripts.md, made from the words, the limits of the channel and the budgets."""

from __future__ import annotations

from docs.generate.page_parts import table
from protocol.controller_words import CONTROLLER_WORDS
from protocol.script_channel import MAX_LINE, MAX_PROGRAM
from ur_emulator.budgets import BUDGETS

_INTRODUCTION = f"""\
# Scripts over ports 30001, 30002 and 30003

Made from `protocol/controller_words.py`, `protocol/script_channel.py` and `ur_emulator/budgets.py` by `make
docs`.

Whoever connects to one of the three ports can make the robot run [URScript](../urscript-coverage.md): drivers
upload their control programs this way, urx and small tools send a line for every move. It is plain text
without any frame, the same on all three. CB3 has no switch between local and remote control: what comes is
run. The twins 30011 to 30013 run nothing.

```python
with socket.create_connection(("127.0.0.1", 30002)) as robot:
    robot.sendall(b"movej([0.6, -1.2, -1.9, -0.5, 1.0, 1.2], a=1.4, v=1.05)\\n")
```

## What is a program

* Lines end in `\\n`; a line without it does not exist yet. How the text was cut into segments does not
  matter.
* `def` or `sec` begins a program, the `end` that closes its last block ends it; indentation does not count.
* Any other line is a program of one statement. A stream of them (`speedj(...)` in every cycle) gives one
  smooth movement.
* A `def` or a single statement stops and replaces the program that runs. A `sec` runs beside it, within one
  control cycle, and may not move the arm.
* The program goes on when its sender disconnects. One that is not complete then is dropped.
* Lines up to {MAX_LINE} bytes, programs up to {MAX_PROGRAM} bytes; longer ones are dropped, and a warning
  says so.
* Programs begin in the order of arrival. Who sends many at once lets others go first; nobody waits longer
  than a second for a long program of somebody else, which does not begin any more when a newer one has. At
  most {BUDGETS.programs_per_cycle} programs begin in a control cycle, the others wait; what waits, and how
  long a program may take to compile, is limited ([SECURITY.md](../../SECURITY.md)). What comes on top is
  refused, and a warning says so.
* A program that comes while the robot is not RUNNING, or stopped for safety, is not run; a runtime
  exception says why.

Nothing is answered on the port itself. Who wants to know listens to 30001 ([primary.md](primary.md)): a
key message when a program starts, pauses or stops, with its name (of a single statement, that of the
function it calls), a runtime exception with line and column (counted from 1, line 1 being the `def` line)
when it does not compile or dies, and before the stop. `python -m protocol decode primary --live 127.0.0.1
--count 50` shows them.

## Words that are not URScript

Lines of their own, in lower case, outside of a program. They act in the next control cycle and never wait
for a program; one that comes twice in a cycle acts once. `stop program` and `power off`, like `stop` and
`power off` of the dashboard and an emergency stop, also end all programs that have come before and have not
begun, whoever has sent them; only those of kind `sec` go on. A program that somebody has paused before it
began begins with a pause.
"""


def render() -> str:
    """Return the page."""
    rows = (
        (f"`{word.text}{' <number>' * word.takes_number}`", word.effect, word.source)
        for word in CONTROLLER_WORDS
    )
    end = "\nTo its clients the emulated arm is the real one: `set real` and `set sim` change nothing.\n"
    return "\n".join((_INTRODUCTION, *table(("word", "does", "known from"), rows), end))
