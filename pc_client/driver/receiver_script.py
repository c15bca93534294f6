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

_FILE = Path("programs") / "velocity_receiver.script"
_MARK = re.compile(r"\{\{\s*(\w+)\s*\}\}")


@cache
def receiver_template() -> str:
    """The program text with its marks, `{{NAME}}`.

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
    """Replace every mark by its value.

    Raises:
        DriverError: a mark has no value, or a value has no mark: program and client do not fit.
    """
    marks = set(_MARK.findall(template))
    if marks != set(values):
        raise DriverError(
            f"the robot's program has the marks {sorted(marks)}, this client fills in {sorted(values)}: "
            "they are of different versions, install ur-hil again"
        )
    text = _MARK.sub(lambda match: str(values[match[1]]), template)
    return text if text.endswith("\n") else text + "\n"


def receiver_script(host: str, port: int, *, acceleration: float) -> str:
    """The program for the robot.

    Args:
        host: our address as the robot sees it.
        port: where we listen.
        acceleration: of `speedj`, leading axis [rad/s2].

    Raises:
        DriverError: the program is not installed or does not fit this client.
    """
    return fill_template(receiver_template(), {"HOST": host, "PORT": port, "ACCELERATION": acceleration})
