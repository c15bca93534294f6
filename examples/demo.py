"""The paper's experiment on the emulated arm: `make demo` runs this.

Starts a box in lockstep pace, lets the client run the ten movements three times each through its ports, stops
the box. The client is a process of its own and the same that drives a real arm; only the address differs.
Results: out/demo/report.html, table1.json and one recording a run.
"""

import argparse
import subprocess
import sys
from pathlib import Path

from ur_emulator import ControlBox
from ur_emulator.errors import PortError


def open_box(**settings) -> ControlBox:
    """Return a listening box: on the standard ports, or moved up if they are taken."""
    for base in range(0, 20_000, 1000):
        box = ControlBox(port_base=base, **settings)
        try:
            box.listen()
        except PortError:
            continue
        return box
    sys.exit("demo: no free ports found; stop what listens on 29999 to 30013")


def main() -> int:
    parser = argparse.ArgumentParser(description="The paper's experiment on the emulated arm.")
    parser.add_argument("--out", type=Path, default=Path("out/demo"))
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--pace", choices=["lockstep", "realtime"], default="lockstep")
    parser.add_argument("--fidelity", choices=["ideal", "typical", "poor"], default="typical")
    parser.add_argument("--controller", choices=["preview", "paper", "best"], default="preview")
    parser.add_argument("--repeat", type=int, default=3)
    options = parser.parse_args()
    box = open_box(seed=options.seed, pace=options.pace, fidelity=options.fidelity)
    with box:
        client = [sys.executable, "-m", "pc_client", "experiment", "--robot", box.host]
        client += ["--port-base", str(box.port_base), "--out", str(options.out)]
        client += ["--repeat", str(options.repeat), "--controller", options.controller]
        return subprocess.run(client, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
