"""`make soak`: a served box in real time under mixed load, attacked every minute; one hour, or SOAK_MINUTES; SOAK_BOX is its kind, CB3 or another.
Less than a minute is one short round.

The load is that of `bench/clients.py`: fifty RTDE clients and fifty readers of port 30003. They and a timer that has
nothing to do with the box join anew every minute. The attacks are those of the table that need no box of their own;
attackers have addresses of their own. Writes out/soak/soak.json and out/soak/soak.png.
"""

from __future__ import annotations

import json
import os
import random
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import psutil

sys.path.append(str(Path(__file__).parents[2]))

from attack_record import Attack
from attack_table import SECTIONS
from box_under_attack import KINDS, BoxUnderAttack, Kind, serving
from rich.console import Console

from bench.clients import N_REALTIME, N_RTDE
from bench.side_process import SideProcesses

FOLDER = Path("out") / "soak"
# Of a round [s]: all of it, until its attack begins, of the attack, and after it until the box is at rest.
ROUND, BEFORE, ATTACK, AFTER = 60.0, 10.0, 8.0, 15.0
_SAMPLE_EVERY = 10.0  # s
# This share of the time belongs to the warm-up; at most so long [s].
_WARM_UP, _LONGEST_WARM_UP = 0.2, 600.0
_JOINING = 5.0  # s; what a round needs to begin and to end


class Sampler(threading.Thread):
    """Looks every ten seconds at what the box holds: memory [MB], descriptors, threads, at rest or not."""

    def __init__(self, box: BoxUnderAttack) -> None:
        super().__init__(daemon=True)
        self.samples: list[dict[str, Any]] = []
        self.began = time.monotonic()
        self.is_attacked = False
        self._attacked_at = self.began
        self._process = psutil.Process(box.process.pid)
        self._ended = threading.Event()

    def run(self) -> None:
        while not self._ended.wait(0.5):
            now = time.monotonic()
            if self.is_attacked:
                self._attacked_at = now
            if now - self.began >= len(self.samples) * _SAMPLE_EVERY:
                self.samples.append(self._look(now))

    def end(self) -> None:
        self._ended.set()
        self.join()

    def _look(self, now: float) -> dict[str, Any]:
        workers = 0
        for child in self._process.children(recursive=True):
            with suppress(psutil.NoSuchProcess):
                workers += child.memory_info().rss
        return {
            "t": round(now - self.began, 1),
            "box_mb": round(self._process.memory_info().rss / 1e6, 2),
            "workers_mb": round(workers / 1e6, 2),
            "descriptors": self._process.num_fds(),
            "threads": self._process.num_threads(),
            "at_rest": now - self._attacked_at > AFTER,
        }


def soak(minutes: float, kind: Kind) -> dict[str, Any]:
    """Run for so long; return the figures, the rounds and the samples."""
    attacks = [
        attack
        for section in SECTIONS
        for attack in section.attacks
        if kind.name in attack.kinds and not attack.unread_log
    ]
    random.Random(1).shuffle(attacks)
    console = Console(width=160)
    rounds: list[dict[str, Any]] = []
    share = min(minutes, 1.0)
    with serving(kind) as box:
        sampler = Sampler(box)
        sampler.start()
        while box.process.poll() is None and time.monotonic() - sampler.began < 60.0 * minutes:
            rounds.append(_round(box, sampler, attacks[len(rounds) % len(attacks)], share))
            console.print(f"{len(rounds)}: {rounds[-1]}, {sampler.samples[-1]['box_mb']} MB")
        sampler.end()
        problems = box.problems()
        stop_s = box.stop()
    figures = _figures(rounds, sampler.samples, box.period)
    figures |= {
        "problems": [*(p for r in rounds for p in r["problems"]), *problems],
        "stop_s": round(stop_s, 2),
    }
    return {"figures": figures, "rounds": rounds, "samples": sampler.samples}


