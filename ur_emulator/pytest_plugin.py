"""pytest plug-in: control boxes as fixtures. Comes with the package; docs/control.md and the README show it.

    def test_my_driver(ur_box):                     # a fresh UR3 in lockstep, on free ports
        connect_my_driver(ur_box.host, ur_box.ports)

    @pytest.mark.ur(robot="ur5", version="3.4.0", standard_ports=True)
    def test_the_old_software(ur_box): ...

    @pytest.mark.parametrize("ur_box", ["ur3", "ur5 3.4.0", "ur5e 5.25.1"], indirect=True)
    def test_on_three_robots(ur_box): ...

Boxes end with their test; a test that fails shows their states and logs. Nothing heavy is imported before a
fixture is used, so that a test-suite without boxes pays nothing.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from ur_emulator.errors import ControlError, EmulatorError, ModelError, PortError

if TYPE_CHECKING:
    from ur_emulator import ControlBox
    from ur_emulator.machine.models.robot_model import RobotModel

# What `@pytest.mark.ur(...)` and `ur_box_factory(...)` take.
OPTIONS = (
    "robot",
    "version",
    "pace",
    "speed",
    "fidelity",
    "seed",
    "host",
    "port_base",
    "programs",
    "skip_unknown_nodes",
    "remote_control",
    "services",
    "tool",
    "scene",
    "journal",
    "control_port",
    "control_token",
    "in_process",
    "standard_ports",
)
DEFAULT_ROBOT = "ur3"
DEFAULTS: dict[str, Any] = {"pace": "lockstep", "port_base": None}
# Entries of a log that a failing test shows.
MAX_SHOWN = 200
# What the name of a file does not have of that of a test.
_NO_NAME = re.compile(r"[^A-Za-z0-9_.]+")
# How many addresses are tried for a box with the standard ports.
MAX_ADDRESSES = 100

BoxFactory = Callable[..., "ControlBox"]
_BOXES = pytest.StashKey[list["ControlBox"]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the defaults of all boxes to the command line."""
    group = parser.getgroup("ur-emulator", "emulated control boxes (fixtures ur_box, ur_box_factory)")
    group.addoption(
        "--ur-robot", default=DEFAULT_ROBOT, metavar="NAME", help="type of the arm, unless a test names one"
    )
    group.addoption("--ur-version", default=None, metavar="X.Y.Z", help="software, unless a test names one")
    group.addoption(
        "--ur-journal", type=Path, default=None, metavar="DIR", help="folder for the journal of each box"
    )


def pytest_configure(config: pytest.Config) -> None:
    """Make the marker known, and look at the defaults once for all tests."""
    config.addinivalue_line(
        "markers", f"ur({', '.join(f'{name}=...' for name in OPTIONS)}): how ur_box shall be"
    )
    robot, version = config.getoption("--ur-robot"), config.getoption("--ur-version")
    if version is None and robot == DEFAULT_ROBOT:
        return
    try:
        _robot(robot, version)
    except ModelError as error:
        raise pytest.UsageError(f"--ur-robot, --ur-version: {error}") from None


@pytest.fixture
def ur_box_factory(request: pytest.FixtureRequest) -> Iterator[BoxFactory]:
    """Makes boxes that run until the test ends: `ur_box_factory(robot="ur5", seed=3)`.

    It takes the arguments of `ControlBox` and `standard_ports=True`: a loopback address of its own with the
    vendor's port numbers. Without any, it is a box in lockstep on free ports.
    """
    boxes = request.node.stash.setdefault(_BOXES, [])
    with ExitStack() as stack:

        def make(**options: Any) -> ControlBox:
            defaults = _defaults(request.config, options.get("robot"))
            folder: Path | None = request.config.getoption("--ur-journal")
            if folder is not None:
                folder.mkdir(parents=True, exist_ok=True)
                name = _NO_NAME.sub("-", request.node.nodeid).strip("-")
                defaults["journal"] = (folder / f"{name}-{len(boxes) + 1}.journal").absolute()
            box = _start({**defaults, **_checked(options, request.path.parent)}, stack)
            boxes.append(box)
            return box

        yield make


