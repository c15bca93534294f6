"""The dashboard server's commands as CB3 has them: names, reply texts, first versions.

One row a command. A reply is chosen by its key and filled in: `row.reply("ok", path="/programs/a.urp")`.
What a command does to the robot and when it fails is the box's business.

Sources: UR "Dashboard Server, port 29999" (support page, CB series) and "Dashboard Server Remote Control
Interface e-Series" (2022) for the wording; first versions from UR's client library; where the two documents
differ, what that library's tests expect of a CB3 3.14/3.15 simulator.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from protocol.errors import LocalProtocolError
from protocol.ur_types import SoftwareVersion

__all__ = [
    "COMMANDS",
    "GREETING",
    "USER_ROLES",
    "DashboardCommand",
    "commands_of",
    "match_command",
    "unknown_command_reply",
]

GREETING = "Connected: Universal Robots Dashboard Server"
"""The line that the server sends on accept; clients read it before their first command."""


@dataclass(frozen=True, slots=True)
class DashboardCommand:
    """One row.

    Attributes:
        name: the fixed words, spelled as on the wire.
        argument: description of the argument; "" if there is none.
        since: first CB3 software.
        does: description.
        replies: templates by key; "ok" is always there. Braces name what the box fills in.
        done_since: first software whose reply comes when the command is carried out; None for commands whose
            reply has always come at once. (3, 0): all CB3 software.
    """

    name: str
    argument: str
    since: SoftwareVersion
    does: str
    replies: Mapping[str, str]
    done_since: SoftwareVersion | None = None

    def replies_when_done(self, version: SoftwareVersion) -> bool:
        """True if software `version` answers when the command is carried out, not when it is taken."""
        return self.done_since is not None and version >= self.done_since

    def reply(self, key: str = "ok", /, **values: object) -> str:
        """The reply line.

        Raises:
            LocalProtocolError: no such key, or a value that the template names is missing.
        """
        template = self.replies.get(key)
        if template is None:
            raise LocalProtocolError(f"{self.name!r} has no reply {key!r}: use {', '.join(self.replies)}")
        try:
            return template.format(**values)
        except KeyError as missing:
            raise LocalProtocolError(f"reply {template!r} of {self.name!r} needs {missing}") from None


def _row(
    name: str,
    argument: str,
    since: tuple[int, int],
    does: str,
    ok: str,
    done_since: tuple[int, int] | None = None,
    **failures: str,
) -> DashboardCommand:
    replies = MappingProxyType({"ok": ok, **failures})
    done = SoftwareVersion(*done_since) if done_since else None
    return DashboardCommand(name, argument, SoftwareVersion(*since), does, replies, done)


_NOT_FOUND = "File not found: {name}"

COMMANDS: tuple[DashboardCommand, ...] = (
    _row("load", "program.urp", (1, 4), "loads a program and its installation, or changes nothing",
         "Loading program: {path}", (3, 3),
         not_found=_NOT_FOUND, failed="Error while loading program: {name}"),
    _row("play", "", (1, 4), "starts the loaded program at the top, or lets a paused one go on",
         "Starting program", (3, 3), failed="Failed to execute: play"),
    _row("stop", "", (1, 4), "stops the program; harmless without one",
         "Stopped", (3, 3), failed="Failed to execute: stop"),
    _row("pause", "", (1, 4), "pauses the program that plays",
         "Pausing program", (3, 3), failed="Failed to execute: pause"),
    _row("quit", "", (1, 4), "closes the connection", "Disconnected"),
    _row("shutdown", "", (1, 4), "switches the robot and the box off", "Shutting down"),
    _row("running", "", (1, 6), "whether a program plays: `true` or `false`", "Program running: {running}"),
    _row("robotmode", "", (1, 6), "robot mode", "Robotmode: {mode}"),
    _row("get loaded program", "", (1, 6), "which program is loaded",
         "Loaded program: {path}", none="No program loaded"),
    _row("popup", "text", (1, 6), "shows a popup; it stays until it is closed", "showing popup"),
    _row("close popup", "", (1, 6), "closes all popups, also those that programs wait for", "closing popup"),
    _row("addToLog", "text", (1, 8), "writes into the log",
         "Added log message", empty="No log message to add"),
    _row("isProgramSaved", "", (1, 8), "whether the loaded program is saved; its name without folder",
         "{saved} {program}"),
    _row("programState", "", (1, 8),
         "`STOPPED`, `PLAYING` or `PAUSED`; the name without folder, `<unnamed>` if nothing is loaded",
         "{state} {program}"),
    _row("PolyscopeVersion", "", (1, 8), "software: four numbers and a date",
         "URSoftware {version} ({date})"),
    _row("setUserRole", "role", (3, 1), "sets who uses the pendant, which has no effect on the ports",
         "Setting user role: {role}", failed="Failed setting user role: {role}"),
    _row("getUserRole", "", (3, 1), "the role that was set", "{role}"),
    _row("power on", "", (3, 0), "powers the arm", "Powering on"),
    _row("power off", "", (3, 0), "cuts the power of the arm; a program stops", "Powering off"),
    _row("brake release", "", (3, 0), "releases the brakes, powering the arm first if need be",
         "Brake releasing"),
    _row("safetymode", "", (3, 0), "safety mode", "Safetymode: {mode}"),
    _row("safetystatus", "", (3, 11), "safety mode with its reason", "Safetystatus: {status}"),
    _row("unlock protective stop", "", (3, 1), "ends a protective stop",
         "Protective stop releasing",
         too_early="Cannot unlock protective stop until 5s after occurrence. "
                   "Always inspect cause of protective stop before unlocking"),
    _row("close safety popup", "", (3, 1), "closes a popup about safety", "closing safety popup"),
    _row("load installation", "file.installation", (3, 2), "loads an installation",
         "Loading installation: {path}", (3, 2),
         not_found=_NOT_FOUND, failed="Failed to load installation: {name}"),
    _row("restart safety", "", (3, 7), "restarts the safety system after a violation or fault: power off",
         "Restarting safety"),
    _row("get serial number", "", (3, 12), "serial number, digits", "{serial}"),
    _row("get robot model", "", (3, 12), "`UR3`, `UR5` or `UR10`", "{model}"),
    _row("generate flight report", "controller|software|system", (3, 13),
         "writes a report; `system` if no kind is given",
         "Flight Report generated with id:{id}", (3, 13), failed="{reason}"),
    _row("generate support file", "directory", (3, 13), "writes a report and packs it with all others",
         "Completed successfully:{file}", (3, 13), failed="{reason}"),
    _row("saveLog", "", (3, 13), "writes the log to a file",
         "Log saved to disk", (3, 13), failed="Failed to execute: saveLog"),
)  # fmt: skip
"""All commands of CB3 software. What newer software renamed or added for e-Series is not here."""

USER_ROLES = ("PROGRAMMER", "OPERATOR", "NONE", "LOCKED", "RESTRICTED")
"""What `setUserRole` accepts."""

# A name has at most so many words.
_MOST_WORDS = 4


def commands_of(
    version: SoftwareVersion, table: Iterable[DashboardCommand] = COMMANDS
) -> Mapping[str, DashboardCommand]:
    """The commands of a table that software `version` knows, by name."""
    return MappingProxyType({command.name: command for command in table if command.since <= version})


def match_command(line: str, known: Mapping[str, DashboardCommand]) -> tuple[DashboardCommand, str] | None:
    """The command that a line is, and its argument; None if no known command is.

    The longest name wins, so `load installation x` is not a program called `installation x`. Names are
    case-sensitive; the argument runs to the end of the line and may contain spaces.
    """
    words = line.split(None, _MOST_WORDS)
    for count in range(min(len(words), _MOST_WORDS), 0, -1):
        command = known.get(" ".join(words[:count]))
        if command is None:
            continue
        rest = line.split(None, count)[count:]
        argument = rest[0].strip() if rest else ""
        if command.argument or not argument:
            return command, argument
    return None


def unknown_command_reply(line: str) -> str:
    """The answer to anything else. Its wording is assumed; clients only need one line."""
    return f"could not understand: '{line}'"
