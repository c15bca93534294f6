"""`make walk`: random walks over boxes of all kinds; one that breaks a rule is shortened and shown.

python tests/walk                              # ten thousand steps on boxes of all kinds, new seeds
python tests/walk --seed 5 --box "CB3 3.15"    # one walk again
python tests/walk --seed 5 --box X --show      # step by step
"""

import argparse
import secrets
import sys
import time

from walk import make_walk, shrink, walk
from walk_box import KINDS

LENGTH = 120


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, help="of the only walk, or of the first")
    parser.add_argument("--steps", type=int, default=10_000, help="of all walks together")
    parser.add_argument("--length", type=int, default=LENGTH, help="steps of a walk")
    parser.add_argument("--box", choices=KINDS, help="kind of box; all in turn, if none is given")
    parser.add_argument("--show", action="store_true", help="each step")
    parser.add_argument("--no-shrink", action="store_true", help="leave a walk that breaks a rule as it is")
    given = parser.parse_args()
    seed = secrets.randbelow(1_000_000) if given.seed is None else given.seed
    one = given.seed is not None and given.box is not None and given.steps == 10_000
    kinds = [given.box] if given.box else list(KINDS)
    walked = number = 0
    found = 0
    begin = time.monotonic()
    while walked < (given.length if one else given.steps):
        kind = kinds[number % len(kinds)]
        made = make_walk(kind, seed + number // len(kinds), given.length)
        broken = walk(made, print if given.show else lambda text: None)
        walked += len(made.steps)
        number += 1
        print(
            f"{kind}, seed {made.seed}: {len(made.steps)} steps, {walked} in {time.monotonic() - begin:.0f} s",
            flush=True,
        )
        if broken is not None:
            found += 1
            index, error = broken
            print(f"FOUND in step {index}, {made.steps[index]}: {error!r}", flush=True)
            if not given.no_shrink:
                short = shrink(
                    made.__class__(made.kind, made.seed, made.files, made.steps[: index + 1]), error, print
                )
                for step in short.steps:
                    print("  ", step)
                    for argument in step.arguments:
                        if isinstance(argument, str) and "\n" in argument:
                            print(argument)
                for number_, text in enumerate(short.files):
                    if any(s.action == "load" and s.arguments == (number_,) for s in short.steps):
                        print(f"walk{number_}:\n{text}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
