"""The page docs/protocol/scripts.md, made from the words, the limits of the channel and the budgets."""

from __future__ import annotations

from docs.generate.page_parts import table
from protocol.script_channel import CONTROLLER_WORDS, MAX_LINE, MAX_PROGRAM
from ur_emulator.budgets import BUDGETS

_INTRODUCTION = f"""\
# Scripts over ports 30001, 30002 and 30003

Made from `protocol/script_channel.py` and `ur_emulator/budgets.py`
by `make docs`.

A client of one of these three ports can make the robot run [URScript](../urscript-coverage.md):
drivers send their control programs, urx and small tools send a line for every move. The script is
plain text without framing, the same on all three ports. A CB3 runs every script; an e-Series box
in local control runs none and reports C210, until the client connects anew in remote control. The
read-only ports 30011 to 30013 run nothing.

```python
import socket

with socket.create_connection(("127.0.0.1", 30002)) as robot:
    robot.sendall(b"movej([0.6, -1.2, -1.9, -0.5, 1.0, 1.2], a=1.4, v=1.05)\\n")
```

## What is a program

* Lines end in `\\n`; a line is complete only with it. The division of the text into TCP segments
  does not matter.
* `def` or `sec` begins a program, and the `end` that closes its last block ends it; indentation has
  no meaning.
* Any other line is a program of one statement. A stream of such programs (`speedj(...)` in every
  cycle) gives one smooth movement.
* A `def` or a single statement stops and replaces the running program. A `sec` runs beside it,
  within one control cycle, and may not move the arm.
* A program continues when its sender disconnects. An incomplete one is dropped then.
* Lines up to {MAX_LINE} bytes, programs up to {MAX_PROGRAM} bytes; longer ones are dropped, and a warning
  says so.
* Programs begin in the order of arrival. If one client sends many at once, the programs of other
  clients go first. A program waits at most a second for the compilation of a long program of
  another client; the long one does not begin any more if a newer one has begun. At most
  {BUDGETS.programs_per_cycle} programs begin in 8 ms, the others wait. The number of
  waiting programs and the time of a compilation are limited ([SECURITY.md](../../SECURITY.md));
  programs beyond a limit are refused with a warning.
* A program that arrives while the robot is not RUNNING, or is stopped for safety, is not run; a
  runtime exception gives the reason.

The port itself sends no answer. Port 30001 ([primary.md](primary.md)) reports a key message when a
program starts, pauses or stops, with its name (for a single statement, the function that it calls),
and a runtime exception with line and column (counted from 1; line 1 is the `def` line) if a program
does not compile or fails; the exception comes before the stop. `python -m protocol decode primary
--live 127.0.0.1 --count 50` shows these messages.

## Words that are not URScript

These words stand on their own lines, in lower case, outside a program. They act in the next control
cycle and never wait for a program; a word that comes twice in a cycle acts once. `stop program` and
`power off`, like `stop` and `power off` of the dashboard and an emergency stop, also end all
programs of all clients that have arrived but have not begun; only `sec` programs continue. A
program that is paused before it has begun begins with a pause.
"""


def render() -> str:
    """Return the page."""
    rows = (
        (f"`{word.text}{' <number>' * word.takes_number}`", word.effect, word.source)
        for word in CONTROLLER_WORDS
    )
    end = "\nClients see the emulated arm as a real one: `set real` and `set sim` change nothing.\n"
    return "\n".join((_INTRODUCTION, *table(("word", "does", "known from"), rows), end))