@pytest.fixture
def ur_box(request: pytest.FixtureRequest, ur_box_factory: BoxFactory) -> ControlBox:
    """A fresh box for one test, as `@pytest.mark.ur(...)` wants it; it runs until the test ends.

    Its parameter, if there is one, names the arm and perhaps the software ("ur5e 5.25.1"), or is a mapping of
    options.
    """
    named = getattr(request, "param", {})
    if isinstance(named, str):
        named = dict(zip(("robot", "version"), named.split(), strict=False))
    options: dict[str, Any] = {}
    for mark in reversed(list(request.node.iter_markers("ur"))):  # the nearest mark last: it wins
        if mark.args:
            pytest.fail(f"@pytest.mark.ur takes keywords only, {mark.args!r} given", pytrace=False)
        options |= mark.kwargs
    return ur_box_factory(**options | named)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Show the states and logs of a failing test's boxes."""
    report = yield
    if report.failed:
        for box in item.stash.get(_BOXES, []):
            entries = box.log
            left_out = [f"... {len(entries) - MAX_SHOWN} entries before"] if len(entries) > MAX_SHOWN else []
            text = "\n".join([*left_out, *map(str, entries[-MAX_SHOWN:])])
            where = f"{box.title} at {box.host}:{box.ports.primary}"
            report.sections.append((f"state of the {where}", _shown_state(box)))
            report.sections.append((f"log of the {where}", text or "(empty)"))
    return report


def _shown_state(box: ControlBox) -> str:
    try:
        now = box.state
    except ControlError as error:
        return str(error)
    q = ", ".join(f"{angle:.4f}" for angle in now.q)
    return (
        f"robot mode {now.robot_mode}, safety mode {now.safety_mode}\n"
        f"program {now.program or '(none)'}: {now.program_state}\n"
        f"joints [{q}] rad, {'at rest' if now.steady else 'moving'}, after {now.time:.3f} s"
    )


def _defaults(config: pytest.Config, robot: str | None) -> dict[str, Any]:
    """Return the options of a box that nobody has named; the default software is for arms that run it."""
    version = config.getoption("--ur-version")
    defaults = {**DEFAULTS, "robot": config.getoption("--ur-robot")}
    if version is not None:
        with suppress(ModelError):
            _robot(robot or defaults["robot"], version)
            return {**defaults, "version": version}
    return defaults


def _robot(name: str, version: str | None) -> RobotModel:
    """Return an arm that runs a version of the software; ModelError if there is none."""
    from ur_emulator.machine.models.robots import robot_by_name

    robot = robot_by_name(name, version)
    robot.software_version(version)
    return robot


def _checked(options: dict[str, Any], folder: Path) -> dict[str, Any]:
    unknown = [name for name in options if name not in OPTIONS]
    if unknown:
        pytest.fail(f"a box has no {', '.join(unknown)}: choose from {', '.join(OPTIONS)}", pytrace=False)
    if options.get("programs") is not None:  # relative to the test's own file
        return {**options, "programs": folder / options["programs"]}
    return options


def _start(options: dict[str, Any], stack: ExitStack) -> ControlBox:
    from ur_emulator.emulator import ControlBox

    own_address = options.pop("standard_ports", False)
    try:
        if not own_address:
            return stack.enter_context(ControlBox(**options))
        options["port_base"] = 0
        for host in _own_addresses() if "host" not in options else [options["host"]]:
            if not _is_free(host):
                continue
            with suppress(PortError):  # somebody else was quicker
                return stack.enter_context(ControlBox(**{**options, "host": host}))
        raise PortError(
            "no loopback address has the standard ports free: run fewer tests at once, or leave out "
            "standard_ports (on macOS only 127.0.0.1 exists until others are added with ifconfig)"
        )
    except EmulatorError as error:
        pytest.fail(f"no box: {error}", pytrace=False)


def _own_addresses() -> Iterator[str]:
    """Yield loopback addresses that no other worker and hardly another run on this machine will want."""
    worker = os.environ.get("PYTEST_XDIST_WORKER", "")
    number = int(worker.removeprefix("gw")) if worker.removeprefix("gw").isdecimal() else -1
    block = 1 + (number + 1) % 200
    for k in range(MAX_ADDRESSES):
        yield f"127.{block}.{1 + os.getpid() % 250}.{1 + k}"


def _is_free(host: str) -> bool:
    """Return whether all standard ports of an address can be opened that need no privileges."""
    import socket
    from dataclasses import astuple

    from protocol.ur_types import Ports

    with ExitStack() as stack:
        try:
            for port in (number for number in astuple(Ports.standard()) if number >= 1024):
                sock = stack.enter_context(socket.socket())
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                sock.bind((host, port))
                sock.listen(1)
        except OSError:
            return False
    return True