def _round(box: BoxUnderAttack, sampler: Sampler, attack: Attack, share: float) -> dict[str, Any]:
    """Let the load join, attack, wait for the load to end: all of a round, or a share of its times."""
    clients = [(box.host, box.ports.rtde, "rtde")] * N_RTDE
    clients += [(box.host, box.ports.realtime, "realtime")] * N_REALTIME
    beside = SideProcesses(share * (ROUND - _JOINING), box.period, clients)
    time.sleep(share * BEFORE)
    problems = []
    sampler.is_attacked = True
    try:
        attack.run(box, share * ATTACK)
    except (AssertionError, OSError, EOFError) as error:
        problems.append(f"{attack.name}: {error or type(error).__name__}")
    sampler.is_attacked = False
    seen = beside.wait()
    return {
        "attack": attack.name,
        "lost": max(seen.lost),
        "late_p999_ms": round(seen.late_us[2] / 1e3, 2),
        "late_max_ms": round(seen.late_us[3] / 1e3, 2),
        "timer_p999_ms": round(seen.timer_us[0] / 1e3, 2),
        "timer_max_ms": round(seen.timer_us[1] / 1e3, 2),
        "problems": problems,
    }


def _figures(rounds: list[dict[str, Any]], samples: list[dict[str, Any]], period: float) -> dict[str, Any]:
    warm = min(_LONGEST_WARM_UP, _WARM_UP * samples[-1]["t"])
    rest = [sample for sample in samples if sample["at_rest"] and sample["t"] >= warm]
    rss = [sample["box_mb"] for sample in rest]
    slope = np.polyfit([sample["t"] / 3600.0 for sample in rest], rss, 1)[0] if len(rest) > 2 else None
    held = {name: [sample[name] for sample in rest] for name in ("descriptors", "threads")}
    return {
        "seconds": samples[-1]["t"],
        "attacks": len(rounds),
        "lost_cycles": sum(one["lost"] for one in rounds),
        "timer_late_by_cycles": sum(int(one["timer_max_ms"] / (1e3 * period)) for one in rounds),
        "late_max_ms": max(one["late_max_ms"] for one in rounds),
        "timer_max_ms": max(one["timer_max_ms"] for one in rounds),
        "rss_first_mb": rss[0] if rss else None,
        "rss_last_mb": rss[-1] if rss else None,
        "rss_max_mb": max(sample["box_mb"] for sample in samples),
        "rss_slope_mb_per_hour": None if slope is None else round(float(slope), 2),
        "workers_max_mb": max(sample["workers_mb"] for sample in samples),
        # First, last, most.
        **{name: [n[0], n[-1], max(n)] if n else [] for name, n in held.items()},
    }


def draw(outcome: dict[str, Any], path: Path) -> None:
    """Draw memory, and the lateness of each round beside that of the timer, over time."""
    matplotlib.use("Agg")
    from matplotlib import pyplot

    samples, rounds = outcome["samples"], outcome["rounds"]
    figure, (upper, lower) = pyplot.subplots(2, 1, figsize=(10, 6), sharex=True, layout="constrained")
    minutes = [sample["t"] / 60.0 for sample in samples]
    upper.plot(minutes, [sample["box_mb"] for sample in samples], label="box")
    upper.plot(minutes, [sample["workers_mb"] for sample in samples], label="worker processes")
    upper.set_ylabel("memory [MB]")
    ends = (np.arange(len(rounds)) + 0.5) * ROUND / 60.0
    for name, label in (("late_max_ms", "frames, 100 clients"), ("timer_max_ms", "timer without a box")):
        lower.plot(ends, [one[name] for one in rounds], "o-", label=label)
    lower.set(xlabel="time [min]", ylabel="latest of a minute [ms]", yscale="log")
    for axes in (upper, lower):
        axes.legend()
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    result = soak(float(os.environ.get("SOAK_MINUTES", "60")), KINDS[os.environ.get("SOAK_BOX", "CB3")])
    FOLDER.mkdir(parents=True, exist_ok=True)
    (FOLDER / "soak.json").write_text(json.dumps(result, indent=1) + "\n")
    draw(result, FOLDER / "soak.png")
    print(json.dumps(result["figures"], indent=1))
    print(f"written to {FOLDER}")
    sys.exit(bool(result["figures"]["problems"]))
