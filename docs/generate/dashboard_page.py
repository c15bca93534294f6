"""The page docs/protocol/dashboard.md, made from the table of commands."""

from __future__ import annotations

from protocol.dashboard.commands import (
    COMMANDS,
    GREETING,
    USER_ROLES,
    DashboardCommand,
    unknown_command_reply,
)
from protocol.dashboard.connection import MAX_LINE
from protocol.ur_types import SoftwareVersion

_FIRST_CB3 = SoftwareVersion(3, 0)

_INTRODUCTION = f"""\
# Dashboard server: port 29999

Made from `protocol/dashboard/commands.py` by `make docs`. Programs, installations and files that the box
writes: [programs.md](../programs.md).

On accept the box sends `{GREETING}`. Then every line of
the client, ended by `\\n`, gets exactly one line in reply, in order; several may be sent at once. What
follows the words of a command is its argument, up to the end of the line. Any other line, and a command that
the software does not have yet, is answered with `{unknown_command_reply("line")}`. Names are
case-sensitive.

A reply comes after the control cycle in which the command has acted, so that the next line sees what it did.
Where a version stands in the last column, it comes when the command is carried out (the program is loaded,
has started, the arm rests), from that software on; before, at once.

While a line waits for its reply, so do the lines behind it. A client whose line has more than
{MAX_LINE} bytes is cut off, and so is one that does not read its replies. Who closes his end still gets all
replies. What has begun is done even if the client is gone; the lines behind it are not.
"""


def render() -> str:
    """Return the page."""
    return "\n".join(
        (
            _INTRODUCTION,
            "| command | does | reply | else | since | when done |",
            "|---|---|---|---|---|---|",
            *map(_line, COMMANDS),
            "",
            f"Roles: {', '.join(f'`{role}`' for role in USER_ROLES)}.\n",
        )
    )


def _line(row: DashboardCommand) -> str:
    name = f"{row.name} <{row.argument}>" if row.argument else row.name
    others = "<br>".join(f"`{reply}`" for key, reply in row.replies.items() if key != "ok")
    since = "3.0" if row.since <= _FIRST_CB3 else f"{row.since.major}.{row.since.minor}"
    done = f"{row.done_since.major}.{row.done_since.minor}" if row.done_since else ""
    cells = (f"`{name}`", row.does, f"`{row.replies['ok']}`", others, since, done)
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"
