"""The page docs/protocol/README.md: all ports of a control box, and where to read about each."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from docs.generate.page_parts import table
from protocol.ur_types import Ports
from ur_emulator.budgets import BUDGETS

__all__ = ["ROWS", "MapRow", "render"]


class MapRow(NamedTuple):
    """What one port is: its name in `Ports`, what it sends and how often, what it takes, its page."""

    name: str
    sends: str
    rate: str
    takes: str
    page: str


_SCRIPT = "scripts and words"

ROWS: tuple[MapRow, ...] = (
    MapRow("dashboard", "a line for each command", "on request", "commands, a line each", "dashboard.md"),
    MapRow("primary", "states, all messages", "10 a second", _SCRIPT, "primary.md"),
    MapRow("secondary", "states", "10 a second", _SCRIPT, "primary.md"),
    MapRow("realtime", "frames", "125 a second", _SCRIPT, "realtime.md"),
    MapRow("rtde", "the variables asked for", "up to 125 a second", "variables", "rtde.md"),
    MapRow("primary_ro", "as 30001", "10 a second", "nothing", "primary.md"),
    MapRow("secondary_ro", "as 30002", "10 a second", "nothing", "primary.md"),
    MapRow("realtime_ro", "as 30003", "125 a second", "nothing", "realtime.md"),
    MapRow("modbus", "answers", "on request", "Modbus functions 1-6, 15, 16", "modbus.md"),
)
"""One row a port of `Ports`."""

_OF_ADDRESS = BUDGETS.clients_of_address
_INTRODUCTION = f"""\
# The ports of the box

Made from `docs/generate/ports_page.py` and `protocol/ur_types.py` by `make docs`.

`ur-emulator serve` opens these ports, with the numbers of a real control box, which most clients have
built in; `--port-base N` adds N to all of them, and several boxes live side by side on loopback addresses
of their own. `--version` decides what software the box pretends to run, and with it the layouts.

All ports take several clients at once: {BUDGETS.clients_of_port} of an address at a port,
{_OF_ADDRESS} of an address, {BUDGETS.clients} of a box. Further ones are accepted and closed
at once, and the log says so. What a client does not read is dropped in whole packages
(where every reply counts, the client is cut off instead). What clients send is taken a piece of each in turn,
and never when a cycle is due: a client that sends faster than it is served waits. One that begins with a
request over HTTP is closed: a page in a browser could have sent it. How well others keep their
streams under attack is measured: [security.md](../security.md). Who may do what through which port:
[SECURITY.md](../../SECURITY.md).
"""

_CHOICE = """\
## Which one to use

| to | use |
|---|---|
| watch the robot | RTDE; 30003 where a client cannot do that; 30001 for messages and errors |
| make it move | a script to 30002 or 30003, [scripts.md](scripts.md); registers over RTDE to talk to it |
| load, play and stop programs, power the arm | the dashboard |
| wire it to a PLC | Modbus, or RTDE registers |
| press its buttons, push its arm, as no real client can | the control API, [control.md](../control.md) |

`python -m protocol layout` prints the tables behind these pages for any version; `python -m protocol decode`
shows captured bytes, or those of a box that runs, as named fields. What is exact and what was chosen:
[fidelity.md](../fidelity.md). What the modes mean: [states.md](../states.md).
"""


def render() -> str:
    """Return the page."""
    return "\n".join(
        (
            _INTRODUCTION,
            *table(("port", "sends", "how often", "takes", "page"), _rows()),
            "",
            _CHOICE.rstrip() + "\n",
        )
    )


def _rows() -> Iterator[tuple[object, ...]]:
    numbers = Ports()
    for row in ROWS:
        takes = f"[{row.takes}](scripts.md)" if row.takes == _SCRIPT else row.takes
        yield getattr(numbers, row.name), row.sends, row.rate, takes, f"[{row.page}]({row.page})"
