"""A fuzz campaign: `python tests/fuzz/campaign.py [TARGET ...] --cases N --minutes M --seed S`.

Targets take turns: `box` is a whole box under fire, which lives for some thousand cases; the others read files and
answers (see fuzz_files.py). A failure of a box names its seed; `box --only SEED` runs it again, step by step the same.
What has failed in a reader is written to out/fuzz/; once it is mended it belongs into the corpus.
"""

import argparse
import random
import resource
import sys
import tempfile
import time
import traceback
from collections import Counter
from itertools import count
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "ur_emulator"))
sys.path.insert(0, str(Path(__file__).parents[1] / "pc_client"))

from dashboard_support import write_programs
from fuzz_box import CB3, E_SERIES, POLYSCOPE_X, run
from fuzz_files import TARGETS, run_cases

# Boxes, one after the other: most cases between few cycles, some with time for programs and stops.
BOXES = tuple(
    (n_cases, {"lively": lively, "cycle_share": cycle_share, "kind": kind})
    for lively in (False, True)
    for n_cases, cycle_share in ((4000, 0.1), (20_000, 0.015))
    for kind in (CB3, E_SERIES, POLYSCOPE_X)
)
# Cases of a reader until the next target has its turn.
_BATCH = 2000
FOUND = Path("out") / "fuzz"


def box_round(seed):
    """Fuzz a box; return its cases by port, and the number of failures."""
    n_cases, options = BOXES[seed % len(BOXES)]
    with tempfile.TemporaryDirectory() as folder:
        try:
            return run(random.Random(seed), write_programs(Path(folder)), n_cases, **options), 0
        except Exception:
            print(f"box {seed} failed:\n{traceback.format_exc()}", flush=True)
            return Counter(box=1), 1


def reader_round(name, seed):
    """Let a reader read a batch; return its cases, and the number of failures."""
    n_failures = 0
    for number, data, error in run_cases(name, TARGETS[name], seed, range(_BATCH)):
        n_failures += 1
        path = FOUND / name / f"{seed}_{number}"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        lines = traceback.format_exception(error)
        print(f"{name} failed on {path} ({len(data)} bytes):\n{''.join(lines)[-3000:]}", flush=True)
    return Counter({name: _BATCH}), n_failures


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    names = ("box", *TARGETS)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=f"{', '.join(names)}; without one: all")
    parser.add_argument("--cases", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int, help="seed of a single round")
    parser.add_argument("--minutes", type=float, default=1e9)
    parser.add_argument("--keep-on", action="store_true", help="go on after a failure")
    options = parser.parse_args()
    targets = options.targets or names
    if unknown := set(targets) - set(names):
        parser.error(f"{', '.join(unknown)}: choose of {', '.join(names)}")
    cases, n_failures, started = Counter(), 0, time.monotonic()
    for seed in [options.only] if options.only is not None else count(options.seed):
        for name in targets:
            if n_failures and not options.keep_on:
                break
            some, failures = box_round(seed) if name == "box" else reader_round(name, seed)
            cases += some
            n_failures += failures
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
        took = time.monotonic() - started
        print(f"{seed}: {cases.total()} cases, {took:.0f} s, {memory} MB at most", flush=True)
        if (
            cases.total() >= options.cases
            or took > options.minutes * 60
            or (n_failures and not options.keep_on)
        ):
            break
    print(f"{cases.total()} cases in {time.monotonic() - started:.0f} s, {n_failures} failures")
    for target, number in sorted(cases.items()):
        print(f"  {target:13}{number:9}")
    return n_failures > 0


if __name__ == "__main__":
    sys.exit(main())
