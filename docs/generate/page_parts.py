"""What the pages docs/protocol/*.md share: tables, examples, the meaning of the marks."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from protocol.wire_record import ValueOrigin

__all__ = ["MARKS", "example", "table"]

MARKS = """\
Where the box takes a value from, in the column *origin*:

| mark | meaning |
|---|---|
| measured | from the simulated arm through its sensors: late, noisy, in whole steps |
| modelled | computed in the box: set-points, kinematics, estimates, states |
| of this arm | from the numbers of its type and its calibration, the same as long as the box lives |
| constant | a plausible fixed value, nothing is simulated behind it |
| internal, zero | meaning unpublished, always 0 |

A test runs a box through everything that can happen to it and holds every mark: what is measured or modelled
changes, the rest does not (`tests/ur_emulator/test_wire_origins.py`).
"""
assert all(f"| {mark.value} |" in MARKS for mark in ValueOrigin)


def table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> Iterator[str]:
    """Lines of a table; a bar in a cell stays a bar."""
    yield _line(heads)
    yield "|" + "---|" * len(heads)
    yield from map(_line, rows)


def _line(cells: Iterable[object]) -> str:
    return f"| {' | '.join(str(cell).replace('|', chr(92) + '|') for cell in cells)} |"


def example(command: str, lines: Iterable[str]) -> str:
    """A command and what it prints, as a block of code."""
    return "\n".join(("```", f"$ {command}", *lines, "```"))
