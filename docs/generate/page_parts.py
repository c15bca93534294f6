"""What the pages docs/protocol/*.md share: tables, examples, the meaning of the marks."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from enum import IntEnum

from protocol.ur_types import ControlMode, JointMode, ProgramState, RobotMode, RobotType, SafetyMode
from protocol.wire_record import ValueOrigin

__all__ = ["MARKS", "example", "modes", "numbers", "table"]

MARKS = """\
The column *origin* says how the box obtains a value:

| mark | meaning |
|---|---|
| measured | from the simulated arm through its sensors: late, noisy, in whole steps |
| modelled | computed in the box: set points, kinematics, estimates, states |
| of this arm | from the data of its type and its calibration, constant while the box runs |
| constant | a plausible fixed value without a model |
| internal, zero | no published meaning, always 0 |

A test (`tests/ur_emulator/test_wire_agreement.py`) takes a box through all its states and checks
every mark: measured and modelled values change, the others do not.
"""
assert all(f"| {mark.value} |" in MARKS for mark in ValueOrigin)


_MODES: dict[str, type[IntEnum]] = {
    "RobotMode": RobotMode,
    "JointMode": JointMode,
    "SafetyStatus, and SafetyMode, which is 5 for all from 12 on": SafetyMode,
    "ProgramState": ProgramState,
    "ControlMode": ControlMode,
    "RobotType": RobotType,
}


def modes(*kinds: type[IntEnum]) -> Iterator[str]:
    """A section with the numbers of these modes."""
    yield "## Numbers of modes\n"
    yield "[states.md](../states.md) explains the modes.\n"
    for name, kind in _MODES.items():
        if kind in kinds:
            yield f"* {name}: {numbers(kind)}."
    yield ""


def numbers(kind: Iterable[IntEnum]) -> str:
    """All numbers with their names."""
    return ", ".join(f"{int(one)} {one.name}" for one in kind)


def table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> Iterator[str]:
    """Lines of a table; a bar in a cell stays a bar."""
    yield _line(heads)
    yield "|" + "---|" * len(heads)
    yield from map(_line, rows)


def _line(cells: Iterable[object]) -> str:
    return f"| {' | '.join(str(cell).replace('|', chr(92) + '|') for cell in cells)} |"


def example(command: str, lines: Iterable[str]) -> str:
    """A command and what it prints, as a block of code."""
    install = "The command comes with `pip install ur-hil`."
    why = "<!-- not run: values differ each time; tests/test_generated_pages.py compares the form -->"
    return "\n".join((install, "", why, "", "```console", f"$ {command}", *lines, "```"))
