"""The page docs/protocol/realtime.md, made from the table of columns."""

from __future__ import annotations

from collections.abc import Iterator

from docs.generate.page_parts import MARKS, example, modes, table
from protocol.realtime.layout import COLUMNS, MAX_FRAME_SIZE, VERSIONS, RealtimeColumn, layout_for_size
from protocol.ur_types import JointMode, ProgramState, RobotMode, SafetyMode

_INTRODUCTION = """\
# Realtime interface: ports 30003 and 30013

Made from `protocol/realtime/layout.py` by `make docs`.

This is the oldest interface that reports the robot at full rate, and the simplest: a client
connects and receives a frame in every control cycle (125 a second, 500 on an e-Series), without greeting or
request.
Drivers of the first generation, data loggers and MATLAB read it. They write script lines into the
same socket ([scripts.md](scripts.md)), which sends no answer to them. Port 30013 sends the same
frames and ignores all input.

A frame is its size in bytes (a 32-bit integer, itself included) and then 64-bit floats, all
big-endian. A frame has no type and no version: only the size distinguishes them. A frame of an older
version is the beginning of a newer one. A client that does not read loses whole frames, never parts
([tested](../security.md)).
"""

_SAMPLE = (
    "byte 0: realtime frame, 1140 bytes",
    "  timestamp                    60.968 s",
    "  target_q                     [0.3944, -1.7645, -2.0996, -0.103, 1.295, 1.857] rad",
    "  target_qd                    [0, 0, 0, 0, 0, 0] rad/s",
    "  target_qdd                   [0, 0, 0, 0, 0, 0] rad/s2",
    "  ...",
)

_NOTES = """\
* The two words of digital bits travel as floats: 5.0 is bits 0 and 2.
  Three public clients read them as integers and get wrong values, as they do from a real robot.
* Modes travel as floats too: 7.0 is RUNNING.
* Gnuplot columns, as in the maker's sheets, count floats from 1.
"""


def render() -> str:
    """Return the page."""
    sizes = ((f"{v.major}.{v.minor}", size) for v, size in VERSIONS)
    return "\n".join(
        (
            _INTRODUCTION,
            "## Try it\n",
            example("python -m protocol decode realtime --live 127.0.0.1", _SAMPLE),
            "\n`decode FILE` does the same with captured bytes.\n",
            "## Sizes\n",
            *table(("from software", "bytes"), sizes),
            "\n## Columns\n",
            MARKS,
            *table(("byte", "column", "name", "floats", "unit", "origin", "meaning", "from"), _rows()),
            "",
            _NOTES,
            *modes(RobotMode, JointMode, SafetyMode, ProgramState),
        )
    )


def _rows() -> Iterator[tuple[object, ...]]:
    layout = layout_for_size(MAX_FRAME_SIZE)
    column = 1
    for row in COLUMNS:
        yield (
            layout.offset(row), column, f"`{row.name}`", row.count, row.unit, row.origin.value, row.meaning,
            _first(row),
        )  # fmt: skip
        column += row.count


def _first(row: RealtimeColumn) -> str:
    """First software of each generation whose frames hold the column."""
    firsts = (
        next((v for v, size in VERSIONS if v.major == major and size >= row.since_size), None)
        for major in (3, 5)
    )
    return " / ".join(f"{first.major}.{first.minor}" if first else "-" for first in firsts)
