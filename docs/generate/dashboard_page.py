"""The page docs/protocol/dashboard.md, made from the table of commands."""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum

from protocol.dashboard.commands import (
    COMMANDS,
    GREETING,
    REMOTE_CONTROL_ONLY,
    USER_ROLES,
    DashboardCommand,
    unknown_command_reply,
)
from protocol.dashboard.connection import MAX_LINE
from protocol.ur_types import RobotMode, SafetyMode

_INTRODUCTION = f"""\
# Dashboard server: port 29999

Made from `protocol/dashboard/commands.py` by `make docs`. Programs, installations and files that
the box writes: [programs.md](../programs.md).

On connection the box sends `{GREETING}`. Then every line of the client, ended by `\\n`, gets
exactly one line in reply, in order; several lines may be sent at once. The text after the words of
a command, up to the end of the line, is its argument. The reply to any other line, and to a command
that the software does not have yet, is `{unknown_command_reply("line")}`. Commands are
case-sensitive.

A reply comes after the control cycle in which the command has acted, so that the next line sees its
effect. If the last column gives a version, the reply comes from that software on only when the
command is complete (the program is loaded or has started, the arm rests); older software replies at
once. *Since* gives the first software of CB3 and e-Series, "-" where a generation does not have the
command.

An e-Series robot executes the commands marked with R only in remote control. In local control it
replies `{REMOTE_CONTROL_ONLY}`.

While a line waits for its reply, the lines after it wait too. The box closes the connection of a
client that sends a line of more than {MAX_LINE} bytes or does not read its replies. A client that
closes its sending side still gets all replies. A command that has begun is completed even if the
client is gone; of the lines after it four are executed.
"""


def render() -> str:
    """Return the page."""
    return "\n".join(
        (
            _INTRODUCTION,
            "| command | does | reply | else | since | R | when done |",
            "|---|---|---|---|---|---|---|",
            *map(_line, COMMANDS),
            "",
            f"* Robot modes: {_names(RobotMode)}.",
            f"* Safety modes: {_names(SafetyMode)}. `safetymode` gives `SAFEGUARD_STOP` for all from",
            f"  `{SafetyMode.AUTOMATIC_MODE_SAFEGUARD_STOP.name}` on, `safetystatus` gives each.",
            f"* Roles: {', '.join(f'`{role}`' for role in USER_ROLES)}.",
            "",
        )
    )


def _names(modes: Iterable[IntEnum]) -> str:
    return ", ".join(f"`{mode.name}`" for mode in modes)


def _line(row: DashboardCommand) -> str:
    name = f"{row.name} <{row.argument}>" if row.argument else row.name
    others = "<br>".join(f"`{reply}`" for key, reply in row.replies.items() if key != "ok")
    done = f"{row.done_since.major}.{row.done_since.minor}" if row.done_since else ""
    cells = (
        f"`{name}`",
        row.does,
        f"`{row.replies['ok']}`",
        others,
        str(row.since),
        "R" * row.needs_remote,
        done,
    )
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"
