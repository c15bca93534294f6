"""What a box loads when it starts: nothing that can wait for its first use."""

import json
import signal
import subprocess
import sys

from integration_support import finish, free_port_base

# Each costs time or memory that no box needs before somebody asks for it.
LATE = {
    "pymodbus": "the first Modbus client or signal",
    "xmlrpc": "the first XML-RPC call",
    "http": "the first XML-RPC call",
    "ssl": "nothing at all",
    "rich": "help and errors of the command line",
    "asyncio": "nothing at all",
    "glfw": "nothing at all: a box draws nothing",
    "scipy": "the client",
    "pinocchio": "the client",
    "matplotlib": "the report",
    "pytest": "tests",
}
START = (
    "import atexit, json, sys\n"
    "from ur_emulator import cli\n"
    "atexit.register(lambda: print(json.dumps(sorted(sys.modules))))\n"
    "cli.main()\n"
)


def test_a_box_that_serves_has_loaded_nothing_that_can_wait():
    process = subprocess.Popen(
        [sys.executable, "-c", START, "serve", "--port-base", str(free_port_base())],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert " ready at " in process.stdout.readline()
    process.send_signal(signal.SIGTERM)
    done = finish(process)
    assert (done.code, done.err) == (0, "")
    loaded = {name.split(".")[0] for name in json.loads(done.out)}
    assert {"mujoco", "numpy", "lark"} <= loaded
    assert loaded & LATE.keys() == set()
