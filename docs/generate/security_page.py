"""The page docs/security.md: attacks on a box and their results (`make attack` measures)."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docs.generate.page_parts import table

RESULTS = Path(__file__).parents[2] / "tests" / "attack" / "results.json"
# What is asked of the stream of a client that has nothing to do with the attack, on an idle machine.
LEAST_RATE, LONGEST_GAP = 0.99, 20.0  # robot time per real time; ms
_HEADS = ("attack", "what stops it", "rate", "gap (timer)", "lost", "memory", "end")

_INTRODUCTION = """\
# Attacks on the box

Made from `tests/attack/results.json`, which `make attack` writes, and
`docs/generate/security_page.py` by `make docs`. [SECURITY.md](../SECURITY.md) says what each port
allows, and lists all limits.

Each attack has its own box: `ur-emulator serve` in real time, in its own process, on a loopback
address, with a folder of programs and the control API. The attack is another process; it lasts
about {seconds:g} s and is bounded in bytes and clients. Two more processes run beside it: a client
of port 30003 that is not part of the attack, and a bare timer that wakes up every 8 ms. Afterwards
the box must answer its dashboard, run a script that moves a joint, have no more descriptors and
threads than before, have stayed below 300 MB together with its worker process, and end on SIGTERM.
`make test` runs a short set of the attacks; it asserts all of this, but no rate and no gap, because
these depend on the load of the machine.

| column | is |
|---|---|
| rate | robot time per real time at the client of 30003; required: at least {rate:g} |
| gap (timer) | longest time between two of its frames, longest time between two wake-ups of the timer [ms]; required: at most {gap:g} if the timer has less |
| lost | cycles without a frame at this client |
| memory | peak memory of the box and its worker process [MB] |
| end | from SIGTERM to the end of the process [s] |

Measured on {date}: {machine}. The attackers use the same processors as the box; the gaps of the
timer show how much.
"""  # noqa: E501 - a row of a table


def render() -> str:
    """Return the page."""
    found = json.loads(RESULTS.read_text())
    rows = found["attacks"]
    lines = [
        _INTRODUCTION.format(
            seconds=found["seconds"],
            rate=LEAST_RATE,
            gap=LONGEST_GAP,
            date=found["date"],
            machine=found["machine"],
        ),
        "## Missed figures\n",
        *(_shortcomings(rows) or ["All attacks were withstood within the required figures."]),
        "",
    ]
    for title in dict.fromkeys(row["section"] for row in rows):
        of_section = [row for row in rows if row["section"] == title]
        lines += [f"## {title}\n", *table(_HEADS, map(_cells, of_section)), ""]
    return "\n".join(lines)


def _shortcomings(rows: list[dict[str, Any]]) -> list[str]:
    """Return a line for each attack with a problem or a figure that is missed."""
    found = [(row["name"], list(_shortcomings_of(row))) for row in rows]
    return [f"- **{name}**: {'; '.join(problems)}." for name, problems in found if problems]


def _shortcomings_of(row: dict[str, Any]) -> Iterator[str]:
    yield from row["problems"]
    if row["rate"] < LEAST_RATE:
        yield f"rate {row['rate']:.3f}"
    if row["gap_ms"] > LONGEST_GAP:
        host = f"the timer had {row['timer_gap_ms']:.0f} ms"
        yield f"a gap of {row['gap_ms']:.0f} ms ({host})"


def _cells(row: dict[str, Any]) -> tuple[object, ...]:
    remark = f" ({row['remark']})" if row["remark"] else ""
    return (
        f"**{row['name']}**: {row['what']}{remark}",
        row["limit"],
        f"{row['rate']:.3f}",
        f"{row['gap_ms']:.0f} ({row['timer_gap_ms']:.0f})",
        row["lost"],
        f"{row['box_mb']:.0f} + {row['worker_mb']:.0f}",
        "killed" if row["stop_s"] is None else f"{row['stop_s']:.2f}",
    )
