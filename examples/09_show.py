"""A box with its window: the arm draws a signature, then waits for you. `make show` runs this.

In the browser: see the arm draw with the speed of a hand, put an obstacle in its way, push it, stop it, take
hold of its tool. What it drew is compared with the person in out/show/report.html; out/show/signature.html is
the arm in motion as a page that needs no server. Ctrl-C ends it; so does --once after the signature.
"""

import argparse
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

from ur_emulator import ControlBox
from ur_emulator.errors import PortError
from ur_hil import PENDANT_PORT

DRAWING = Path(__file__).parent / "drawings" / "signature.csv"
PACE = "realtime"  # as a hand draws


def main() -> int:
    parser = argparse.ArgumentParser(description="A box with its window, and an arm that signs.")
    parser.add_argument("--out", type=Path, default=Path("out/show"))
    parser.add_argument("--port", type=int, default=PENDANT_PORT, help="of the window")
    parser.add_argument("--once", action="store_true", help="end after the signature")
    options = parser.parse_args()
    for base in range(0, 20_000, 1000):
        with suppress(PortError), ControlBox(port_base=base, control_port=0, pace=PACE, seed=7) as box:
            return show(box, options)
    sys.exit("show: no free ports found; stop what listens on 29999 to 30013")


def show(box: ControlBox, options: argparse.Namespace) -> int:
    at = ["--port-base", str(box.port_base)]
    emulator, client = ([sys.executable, "-m", package] for package in ("ur_emulator", "pc_client"))
    control = ["--control-port", str(box.control_port), "--port", str(options.port)]
    window = subprocess.Popen([*emulator, "pendant", box.host, *at, *control])
    try:
        draw = [*client, "draw", str(DRAWING), "--robot", box.host, *at, "--out", str(options.out)]
        done = subprocess.run([*draw, "--repeat", "1", "--overwrite"], check=False).returncode
        if done == 0:
            (recording, *_) = sorted(options.out.rglob("*.mcap"))
            page = options.out / "signature.html"
            done = subprocess.run(
                [*client, "view", str(recording), "--save", str(page)], check=False
            ).returncode
        if options.once or done:
            return done
        print("The arm is yours: push it, put an obstacle in its way, drag its tool. Ctrl-C ends.")
        while window.poll() is None:
            time.sleep(0.5)
        return 1
    except KeyboardInterrupt:
        return 0
    finally:
        window.terminate()
        window.wait()


if __name__ == "__main__":
    sys.exit(main())
