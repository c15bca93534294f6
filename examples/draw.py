"""Human movements on the emulated arm: `make draw` runs this.

Starts a box in lockstep pace, lets the client draw recordings through its ports, stops the box. Without
arguments three characters of the data set beside this checkout (Omniglot, MIT licence) are drawn; where it is
absent, a letter that was made up here. Results: out/draw/report.html, draw.json and one recording a run.
"""

import argparse
import subprocess
import sys
from pathlib import Path

from ur_emulator import ControlBox
from ur_emulator.errors import PortError

DATA = Path(__file__).parents[2] / "shared" / "data" / "pen_strokes" / "strokes_background_small1.zip"
CHARACTERS = (
    "strokes_background_small1/Early_Aramaic/character16/0266_10.txt",
    "strokes_background_small1/Early_Aramaic/character04/0254_02.txt",
    "strokes_background_small1/Greek/character16/0409_17.txt",
)


def made_up_letter(folder: Path) -> Path:
    """Write a T, x, y, t in pixels and milliseconds, with the speed profiles of two quick strokes."""
    lines = ["START"]
    for begin, (x0, y0), (x1, y1) in ((0, (20, 20), (80, 22)), (900, (50, 20), (48, 90))):
        for k in range(41):
            u = k / 40
            done = 10 * u**3 - 15 * u**4 + 6 * u**5
            lines.append(f"{x0 + done * (x1 - x0):.2f},{y0 + done * (y1 - y0):.2f},{begin + 12 * k}")
        lines.append("BREAK")
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "letter.txt"
    path.write_text("\n".join(lines) + "\n")
    return path


def open_box(**settings) -> ControlBox:
    """Return a listening box: on the standard ports, or moved up if they are taken."""
    for base in range(0, 20_000, 1000):
        box = ControlBox(port_base=base, **settings)
        try:
            box.listen()
        except PortError:
            continue
        return box
    sys.exit("draw: no free ports found; stop what listens on 29999 to 30013")


def main() -> int:
    parser = argparse.ArgumentParser(description="Human movements on the emulated arm.")
    parser.add_argument("files", nargs="*", help="recordings, as for ur-client draw")
    parser.add_argument("--out", type=Path, default=Path("out/draw"))
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--pace", choices=["lockstep", "realtime"], default="lockstep")
    parser.add_argument("--fidelity", choices=["ideal", "typical", "poor"], default="typical")
    parser.add_argument("--controller", choices=["best", "preview", "paper"], default="best")
    parser.add_argument("--repeat", type=int, default=3)
    options = parser.parse_args()
    files = options.files
    if not files and DATA.exists():
        files = [f"{DATA}:{name}" for name in CHARACTERS]
    elif not files:
        files = [str(made_up_letter(options.out))]
    with open_box(seed=options.seed, pace=options.pace, fidelity=options.fidelity) as box:
        client = [sys.executable, "-m", "pc_client", "draw", *files, "--robot", box.host]
        client += ["--port-base", str(box.port_base), "--out", str(options.out)]
        client += ["--repeat", str(options.repeat), "--controller", options.controller]
        return subprocess.run(client, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
