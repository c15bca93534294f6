"""The page SECURITY.md: what each port allows, what is promised, and all limits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import NamedTuple

from docs.generate.page_parts import table
from pc_client.files import FILE_KINDS
from protocol.ur_types import Ports
from ur_emulator.budgets import BUDGETS
from ur_emulator.host.control_api.http_client import DEFAULT_PORT
from ur_hil import PENDANT_PORT
from ur_hil.input_files import MIB


class _PortRow(NamedTuple):
    """What one port allows: its names in `Ports`, what whoever reaches it may do, what it asks for."""

    names: tuple[str, ...]
    may: str
    asks: str


_NOTHING = "nothing"
_CONTROL = ()
_PORTS = (
    _PortRow(
        ("primary", "secondary", "realtime"),
        "run any URScript program: move the arm, set outputs and registers, **open connections from this "
        "machine to any address and port that it reaches** (sockets, XML-RPC, Modbus units), also to "
        "services on loopback addresses that trust this machine, and send the answers on. A script reads "
        "and writes no files, and cannot reach the control port of its box",
        _NOTHING,
    ),
    _PortRow(
        ("dashboard",),
        "power the arm and release its brakes, reset safety stops, play, stop and load programs of the "
        "folder `--programs`, learn which names exist there, write the log, flight reports and support files "
        "into it, and `shutdown` the box",
        _NOTHING,
    ),
    _PortRow(
        ("robot_api",),
        "the same as the dashboard, and read and write files of programs in the folder `--programs`",
        "pages of other sites are refused",
    ),
    _PortRow(("interpreter",), "add any URScript to a program that is in interpreter mode", _NOTHING),
    _PortRow(("rtde",), "read all variables, set outputs, registers and the speed slider", _NOTHING),
    _PortRow(("modbus",), "read and set outputs and registers", _NOTHING),
    _PortRow(
        ("gripper", "tool_line"),
        "activate grippers, move their fingers, let go of what they hold; open only with a tool (`--tool`)",
        _NOTHING,
    ),
    _PortRow(
        ("onrobot",),
        "move the fingers of grippers, let go of what they hold, turn their supply off and on; open only "
        "with such a tool",
        "pages of other sites are refused",
    ),
    _PortRow(("primary_ro", "secondary_ro", "realtime_ro"), "read states, frames and messages", _NOTHING),
    _PortRow(
        _CONTROL,
        "change the physics and the surroundings: push the arm, add obstacles and payloads, press emergency "
        "stops, set inputs, trigger faults; run programs as text and of the folder; read the log",
        "a token, if one was set; pages of other sites and scripts of the box are refused",
    ),
)

_INTRODUCTION = """\
# Security

Made from `docs/generate/security_policy.py`, `ur_emulator/budgets.py` and
`pc_client/files.py` by `make docs`. [docs/security.md](docs/security.md) lists the attacks
that were tried, with figures.

## Who may do what

The box trusts every client that reaches its ports, as a real CB3 does: its protocols have no
password. So the address decides. `ur-emulator serve` listens on 127.0.0.1 by default; then **every
program and every user of this machine** may do what the table says. With another address
(`--host`), the whole network may: use this only in your own network. The control port requires a
token there.
"""

_PROMISES = """\
## What is promised

| promise | held by |
|---|---|
| No bytes that arrive at a port, and no program, end the process of a box or stop its other clients. An error ends the connection or the program that caused it, with a line in the log | `tests/attack`, `tests/fuzz` |
| The use of resources by clients and programs is bounded (below); the newest request beyond a limit is refused. The memory of the box and its worker processes is measured as one total, which stays below 300 MB, on Linux; a box in the process of its user (`in_process=True`) is not measured | `tests/attack` |
| A client that is not part of an attack keeps its stream, on an idle machine with the rate and the gaps of docs/security.md; that page also lists the attacks that exceed them | `make attack` |
| Nothing is read or written outside the folder `--programs`, by no name and through no link; without this option the box writes into a temporary folder, which it removes. No answer contains a path of this machine | `tests/attack`, `tests/ur_emulator/test_program_places.py` |
| A web page in a browser on this machine cannot use the box: the control port, the Robot API and port 41414 check `Host`, `Origin` and `Sec-Fetch-Site`, all other ports close connections that begin with an HTTP request | `tests/attack`, `tests/ur_emulator/test_control_http.py` |
| The client ends a session with a hostile or broken robot in one line, with the arm at rest, and refuses files that are too large or damaged | `tests/attack`, `tests/fuzz` |

## What is not promised

- Nothing protects the users of one machine from each other. The protocols have no passwords and no encryption.
- The box is an ordinary process with the rights of its user. It compiles scripts to Python code; a defect in the compiler, in MuJoCo, numpy or Python is a defect
of the box. Run it as a user with few rights, and in a container if strangers can reach it.
- A slow or busy machine delays the box.
- The client (`ur-client`) moves real arms. Its checks do not replace the safety functions of the arm, and the box
  does not prove that an arm is safe: [docs/real-arm.md](docs/real-arm.md).

## How to report a weakness

Report it to the maintainers in private, by the private report of the repository, before you publish
it. Give the version (`pip show ur-hil`), the options of `ur-emulator serve`, and the bytes that
were sent, preferably as a function for `tests/attack`. Only the last version gets corrections.
"""  # noqa: E501 - rows of tables


def render() -> str:
    """Return the page."""
    return "\n".join(
        (
            _INTRODUCTION,
            *table(("port", "every client may", "it requires"), _ports()),
            "",
            _PROMISES,
            "## Limits of a box",
            "",
            "A control cycle has its part of a limit for 8 ms, at least 1: a quarter on an e-Series.",
            "",
            *table(("limit", "of", "beyond it", "name"), _budgets()),
            "",
            "## Files that the client reads",
            "",
            *table(("file", "most MiB", "reason"), _files()),
            "",
        )
    )


def _ports() -> Iterator[tuple[str, ...]]:
    numbers = Ports()
    for row in _PORTS:
        given = ", ".join(str(getattr(numbers, name)) for name in row.names)
        yield given or f"control port, e.g. {DEFAULT_PORT}; closed by default", row.may, row.asks
    yield (
        f"{PENDANT_PORT}, of the window, a process of its own; closed by default",
        "do all of this to a box that was opened with its control port; only look at a real arm",
        "a token beyond loopback, and that of `serve --token`; pages of other sites are refused",
    )


def _budgets() -> Iterator[tuple[str, ...]]:
    for row in fields(BUDGETS):
        limit, about = getattr(BUDGETS, row.name), row.metadata
        yield f"{limit:,} {about['unit']}", about["scope"], about["beyond"], f"`{row.name}`"


def _files() -> Iterator[tuple[str, ...]]:
    for name, kind in FILE_KINDS.items():
        yield name, f"{kind.most_bytes // MIB}", kind.reason
