"""The program that runs on the robot while we stream, filled in with our address and numbers.

The text is the file `programs/velocity_receiver.script` of the `urscript` package; it is read as a data file,
without importing that package: the client needs the text, not the language.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from pc_client.errors import DriverError

STOP_DECELERATION = 20.0
"""Of the program's ramp to rest [rad/s2]: what a UR3 does in UR's stopping figures (manual UR3/CB3 3.10, stop
category 0 from 183 deg/s, arm stretched, 3 kg: base 20, shoulder 21, elbow 35 rad/s2; a UR5's base 13)."""

MISSED_ALLOWED = 0.016
"""For so long the last velocity is repeated when we are late [s]. UR's client library waits 20 ms.

From the last command to rest, at the fastest speed that is commanded (180 deg/s, `kinematics.robot_model`),
on a CB3: 8 ms until it is read, 24 ms until the ramp begins, 157 ms ramp, and the time in which the joints
follow and the feedback shows it. On the emulated arms that makes at most 0.28 s, with the loop of `poor`
0.34 s."""

READ_TIMEOUT = 0.5
"""Silence of ours after which the program ends [s]: the arm has come to rest by then, and stays there."""

_FILE = Path("programs") / "velocity_receiver.script"
_MARKED_LINE = re.compile(r"^(?P<begin>\s+(?P<name>\w+) = )\S+(?P<end>\s+# <- client)$", re.MULTILINE)
_ADDRESS = re.compile(r"[0-9A-Za-z.:-]+")


@cache
def receiver_template() -> str:
    """The program text, whose lines to fill in end in `# <- client`.

    Raises:
        DriverError: the file is not installed.
    """
    spec = find_spec("urscript")  # finds a top-level package without running it
    for folder in (spec.submodule_search_locations or ()) if spec is not None else ():
        path = Path(folder) / _FILE
        if path.is_file():
            return path.read_text(encoding="ascii")
    raise DriverError(f"the robot's program urscript/{_FILE} is missing: install ur-hil again")


def fill_template(template: str, values: Mapping[str, str | int | float]) -> str:
    """Replace the value in every marked line.

    Raises:
        DriverError: a marked line has no value, or a value no line: program and client do not fit.
    """
    marked = [match["name"] for match in _MARKED_LINE.finditer(template)]
    if sorted(marked) != sorted(values):
        raise DriverError(
            f"the robot's program wants {', '.join(sorted(marked)) or 'nothing'} filled in, this client has "
            f"{', '.join(sorted(values))}: they are of different versions, install ur-hil again"
        )
    return _MARKED_LINE.sub(lambda line: f"{line['begin']}{values[line['name']]}{line['end']}", template)


def receiver_script(host: str, port: int, *, acceleration: float, period: float) -> str:
    """The program for the robot.

    Args:
        host: our address as the robot sees it.
        port: where we listen.
        acceleration: of `speedj`, leading axis [rad/s2].
        period: control cycle of the robot [s].

    Raises:
        DriverError: the program is not installed or does not fit this client, or that is no address.
    """
    if not _ADDRESS.fullmatch(host):  # it goes into a program: no quotes, no line breaks
        raise DriverError(f"{host!r} is no address that a robot could dial")
    values: dict[str, str | int | float] = {
        "pc_address": f'"{host}"',
        "pc_port": port,
        "acceleration": float(acceleration),
        "stop_deceleration": STOP_DECELERATION,
        "read_timeout": READ_TIMEOUT,
        "missed_allowed": round(MISSED_ALLOWED / period),
    }
    return fill_template(receiver_template(), values)
