"""A fuzz campaign: `python tests/fuzz/campaign.py --cases N --seed S`; a box lives for some thousand cases.

A failure names the seed of its box; `--only` runs that box again, step by step the same.
"""

import argparse
import random
import resource
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "ur_emulator"))

from dashboard_support import write_programs
from fuzz_box import run

# Kinds of boxes, one after the other: most cases between few cycles, some with time for programs and stops.
BOXES = (
    (4000, {"lively": False}),
    (20_000, {"lively": False, "cycle_share": 0.015}),
    (4000, {"lively": True}),
    (20_000, {"lively": True, "cycle_share": 0.015}),
)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int, help="seed of a single box")
    parser.add_argument("--minutes", type=float, default=1e9)
    parser.add_argument("--keep-on", action="store_true", help="go on after a failure")
    options = parser.parse_args()
    cases, n_failures, started = Counter(), 0, time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        folder = write_programs(Path(name))
        for seed in [options.only] if options.only is not None else range(options.seed, options.seed + 10**9):
            if cases.total() >= options.cases or time.monotonic() - started > options.minutes * 60:
                break
            try:
                n_cases, kind = BOXES[seed % len(BOXES)]
                cases += run(random.Random(seed), folder, n_cases, **kind)
            except Exception:
                n_failures += 1
                print(f"box {seed} failed:\n{traceback.format_exc()}", flush=True)
                if not options.keep_on:
                    break
            if seed % 4 == 3:
                memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
                took = time.monotonic() - started
                print(f"{seed}: {cases.total()} cases, {took:.0f} s, {memory} MB at most", flush=True)
    print(f"{cases.total()} cases in {time.monotonic() - started:.0f} s, {n_failures} failures")
    for port, count in sorted(cases.items()):
        print(f"  {port:13}{count:9}")
    return n_failures > 0


if __name__ == "__main__":
    sys.exit(main())
