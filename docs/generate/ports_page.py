"""The page docs/protocol/README.md: all ports of a control box, and the page of each."""

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
    MapRow("realtime", "frames", "125 or 500 a second", _SCRIPT, "realtime.md"),
    MapRow("rtde", "the variables asked for", "up to 125 or 500 a second", "variables", "rtde.md"),
    MapRow("primary_ro", "as 30001", "10 a second", "nothing", "primary.md"),
    MapRow("secondary_ro", "as 30002", "10 a second", "nothing", "primary.md"),
    MapRow("realtime_ro", "as 30003", "125 or 500 a second", "nothing", "realtime.md"),
    MapRow("robot_api", "answers", "on request", "HTTP requests, PolyScope X only", "robot_api.md"),
    MapRow(
        "interpreter", "an answer for each line", "on request", "statements of URScript", "interpreter.md"
    ),
    MapRow("gripper", "an answer for each line", "on request", "variables of a gripper", "gripper.md"),
    MapRow("onrobot", "an answer for each call", "on request", "XML-RPC calls to a gripper", "gripper.md"),
    MapRow("tool_line", "answers of a gripper", "on request", "Modbus RTU, e-Series arms only", "gripper.md"),
    MapRow("modbus", "answers", "on request", "Modbus functions 1-6, 15, 16", "modbus.md"),
)
"""One row a port of `Ports`."""

_OF_ADDRESS = BUDGETS.clients_of_address
_INTRODUCTION = f"""\
# The ports of the box

Made from `docs/generate/ports_page.py` and `protocol/ur_types.py` by `make docs`.

`ur-emulator serve` opens these ports, with the numbers of a real control box, which most clients
have built in. `--port-base N` adds N to all of them. Several boxes can run side by side, each on
its own loopback address. `--software` sets the software that the box reports, and with it the
layouts. Port {Ports().interpreter} is that of e-Series software from 5.10 on; those of a gripper are there
with `--tool`.

All ports accept several clients at once: at most {BUDGETS.clients_of_port} from one address at one
port, {_OF_ADDRESS} from one address, {BUDGETS.clients} at one box. Further clients are accepted and
closed at once, with a line in the log. If a client does not read, whole packages are dropped; on
ports where every reply counts, the connection is closed instead. The box reads from all clients in
turn, a piece at a time, and never when a cycle is due, so a client that sends too fast has to wait.
A connection that begins with an HTTP request is closed (by RTDE with a text message), because a web
page in a browser could have sent it. [security.md](../security.md) measures how well other clients
keep their streams under attack. [SECURITY.md](../../SECURITY.md) says what each port allows.
"""

_CHOICE = """\
## Which one to use

| to | use |
|---|---|
| watch the robot | RTDE; 30003 if the client does not support RTDE; 30001 for messages and errors |
| make it move | a script to 30002 or 30003, [scripts.md](scripts.md); RTDE registers for data |
| load, play and stop programs, power the arm | the dashboard |
| wire it to a PLC | Modbus, or RTDE registers |
| press its buttons or push its arm, which no real client can | the control API, [control.md](../control.md) |

`python -m protocol layout` prints the tables behind these pages for any version; `python -m
protocol decode` shows captured bytes, or those of a running box, as named fields.
[fidelity.md](../fidelity.md) says what is exact and what was chosen; [states.md](../states.md)
explains the modes.
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
