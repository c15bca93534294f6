"""The dashboard server's commands: names, reply texts, first versions of each generation.

One row a command. A reply is chosen by its key and filled in: `row.reply("ok", path="/programs/a.urp")`.
What a command does to the robot and when it fails is the box's business.

Sources: UR "Dashboard Server, port 29999" (support page, CB series) and "Dashboard Server Remote Control
Interface e-Series" (2022) for the wording and for what needs remote control; first versions from UR's client
library; where documents differ, what that library's tests expect of simulators with 3.14, 3.15 and 5.x; reply
of `load` on 5.x: log of a real robot.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from protocol.errors import LocalProtocolError
from protocol.ur_types import SoftwareVersion
from protocol.wire_record import ALWAYS, Since, since

__all__ = [
    "COMMANDS",
    "GREETING",
    "OPERATIONAL_MODES",
    "REMOTE_CONTROL_ONLY",
    "USER_ROLES",
    "DashboardCommand",
    "commands_of",
    "match_command",
    "unknown_command_reply",
]

GREETING = "Connected: Universal Robots Dashboard Server"
"""The line that the server sends on accept; clients read it before their first command."""

REMOTE_CONTROL_ONLY = (
    "Command is not allowed due to safety reasons, please switch robot to Remote Control mode "
    "and reconnect to port 29999"
)
"""The reply of an e-Series robot in local control to commands with `needs_remote`. Source: public clients."""


@dataclass(frozen=True, slots=True)
class DashboardCommand:
    """One row.

    Attributes:
        name: the fixed words, spelled as on the wire.
        argument: description of the argument; "" if there is none.
        since: first software of each generation.
        replies: templates by key; "ok" is always there. Braces name what the box fills in.
        done_since: first software whose reply comes when the command is carried out; None for commands whose
            reply has always come at once. e-Series software is newer than all of them.
        needs_remote: an e-Series robot refuses it in local control.
    """

    name: str
    argument: str
    since: Since
    does: str
    replies: Mapping[str, str]
    done_since: SoftwareVersion | None = None
    needs_remote: bool = False

    def replies_when_done(self, version: SoftwareVersion) -> bool:
        """True if software `version` answers when the command is carried out, not when it is taken."""
        return self.done_since is not None and version >= self.done_since

    def reply(self, key: str = "ok", /, **values: object) -> str:
        """The reply line; LocalProtocolError if the key, or a value that the template names, is missing."""
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
    since: Since,
    does: str,
    ok: str,
    done_since: tuple[int, int] | None = None,
    *,
    needs_remote: bool = False,
    **failures: str,
) -> DashboardCommand:
    replies = MappingProxyType({"ok": ok, **failures})
    done = SoftwareVersion(*done_since) if done_since else None
    return DashboardCommand(name, argument, since, does, replies, done, needs_remote)


_NOT_FOUND = "File not found: {name}"
_LOAD = "loads a program and its installation, or changes nothing"
_NOT_LOADED = "Error while loading program: {name}"

_SINCE_3_1 = since((3, 1))
_ONLY_CB3 = since((3, 1), None)
_SINCE_3_12 = since((3, 12), (5, 6))
_SINCE_3_13 = since((3, 13), (5, 8))
_ONLY_E_SERIES = since(None)
_SINCE_5_6 = since(None, (5, 6))

COMMANDS: tuple[DashboardCommand, ...] = (
    _row("load", "program.urp", since((3, 0), None), _LOAD, "Loading program: {path}", (3, 3),
         not_found=_NOT_FOUND, failed=_NOT_LOADED),
    _row("load", "program.urp", _ONLY_E_SERIES, _LOAD, "Loading program: {path}, {installation}", (3, 3),
         needs_remote=True, not_found=_NOT_FOUND, failed=_NOT_LOADED),
    _row("play", "", ALWAYS, "starts the loaded program at the top, or lets a paused one go on",
         "Starting program", (3, 3), needs_remote=True, failed="Failed to execute: play"),
    _row("stop", "", ALWAYS, "stops the program; harmless without one",
         "Stopped", (3, 3), needs_remote=True, failed="Failed to execute: stop"),
    _row("pause", "", ALWAYS, "pauses the program that plays",
         "Pausing program", (3, 3), needs_remote=True, failed="Failed to execute: pause"),
    _row("quit", "", ALWAYS, "closes the connection", "Disconnected"),
    _row("shutdown", "", ALWAYS, "switches the robot and the box off", "Shutting down"),
    _row("running", "", ALWAYS, "whether a program plays: `true` or `false`", "Program running: {running}"),
    _row("robotmode", "", ALWAYS, "robot mode", "Robotmode: {mode}"),
    _row("get loaded program", "", ALWAYS, "which program is loaded",
         "Loaded program: {path}", none="No program loaded"),
    _row("popup", "text", ALWAYS, "shows a popup; it stays until it is closed", "showing popup"),
    _row("close popup", "", ALWAYS, "closes all popups, also those that programs wait for", "closing popup"),
    _row("addToLog", "text", ALWAYS, "writes into the log",
         "Added log message", empty="No log message to add"),
    _row("isProgramSaved", "", ALWAYS, "whether the loaded program is saved; its name without folder",
         "{saved} {program}"),
    _row("programState", "", ALWAYS,
         "`STOPPED`, `PLAYING` or `PAUSED`; the name without folder, `<unnamed>` if nothing is loaded",
         "{state} {program}"),
    _row("PolyscopeVersion", "", ALWAYS, "software: four numbers and a date",
         "URSoftware {version} ({date})"),
    _row("version", "", since(None, (5, 13)), "software: four numbers", "{version}"),
    _row("setUserRole", "role", _ONLY_CB3, "sets who uses the pendant, which has no effect on the ports",
         "Setting user role: {role}", failed="Failed setting user role: {role}"),
    _row("getUserRole", "", _ONLY_CB3, "the role that was set", "{role}"),
    _row("set operational mode", "manual|automatic", _ONLY_E_SERIES,
         "sets the operational mode, which the pendant can no longer change",
         "Operational mode {mode} is set", failed="Failed setting operational mode: {mode}"),
    _row("get operational mode", "", _SINCE_5_6,
         "`MANUAL`, `AUTOMATIC`, or `NONE` if no mode and no password was ever set", "{mode}"),
    _row("clear operational mode", "", _ONLY_E_SERIES, "gives the operational mode back to the pendant",
         "No longer controlling the operational mode. Current operational mode: '{mode}'."),
    _row("power on", "", ALWAYS, "powers the arm", "Powering on", needs_remote=True),
    _row("power off", "", ALWAYS, "cuts the power of the arm; a program stops", "Powering off",
         needs_remote=True),
    _row("brake release", "", ALWAYS, "releases the brakes, powering the arm first if need be",
         "Brake releasing", needs_remote=True),
    _row("safetymode", "", ALWAYS, "safety mode", "Safetymode: {mode}"),
    _row("safetystatus", "", since((3, 11), (5, 4)), "safety mode with its reason", "Safetystatus: {status}"),
    _row("unlock protective stop", "", _SINCE_3_1, "ends a protective stop",
         "Protective stop releasing", needs_remote=True,
         too_early="Cannot unlock protective stop until 5s after occurrence. "
                   "Always inspect cause of protective stop before unlocking"),
    _row("close safety popup", "", _SINCE_3_1, "closes a popup about safety", "closing safety popup",
         needs_remote=True),
    _row("load installation", "file.installation", since((3, 2)), "loads an installation",
         "Loading installation: {path}", (3, 2), needs_remote=True,
         not_found=_NOT_FOUND, failed="Failed to load installation: {name}"),
    _row("restart safety", "", since((3, 7), (5, 1)),
         "restarts the safety system after a violation or fault: power off",
         "Restarting safety", needs_remote=True),
    _row("is in remote control", "", _SINCE_5_6, "whether the robot is in remote control: `true` or `false`",
         "{remote}"),
    _row("get serial number", "", _SINCE_3_12, "serial number, digits", "{serial}"),
    _row("get robot model", "", _SINCE_3_12, "`UR3`, `UR5` or `UR10`; an e-Series arm has the same name",
         "{model}"),
    _row("generate flight report", "controller|software|system", _SINCE_3_13,
         "writes a report; `system` if no kind is given",
         "Flight Report generated with id:{id}", (3, 13), failed="{reason}"),
    _row("generate support file", "directory", _SINCE_3_13, "writes a report and packs it with all others",
         "Completed successfully:{file}", (3, 13), failed="{reason}"),
    _row("saveLog", "", _SINCE_3_13, "writes the log to a file",
         "Log saved to disk", (3, 13), failed="Failed to execute: saveLog"),
)  # fmt: skip
"""All commands of both generations."""

USER_ROLES = ("PROGRAMMER", "OPERATOR", "NONE", "LOCKED", "RESTRICTED")
"""What `setUserRole` accepts."""

OPERATIONAL_MODES = ("MANUAL", "AUTOMATIC")
"""What `set operational mode` accepts, in any letter case."""

# A name has at most so many words.
_MOST_WORDS = 4


def commands_of(
    version: SoftwareVersion, table: Iterable[DashboardCommand] = COMMANDS
) -> Mapping[str, DashboardCommand]:
    """The commands of a table that software `version` knows, by name."""
    return MappingProxyType({command.name: command for command in table if command.since.covers(version)})


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
