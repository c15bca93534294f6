"""The Robot API of PolyScope X: HTTP calls in place of the dashboard server, one row a call.

A call is a method and a path below `BASE`; a part in braces is an argument. Bodies and answers are JSON
objects; the fields that clients read are named in `does`. In local control most calls that change something
are answered with 403.

Sources: UR client library (the dashboard client for PolyScope X of releases 2.4 to 2.14; its tests, which run
against simulators of 10.11 to 10.14 in local control, and their bodies from the maker's API document), the
README of the PolyScope X "Remote Robot Controller", issue 551 of the client library (a real robot). What the
calls answer beyond that is chosen.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from urllib.parse import unquote

from protocol.ur_types import RobotMode, SafetyMode, SoftwareVersion

__all__ = [
    "API_VERSIONS",
    "BASE",
    "CALLS",
    "ROBOT_MODE_NAMES",
    "SAFETY_MODE_NAMES",
    "ApiCall",
    "api_version",
    "calls_of",
    "match_call",
]

BASE = "/universal-robots/robot-api"


@dataclass(frozen=True, slots=True)
class ApiCall:
    """One row.

    Attributes:
        path: below `BASE`; a last part in braces is an argument.
        since: first PolyScope X software.
        does: description, with the fields of body and answer.
        message: what the answer says when it is done; for people.
        needs_remote: local control forbids it.
    """

    method: str
    path: str
    since: SoftwareVersion
    does: str
    message: str
    needs_remote: bool


def _row(
    method: str, path: str, since: tuple[int, int], does: str, message: str = "", *, in_local: bool = False
) -> ApiCall:
    needs_remote = method != "GET" and not in_local
    return ApiCall(method, path, SoftwareVersion(*since), does, message, needs_remote)


# The oldest PolyScope X software that the client library's tests name is 10.7.
_FIRST, _10_12, _10_14 = (10, 0), (10, 12), (10, 14)

CALLS: tuple[ApiCall, ...] = (
    _row("GET", "/openapi.json", _FIRST, "all calls; `info.version` is that of the API"),
    _row("GET", "/docs", _FIRST, "the same as a page for people"),
    _row("GET", "/system/v1/system-time", _FIRST, "`time` of the controller"),
    _row("PUT", "/robotstate/v1/state", _FIRST,
         "`action`: POWER_ON, POWER_OFF, BRAKE_RELEASE, UNLOCK_PROTECTIVE_STOP, RESTART_SAFETY", "done"),
    _row("GET", "/robotstate/v1/robotmode", _10_12, "`mode`: robot mode"),
    _row("GET", "/robotstate/v1/safetymode", _10_12, "`mode`: safety mode"),
    _row("PUT", "/program/v1/state", _FIRST, "`action`: play, pause, resume, stop", "done"),
    _row("GET", "/program/v1/state", _FIRST, "`state`: PLAYING, PAUSED, STOPPED"),
    _row("PUT", "/program/v1/load", _FIRST, "loads the program `programName`", "Program loaded successfully"),
    _row("PUT", "/program/v1/loaded", _10_12, "loads the program `name`", "Program loaded successfully"),
    _row("GET", "/program/v1/loaded", _10_12, "`name` of the loaded program"),
    _row("GET", "/system/v1/controlmode", _10_12, "`mode`: LOCAL or REMOTE"),
    _row("GET", "/system/v1/operationalmode", _10_12, "`mode`: MANUAL or AUTOMATIC"),
    _row("GET", "/programs/v1", _10_12, "`programs`: each with `name`, `description`, `programState`, dates"),
    _row("POST", "/programs/v1", _10_12,
         "takes a new program, the form field `file`; gives `programName`", "done", in_local=True),
    _row("PUT", "/programs/v1", _10_12,
         "replaces a program, the form field `file`; gives `programName`", "done", in_local=True),
    _row("GET", "/programs/v1/{name}", _10_12, "the file of a program"),
    _row("POST", "/popup/v1", _10_14,
         "shows a popup with `title` and `message`", "Popup opened successfully"),
    _row("DELETE", "/popup/v1", _10_14, "closes all popups; `closed`: there were some", "Popup closed"),
    _row("DELETE", "/popup/v1/safety", _10_14, "closes a popup about safety; `closed`: there was one"),
    _row("GET", "/versions/v1", _10_14, "`marketingVersion`: software"),
    _row("GET", "/system/v1/information", _10_14, "`robotType`, such as UR5, and `serialNumber`"),
    _row("PUT", "/system/v1/shutdown", _10_14, "switches the robot and the box off; answered with 202"),
    _row("POST", "/system/v1/log", _10_14, "writes `message` into the log", "Log entry added"),
    _row("POST", "/supportfiles/v1", _10_14,
         "writes a flight report", "Flight report generated successfully."),
    _row("GET", "/supportfiles/v1", _10_14, "all flight reports, an archive; 204 without one"),
)  # fmt: skip
"""All calls of PolyScope X software that the box answers."""

API_VERSIONS: tuple[tuple[SoftwareVersion, str], ...] = (
    (SoftwareVersion(10, 0), "3.0.0"),  # chosen; clients know that it lies below 3.1.4
    (SoftwareVersion(10, 12), "3.1.4"),
    (SoftwareVersion(10, 13), "3.1.6"),
    (SoftwareVersion(10, 14), "5.0.107"),
)
"""Version of the API, which clients ask for, by the first software that has it."""

ROBOT_MODE_NAMES: Mapping[RobotMode, str] = MappingProxyType(
    {mode: mode.name for mode in RobotMode} | {RobotMode.UPDATING_FIRMWARE: "UPDATING"}
)
SAFETY_MODE_NAMES: Mapping[SafetyMode, str] = MappingProxyType(
    {mode: mode.name for mode in SafetyMode}
    | {
        SafetyMode.SYSTEM_EMERGENCY_STOP: "EMERGENCY_STOP",
        SafetyMode.ROBOT_EMERGENCY_STOP: "EMERGENCY_STOP",
        SafetyMode.VIOLATION: "FAULT",
    }
)


def calls_of(version: SoftwareVersion, table: Iterable[ApiCall] = CALLS) -> tuple[ApiCall, ...]:
    """The calls of a table that software `version` knows."""
    return tuple(call for call in table if call.since <= version)


def api_version(version: SoftwareVersion) -> str:
    """The version of the API that software `version` has."""
    return [text for since, text in API_VERSIONS if since <= version][-1]


def match_call(method: str, path: str, known: Iterable[ApiCall]) -> tuple[ApiCall, str] | tuple[None, str]:
    """The call that a request is, and the argument of its path, decoded ("" without one).

    A slash at the end of the path has no meaning. Without a call: None, and the methods that the path knows,
    separated by commas; "" for a path that nothing is known of.
    """
    inner = path.removeprefix(BASE).rstrip("/") if path.startswith(f"{BASE}/") else ""
    allowed = []
    for call in known:
        argument = _argument(call.path, inner)
        if argument is None:
            continue
        if call.method == method:
            return call, argument
        allowed.append(call.method)
    return None, ", ".join(dict.fromkeys(allowed))


def _argument(pattern: str, path: str) -> str | None:
    """The argument in the place of the braces, "" where there are none; None: it is another path."""
    fixed, brace, _ = pattern.partition("{")
    if not brace:
        return "" if path == pattern else None
    rest = path.removeprefix(fixed)
    return unquote(rest) if path.startswith(fixed) and rest and "/" not in rest else None
