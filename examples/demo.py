"""The paper's experiment on the emulated arm: `make demo` runs this.

Starts a box in lockstep pace, lets the client run the ten movements three times each through its ports, stops the box.
The client is the same that drives a real arm; only the address differs. Results: out/demo/report.html and table1.json.
"""

import argparse
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

PORTS = (29999, 30001, 30002, 30003, 30004, 30011, 30012, 30013)
START_LIMIT = 30.0  # s


def free_port_base() -> int:
    """Return the first offset at which all ports of a box are free: 0 unless another robot is being simulated."""
    for base in range(0, 20_000, 1000):
        if all(is_free(port + base) for port in PORTS):
            return base
    sys.exit("demo: no free ports found; stop what listens on 29999 to 30013")


def is_free(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
        return True


@contextmanager
def serving_box(port_base: int, seed: int, pace: str, fidelity: str):
    """Run `ur-emulator serve` as long as the block lasts."""
    with tempfile.TemporaryDirectory() as folder:
        ready = Path(folder) / "ready.json"
        command = [sys.executable, "-m", "ur_emulator", "serve", "--port-base", str(port_base), "--seed", str(seed)]
        command += ["--pace", pace, "--fidelity", fidelity, "--ready-file", str(ready)]
        box = subprocess.Popen(command)
        try:
            limit = time.monotonic() + START_LIMIT
            while not ready.exists():
                if box.poll() is not None or time.monotonic() > limit:
                    sys.exit("demo: the box did not start")
                time.sleep(0.01)
            yield
        finally:
            box.terminate()
            box.wait(timeout=10)


def main() -> int:
    parser = argparse.ArgumentParser(description="The paper's experiment on the emulated arm.")
    parser.add_argument("--out", type=Path, default=Path("out/demo"))
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--pace", choices=["lockstep", "realtime"], default="lockstep")
    parser.add_argument("--fidelity", choices=["ideal", "typical", "poor"], default="typical")
    parser.add_argument("--controller", choices=["preview", "paper"], default="preview")
    options = parser.parse_args()
    base = free_port_base()
    with serving_box(base, options.seed, options.pace, options.fidelity):
        client = [sys.executable, "-m", "pc_client", "experiment", "--robot", "127.0.0.1", "--port-base", str(base)]
        client += ["--out", str(options.out), "--repeat", "3", "--controller", options.controller]
        return subprocess.run(client, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
