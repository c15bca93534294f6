"""`make bench`: measure, print, write bench/results.json. BENCH_MINUTES shortens the parts in real time.

python -m bench                      # everything, into bench/results.json
python -m bench tick lockstep        # these measurements; nothing is written without --out
python -m bench lockstep_cycle_us    # the measurement that this figure is asked of
python -m bench --short              # as little as shows that everything runs; its figures mean nothing
"""

import argparse
import json
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from bench.length import FULL, SHORT, Length
from bench.measurements import ASKED, MEASUREMENTS
from bench.origin import origin

RESULTS = Path(__file__).with_name("results.json")


def measure(names: list[str], length: Length) -> dict[str, float]:
    """Take these measurements, or all; print their figures beside what is asked of them."""
    results: dict[str, float] = {}
    table = Table("figure", "measured", "asked")
    for name in dict.fromkeys(map(_measurement_of, names or MEASUREMENTS)):
        found = MEASUREMENTS[name](length)
        results |= found
        for figure, value in found.items():
            sign, bound = ASKED.get(name, {}).get(figure, ("", None))
            table.add_row(figure, f"{value:.4g}", f"{sign} {bound:g}" if bound is not None else "")
    Console().print(table)
    return results


def main(words: list[str]) -> None:
    """Do what the command line says; a file has the figures of one run, and says where they come from."""
    parser = argparse.ArgumentParser(
        prog="bench", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help="measurements or figures; all, if none is given"
    )
    parser.add_argument("--short", action="store_true", help="only show that everything runs")
    parser.add_argument("--out", type=Path, metavar="FILE", help="for the figures of this run")
    given = parser.parse_args(words)
    is_whole = not given.names and not given.short
    out: Path | None = given.out or (RESULTS if is_whole else None)
    made_by = origin()  # before hours pass
    results = measure(given.names, SHORT if given.short else FULL)
    if out:
        figures = {name: round(value, 3) for name, value in results.items()}
        out.write_text(json.dumps({**made_by, **figures}, indent=2) + "\n")
        print(f"written to {out}")


def _measurement_of(name: str) -> str:
    """The measurement of that name, or the one that has a figure of that name."""
    if name in MEASUREMENTS:
        return name
    for measurement, figures in ASKED.items():
        if name in figures:
            return measurement
    sys.exit(f"bench: {name!r} given: choose of {', '.join(MEASUREMENTS)}, or a figure with an asked value")


if __name__ == "__main__":
    main(sys.argv[1:])
