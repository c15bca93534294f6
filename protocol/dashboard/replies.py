"""What a PC reads out of the dashboard server's replies.

Every function raises `RemoteProtocolError` with the reply in it when the reply is not what was asked for.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from protocol.errors import RemoteProtocolError
from protocol.ur_types import RobotMode, SafetyMode, SoftwareVersion

__all__ = [
    "ProgramStateReply",
    "parse_polyscope_version",
    "parse_program_state",
    "parse_robot_mode",
    "parse_running",
    "parse_safety_mode",
]


class ProgramStateReply(NamedTuple):
    """`state` is STOPPED, PLAYING or PAUSED; `program` is "" where the robot names none."""

    state: str
    program: str


_VERSION = re.compile(r"(\d+\.\d+\.\d+(?:\.\d+)?)")
_PROGRAM_STATE = re.compile(r"(STOPPED|PLAYING|PAUSED)(?: (.*))?")


def parse_polyscope_version(reply: str) -> SoftwareVersion:
    """Version in the reply to `PolyscopeVersion`, such as `URSoftware 3.15.8.106339 (Nov 10 2021)`."""
    match = _VERSION.search(reply)
    if not match:
        raise RemoteProtocolError(f"no software version in the reply {reply!r}")
    return SoftwareVersion.parse(match[1])


def parse_robot_mode(reply: str) -> RobotMode:
    """Mode in the reply to `robotmode`, such as `Robotmode: RUNNING`."""
    name = _after(reply, "Robotmode:")
    if name not in RobotMode.__members__:
        raise RemoteProtocolError(f"unknown robot mode in the reply {reply!r}")
    return RobotMode[name]


def parse_safety_mode(reply: str) -> SafetyMode:
    """Mode in the reply to `safetymode`, such as `Safetymode: NORMAL`."""
    name = _after(reply, "Safetymode:")
    if name not in SafetyMode.__members__:
        raise RemoteProtocolError(f"unknown safety mode in the reply {reply!r}")
    return SafetyMode[name]


def parse_running(reply: str) -> bool:
    """Answer of `running`; old software says `Robot running: True`, newer `Program running: true`."""
    _, separator, word = reply.lower().partition("running:")
    if not separator or word.strip() not in ("true", "false"):
        raise RemoteProtocolError(f"neither true nor false in the reply {reply!r}")
    return word.strip() == "true"


def parse_program_state(reply: str) -> ProgramStateReply:
    """Answer of `programState`, such as `PLAYING wait_program.urp`; a bare state names no program."""
    match = _PROGRAM_STATE.fullmatch(reply.strip())
    if not match:
        raise RemoteProtocolError(f"no program state in the reply {reply!r}")
    return ProgramStateReply(match[1], match[2] or "")


def _after(reply: str, label: str) -> str:
    head, separator, rest = reply.partition(label)
    if not separator or head.strip():
        raise RemoteProtocolError(f"the reply {reply!r} does not begin with {label!r}")
    return rest.strip()
