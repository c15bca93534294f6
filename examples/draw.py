"""Drawings on the emulated arm: `make draw` runs this.

Starts a box in lockstep pace, lets the client draw recordings through its ports, stops the box. Without
arguments these are three of examples/drawings; any others are given by their paths, also within an archive:

    python examples/draw.py mine.txt strokes.zip:Greek/character16/0409_17.txt

Results: out/draw/report.html, draw.json and one recording a run.
"""

import argparse
import subprocess
import sys
from pathlib import Path

from ur_emulator import ControlBox

DRAWINGS = Path(__file__).parent / "drawings"
SHOWN = ("letter_i.txt", "elle.txt", "signature.csv")


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
    with ControlBox(port_base=None, pace=options.pace, fidelity=options.fidelity, seed=options.seed) as box:
        client = [sys.executable, "-m", "pc_client", "draw", *files, "--robot", box.host]
        client += ["--port-base", str(box.port_base), "--out", str(options.out), "--overwrite"]
        client += ["--repeat", str(options.repeat), "--controller", options.controller]
        return subprocess.run(client, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
