"""What a box loads when it starts: nothing that can wait for its first use."""

import json
import signal
import subprocess
import sys

import pytest
from integration_support import finish, free_port_base

from ur_emulator.cli import WANTED_DESCRIPTORS

# Each costs time or memory that no box needs before somebody asks for it.
LATE = {
    "lark": "nothing at all: programs are compiled in a process of their own",
    "pymodbus": "tests",
    "xmlrpc": "nothing at all",
    "http": "nothing at all",
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
    "import atexit, gc, json, sys\n"
    "from ur_emulator import cli\n"
    "atexit.register(lambda: print(json.dumps([gc.get_freeze_count(), sorted(sys.modules)])))\n"
    "cli.main()\n"
)

RAISE = (
    "import json, resource\n"
    "from ur_emulator.cli import raise_descriptor_limit\n"
    "print(json.dumps([raise_descriptor_limit(), *resource.getrlimit(resource.RLIMIT_NOFILE)]))\n"
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
    frozen, names = json.loads(done.out)
    assert frozen > 10_000  # what exists at start is never collected
    loaded = {name.split(".")[0] for name in names}
    assert {"mujoco", "numpy"} <= loaded
    assert loaded & LATE.keys() == set()


@pytest.mark.skipif(sys.platform == "win32", reason="no such limit")
@pytest.mark.parametrize(("hard", "given"), [(300, 300), (None, WANTED_DESCRIPTORS)])
def test_the_limit_of_descriptors_is_raised_as_far_as_the_system_allows(hard, given):
    import resource

    now = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    hard = now if hard is None else hard
    done = subprocess.run(
        [sys.executable, "-c", RAISE],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (100, hard)),
        capture_output=True,
        text=True,
        timeout=60,
    )
    expected = given if hard == resource.RLIM_INFINITY else min(given, hard)
    assert json.loads(done.stdout) == [expected, expected, hard]
