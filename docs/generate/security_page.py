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
_HEADS = ("attack", "rate", "gap (timer)", "lost", "memory", "end")
_BOXES = {
    "CB3": "UR3, software 3.15.8",
    "e-Series": "UR5e, software 5.25.1, with two grippers",
    "PolyScope X": "UR5e, software 10.14.0, with the services primary and rtde",
    "oldest": "UR3, software 3.0.0, the oldest",
    "rack": "three UR3 in one process; one is attacked, the client reads from another",
}

_INTRODUCTION = """\
# Attacks on the box

Made from `tests/attack/results.json`, which `make attack` writes, and
`docs/generate/security_page.py` by `make docs`. [SECURITY.md](../SECURITY.md) says what each port
allows, and lists all limits.

Each attack has its own box: `ur-emulator serve` in real time, in its own process, on a loopback
address, with a folder of programs and the control API. The attack is another process, whose clients
have four addresses of 127/8; it lasts about {first:g} s on a CB3 and {others:g} s on the other boxes,
and is bounded in bytes and clients. Two more processes run beside it: a client of port 30003 that is
not part of the attack, and a bare timer that wakes up every control cycle. Afterwards the box must
answer its dashboard, be in the same modes, run a script that moves a joint, have no more
descriptors and threads than before, have stayed below 300 MB together with its worker processes, and
end on SIGTERM. `make test` runs a short set of the attacks on one box; it asserts all of this and
that the client misses no cycle, but no rate and no gap, because these depend on the load of the
machine. `python tests/attack --repeat 30 NAME` attacks one box again and again, and fails if its
memory grows over the last ten times.

| column | is |
|---|---|
| rate | robot time per real time at the client of 30003; required: at least {rate:g} |
| gap (timer) | longest time between two of its frames, longest time between two wake-ups of the timer [ms]; required: at most {gap:g} if the timer has less |
| lost | cycles without a frame at this client; required: 0 |
| memory | most memory of the box, and of its worker processes [MB]; pages that processes have in common are shared between them (PSS) |
| end | from SIGTERM to the end of the process [s] |

Measured on {date}: {machine}. The attackers use the same processors as the box; the gaps of the
timer show how much.
"""  # noqa: E501 - a row of a table


def render() -> str:
    """Return the page."""
    found = json.loads(RESULTS.read_text())
    attacks, figures = found["attacks"], found["figures"]
    first, others = found["seconds"]
    lines = [
        _INTRODUCTION.format(
            first=first,
            others=others,
            rate=LEAST_RATE,
            gap=LONGEST_GAP,
            date=found["date"],
            machine=found["machine"],
        ),
        "## Missed figures\n",
        *(_shortcomings(attacks, figures) or ["All attacks were withstood within the required figures."]),
        "",
    ]
    for title in dict.fromkeys(attack["section"] for attack in attacks):
        of_section = [attack for attack in attacks if attack["section"] == title]
        rows = [(f"**{one['name']}**: {one['what']}", one["limit"], _boxes(one)) for one in of_section]
        lines += [f"## {title}\n", *table(("attack", "what stops it", "boxes"), rows), ""]
    for box, title in _BOXES.items():
        cells = [_cells(name, row) for name, row in figures.get(box, {}).items()]
        lines += [
            f"## Figures: {box}\n",
            f"{title}.\n",
            *(table(_HEADS, cells) if cells else ["Not measured."]),
            "",
        ]
    return "\n".join(lines)


def _boxes(attack: dict[str, Any]) -> str:
    return "all" if len(attack["boxes"]) == len(_BOXES) else ", ".join(attack["boxes"])


def _shortcomings(attacks: list[dict[str, Any]], figures: dict[str, dict[str, Any]]) -> list[str]:
    """Return a line for each attack with a problem or a missed figure, and for each box without some."""
    found = []
    for box in _BOXES:
        of_box = figures.get(box, {})
        for name, row in of_box.items():
            if problems := list(_shortcomings_of(row)):
                found.append(f"- {box}, **{name}**: {'; '.join(problems)}.")
        names = [one["name"] for one in attacks if box in one["boxes"]]
        if missing := [name for name in names if name not in of_box]:
            found.append(f"- {box}: not measured: {', '.join(missing)}.")
    return found


def _shortcomings_of(row: dict[str, Any]) -> Iterator[str]:
    yield from row["problems"]
    if row["rate"] < LEAST_RATE:
        yield f"rate {row['rate']:.3f}"
    if row["gap_ms"] > LONGEST_GAP:
        yield f"a gap of {row['gap_ms']:.0f} ms (the timer had {row['timer_gap_ms']:.0f} ms)"


def _cells(name: str, row: dict[str, Any]) -> tuple[object, ...]:
    return (
        f"{name} ({row['remark']})" if row["remark"] else name,
        f"{row['rate']:.3f}",
        f"{row['gap_ms']:.0f} ({row['timer_gap_ms']:.0f})",
        row["lost"],
        f"{row['box_mb']:.0f} + {row['worker_mb']:.0f}",
        "killed" if row["stop_s"] is None else f"{row['stop_s']:.2f}",
    )
