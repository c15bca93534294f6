"""`make attack`: attack boxes of all kinds in every way, one after the other; results.json is for `make docs`.

python tests/attack                             # everything, a quarter of an hour
python tests/attack "unread log"                # these attacks; the others keep their last figures
python tests/attack --box rack                  # on boxes of this kind
python tests/attack --repeat 30 "unread log"    # on one box again and again: its memory after each, nothing written
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from attack_record import Attack, attacked, served, watched
from attack_table import SECTIONS, described
from box_under_attack import KINDS, Kind, Seen

sys.path.append(str(Path(__file__).parents[2]))
from bench.origin import origin

RESULTS = Path(__file__).with_name("results.json")
# How long an attack lasts [s]; the first kind of box has all of them, the others those that depend on the kind.
SECONDS, SECONDS_OF_OTHERS = 4.0, 1.0
# Growth over the last repetitions that is allowed [1], and how many these are.
_GROWTH, _LAST = 0.03, 10
_REST = 0.5  # s; after an attack, until its memory is measured


def main(names: Iterable[str], kinds: Iterable[str], seconds: float, out: Path) -> None:
    """Attack boxes of these kinds in these ways, the first kind for so long each; write the figures."""
    told = json.loads(out.read_text()) if out.exists() else {}
    figures: dict[str, dict[str, Any]] = told.get("figures", {})
    share = seconds / SECONDS
    runs = [(KINDS[kind], ATTACKS[name]) for kind in kinds for name in names if kind in ATTACKS[name].kinds]
    for number, (kind, attack) in enumerate(runs, 1):
        figures.setdefault(kind.name, {})[attack.name] = row = _row(attack, kind, share)
        _show(f"{number}/{len(runs)} {kind.name}: {attack.name}", row)
        result = {
            **origin(),
            "seconds": [share * SECONDS, share * SECONDS_OF_OTHERS],
            "attacks": described(),
            # In the order of the tables, without attacks that are gone.
            "figures": {
                name: {key: figures[name][key] for key in ATTACKS if key in figures[name]}
                for name in KINDS
                if name in figures
            },
        }
        out.write_text(json.dumps(result, indent=1) + "\n")
    print(f"written to {out}")


def _row(attack: Attack, kind: Kind, share: float) -> dict[str, Any]:
    seconds = SECONDS if kind.name == next(iter(KINDS)) else SECONDS_OF_OTHERS
    outcome = watched(attack, kind, share * seconds)
    return {
        **{name: round(value, 3) for name, value in asdict(outcome.seen).items()},
        "stop_s": round(outcome.stop_s, 2) if math.isfinite(outcome.stop_s) else None,
        "remark": outcome.remark,
        "problems": list(outcome.problems),
    }


def _show(title: str, row: dict[str, Any]) -> None:
    gaps = f"gap {row['gap_ms']:.0f} ms (timer {row['timer_gap_ms']:.0f})"
    memory = f"{row['box_mb']:.0f} + {row['worker_mb']:.0f} MB"
    print(f"{title}: rate {row['rate']:.3f}, {gaps}, lost {row['lost']}, {memory}", row["remark"], flush=True)
    for problem in row["problems"]:
        print(f"  {problem}", flush=True)


def repeat(attack: Attack, kind: Kind, times: int, seconds: float, growth: float) -> str:
    """Attack one box again and again; return what is wrong: a growing memory, or a problem."""
    held: list[float] = []
    with served(attack, kind) as box:
        for number in range(1, times + 1):
            problems = attacked(attack, box, seconds / SECONDS * SECONDS_OF_OTHERS).problems
            if problems:
                return f"{attack.name}, repetition {number}: {'; '.join(problems)}"
            time.sleep(_REST)
            now = Seen()
            now.look(box.process.pid)
            held.append(now.memory_mb)
            parts = f"{now.box_mb:.1f} + {now.worker_mb:.1f} MB"
            print(f"{kind.name}: {attack.name}, repetition {number}: {parts}", flush=True)
    # The box gives memory back now and then: the highest of each half says whether it grows.
    last = held[-_LAST:]
    share = max(last[_LAST // 2 :]) / max(last[: _LAST // 2]) - 1.0
    print(f"{attack.name}: {share:+.1%} over the last {_LAST} repetitions")
    return "" if share <= growth else f"{attack.name}: memory grows by {share:.1%}, more than {growth:.0%}"


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("attacks", nargs="*", metavar="ATTACK", help="all, if none is given")
    parser.add_argument("--box", action="append", choices=KINDS, help="kind of box; all, if none is given")
    parser.add_argument(
        "--seconds", type=float, default=SECONDS, help="of an attack on the first kind of box"
    )
    parser.add_argument("--out", type=Path, default=RESULTS, metavar="FILE", help="for the figures")
    parser.add_argument("--repeat", type=int, metavar="N", help=f"times, at least {_LAST}")
    parser.add_argument("--growth", type=float, default=_GROWTH, metavar="SHARE", help="that --repeat allows")
    given = parser.parse_args()
    if unknown := set(given.attacks) - set(ATTACKS):
        sys.exit(f"attack: {', '.join(sorted(unknown))} given: choose of {', '.join(ATTACKS)}")
    if given.repeat is not None and given.repeat < _LAST:
        sys.exit(
            f"attack: --repeat {given.repeat} given: the last {_LAST} are compared: give {_LAST} or more"
        )
    return given


ATTACKS = {attack.name: attack for section in SECTIONS for attack in section.attacks}
if __name__ == "__main__":
    given = _arguments()
    if given.repeat is None:
        main(given.attacks or ATTACKS, given.box or KINDS, given.seconds, given.out)
    else:
        found = [
            repeat(ATTACKS[name], KINDS[kind], given.repeat, given.seconds, given.growth)
            for name in given.attacks or ATTACKS
            for kind in given.box or ATTACKS[name].kinds[:1]
            if kind in ATTACKS[name].kinds
        ]
        sys.exit("\n".join(filter(None, found)))
