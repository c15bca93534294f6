"""Drawings on the emulated arm: `make draw` runs this.

Starts a box in lockstep pace, lets the client draw recordings through its ports, stops the box. Without
arguments these are three of examples/drawings; any others are given by their paths, also within an archive:

    python examples/draw.py mine.txt strokes.zip:Greek/character16/0409_17.txt

Results: out/draw/report.html, draw.json and one recording a run.
"""

import argparse
import subprocess
import sys
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

from ur_emulator import ControlBox
from ur_emulator.errors import PortError

DRAWINGS = Path(__file__).parent / "drawings"
SHOWN = ("letter_i.txt", "elle.txt", "signature.csv")


def open_box(stack: ExitStack, **settings: Any) -> ControlBox:
    """Return a box that runs as long as the stack: on the standard ports, or moved up if they are taken."""
    for base in range(0, 20_000, 1000):
        with suppress(PortError):
            return stack.enter_context(ControlBox(port_base=base, **settings))
    sys.exit("draw: no free ports found; stop what listens on 29999 to 30013")


def main() -> int:
    parser = argparse.ArgumentParser(description="Drawings on the emulated arm.")
    parser.add_argument("files", nargs="*", help="recordings: FILE or ARCHIVE.zip:PATH")
    parser.add_argument("--out", type=Path, default=Path("out/draw"))
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--pace", choices=["lockstep", "realtime"], default="lockstep")
    parser.add_argument("--fidelity", choices=["ideal", "typical", "poor"], default="typical")
    parser.add_argument("--controller", choices=["best", "preview", "paper"], default="best")
    parser.add_argument("--repeat", type=int, default=3)
    options = parser.parse_args()
    files = options.files or [str(DRAWINGS / name) for name in SHOWN]
    with ExitStack() as stack:
        box = open_box(stack, seed=options.seed, pace=options.pace, fidelity=options.fidelity)
        client = [sys.executable, "-m", "pc_client", "draw", *files, "--robot", box.host]
        client += ["--port-base", str(box.port_base), "--out", str(options.out), "--overwrite"]
        client += ["--repeat", str(options.repeat), "--controller", options.controller]
        return subprocess.run(client, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
