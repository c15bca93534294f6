"""`make attack`: attack a box in every way, one after the other, and write results.json, which `make docs` reads.

python tests/attack                  # everything, a quarter of an hour
python tests/attack "unread log"     # these attacks; the others keep their last figures
python tests/attack --robot ur5e     # the same on another arm, into out/attack/ur5e.json
"""

import argparse
import json
import math
import os
import platform
import sys
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

from attack_record import watched
from attack_table import SECTIONS
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

# The arm of the page, and where its figures are; those of others have no page.
ROBOT, RESULTS = "ur3", Path(__file__).with_name("results.json")
OTHERS = Path("out") / "attack"
SECONDS = 5.0


def main(names, robot):
    """Run these attacks, or all, on a box with this arm."""
    results = RESULTS if robot == ROBOT else OTHERS / f"{robot}.json"
    attacks = {attack.name: (section, attack) for section in SECTIONS for attack in section.attacks}
    if unknown := set(names) - set(attacks):
        sys.exit(f"attack: {', '.join(sorted(unknown))} given: choose of {', '.join(attacks)}")
    rows = {}
    if names and results.exists():
        rows = {row["name"]: row for row in json.loads(results.read_text())["attacks"]}
    console = Console(width=160)
    with Progress(console=console) as progress:
        task = progress.add_task("attacks", total=len(names or attacks))
        for name in names or attacks:
            progress.update(task, description=name)
            rows[name] = _row(*attacks[name], robot)
            _show(console, rows[name])
            progress.advance(task)
    machine = f"{os.cpu_count()} cores, {platform.system()} {platform.release()}, Python {platform.python_version()}"
    result = {
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "machine": machine,
        "seconds": SECONDS,
        "attacks": [rows[name] for name in attacks if name in rows],
    }
    results.parent.mkdir(parents=True, exist_ok=True)
    results.write_text(json.dumps(result, indent=1) + "\n")
    console.print(f"written to {results}")


def _row(section, attack, robot):
    outcome = watched(attack, robot, SECONDS)
    figures = {name: round(value, 3) for name, value in asdict(outcome.seen).items()}
    return {
        "name": attack.name,
        "section": section.title,
        "what": attack.what,
        "limit": attack.limit,
        **figures,
        "stop_s": round(outcome.stop_s, 2) if math.isfinite(outcome.stop_s) else None,
        "remark": outcome.remark,
        "problems": list(outcome.problems),
    }


def _show(console, row):
    table = Table.grid(padding=(0, 2))
    table.add_row(
        row["name"],
        f"rate {row['rate']:.3f}",
        f"gap {row['gap_ms']:.0f} ms (timer {row['timer_gap_ms']:.0f})",
        f"lost {row['lost']}",
        f"{row['box_mb']:.0f} + {row['worker_mb']:.0f} MB",
        f"stop {row['stop_s']} s",
        row["remark"],
    )
    console.print(table)
    for problem in row["problems"]:
        console.print(f"  [red]{problem}")


parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("attacks", nargs="*", metavar="ATTACK")
parser.add_argument("--robot", default=ROBOT)
given = parser.parse_args()
main(given.attacks, given.robot)
