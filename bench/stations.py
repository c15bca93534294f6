"""Stations of a walk: how many files and functions of the box lie between an event and its effect.

    python -m bench.stations [--list] [WALK ...]

A walk is done on new boxes of one seed, in lockstep, through sockets and `ControlBox`: with its event, and
without it for some time of the robot. Noted are the calls of functions of `ur_emulator`, `urscript` and
`protocol`, from the event until its effect, in the threads of box and user. Two pairs of numbers are printed:

- *only*: what is entered with the event and not without.
- *way*: that, and what is entered in both but gets or gives something else with the event: other numbers,
  texts, bytes, arrays, fields of a frozen record; and who stands above such a call on the stack.

Each run is made twice; what only one of the two has does not count, such as values of the clock. The way is
more than one has to read: who only watches a changed value is on it. What happens to an object that no
changed value is passed to is missing. Lambdas and comprehensions count as what is around them. Not seen:
methods that dataclasses generate, scripts, the worker process (it compiles and reads program files).
The loop has real seconds, too (repeated frames, polls): the way of `velocity` differs by some between runs.
"""

import inspect
import socket
import struct
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import fields, is_dataclass
from functools import cache, partial
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import numpy as np

import ur_emulator
from pc_client.driver.receiver import fill_template, receiver_template
from protocol.realtime.layout import layout_for_version
from protocol.ur_types import SafetyMode, SoftwareVersion
from ur_emulator import ControlBox

Function = tuple[str, str]  # its file and name
HOUSE = Path(ur_emulator.__file__).parents[1]
PACKAGES = tuple(f"{HOUSE}/{name}/" for name in ("ur_emulator", "urscript", "protocol"))
LONGEST = 16  # items or fields that are compared; snapshots and models of arms have more: their type counts
LAYOUT = layout_for_version(SoftwareVersion(3, 15, 8))
TIME = 3.0  # that a run without event takes; each effect comes sooner [s]


class Run:
    """Notes of each function what it got or gave, and who stood above, while `is_on`."""

    def __init__(self, has_event: bool) -> None:
        self.has_event, self.is_on = has_event, False
        self.calls: dict[Function, dict[object, list[Function]]] = {}
        self.is_effect: Callable[[bytes], bool] = lambda sent: False

    def note(self, frame: FrameType, event: str, arg: Any) -> None:
        """The profile function of a thread."""
        code = frame.f_code
        if self.is_on and event in ("call", "return") and (function := _function(code)):
            names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
            value = _plain([frame.f_locals.get(name) for name in names] if event == "call" else (arg,))
            if value not in (values := self.calls.setdefault(function, {})):
                above = (_function(outer.f_code) for outer, _ in traceback.walk_stack(frame.f_back))
                values[value] = [caller for caller in above if caller]
        elif self.is_on and event == "c_call" and arg.__name__ == "send":
            self.is_on = not self.is_effect(frame.f_locals.get("data", b""))

    @contextmanager
    def box(self, **options: Any) -> Iterator[ControlBox]:
        """A box that is noted, as is the calling thread."""
        threading.setprofile(self.note)
        sys.setprofile(self.note)
        with ControlBox(pace="lockstep", port_base=None, seed=7, in_process=True, **options) as box:
            threading.setprofile(None)
            yield box
        sys.setprofile(None)

    def go(self, box: ControlBox, begin: Callable[[], object]) -> None:
        """Begin with the event and note until its effect is sent, or note for `TIME`."""
        end = box.state.time + TIME
        self.is_on = True
        if self.has_event:
            begin()
            while self.is_on:
                time.sleep(0.01)
        else:
            box.wait_until(time=end)
        self.is_on = False

    def dial(self, box: ControlBox, port: str, again: bytes = b"") -> socket.socket:
        """A client that reads all that comes, and sends something `again` after that."""
        client = socket.create_connection((box.host, getattr(box.ports, port)))

        def read() -> None:
            with suppress(OSError):
                while client.recv(1 << 16):
                    client.sendall(again if self.is_on else b"")

        threading.Thread(target=read, daemon=True).start()
        return client


@cache
def _function(code: CodeType) -> Function | None:
    if not code.co_flags & inspect.CO_OPTIMIZED or not code.co_filename.startswith(PACKAGES):
        return None  # the body of a module or class, or not of the box
    return str(Path(code.co_filename).relative_to(HOUSE)), code.co_qualname.split(".<locals>.<")[0]


def _plain(value: Any, deep: int = 3) -> object:
    if isinstance(value, np.ndarray):
        return value[:LONGEST].tobytes()
    if deep and isinstance(value, tuple | list) and len(value) <= LONGEST:
        return type(value), *(_plain(item, deep - 1) for item in value)
    is_frozen = is_dataclass(value) and inspect.getattr_static(value, "__dataclass_params__").frozen
    if deep and is_frozen and len(fields(value)) <= LONGEST:
        return type(value), *(_plain(getattr(value, field.name, None), 1) for field in fields(value))
    return value if isinstance(value, int | float | str | bytes) else type(value)


def velocity(run: Run) -> None:
    """20 velocities of the PC, until the last frame that shows what the drives do; without: velocity 0."""
    with run.box() as box, socket.create_server(("127.0.0.1", 0)) as server:
        client = socket.create_connection((box.host, box.ports.realtime))
        values = {"pc_address": '"127.0.0.1"', "pc_port": server.getsockname()[1], "acceleration": 20.0}
        values |= {"stop_deceleration": 20.0, "read_timeout": 9.0, "missed_allowed": 1}
        client.sendall(fill_template(receiver_template(), values).encode())
        with client, client.makefile("rb") as frames, server.accept()[0] as stream:
            last = now = float(len(stream.recv(4)))
            for k in range(40):
                run.is_on = k >= 20
                stream.sendall(struct.pack(">7i", 1, 300_000 * (run.has_event and run.is_on), *[0] * 5))
                while now <= last:  # while time stands still, frames are repeated
                    _, now = struct.unpack_from(">id", frames.read(LAYOUT.size))
                last = now
            run.is_on = False


def recipe(run: Run) -> None:
    """A recipe of RTDE, until its first package is sent; without: a client that asks for nothing."""
    run.is_effect = lambda sent: sent[2:3] == b"U"
    with run.box() as box, run.dial(box, "rtde") as client:
        client.sendall(struct.pack(">HBH", 5, ord("V"), 2))
        box.wait_until(time=box.state.time + 0.1)
        words = struct.pack(">HBd18sHB", 29, ord("O"), 125.0, b"timestamp,actual_q", 3, ord("S"))
        run.go(box, partial(client.sendall, words))


def play(run: Run) -> None:
    """`play` at the dashboard, until a frame with a target that moves is sent."""
    run.is_effect = lambda sent: len(sent) == LAYOUT.size and any(LAYOUT.decode(sent).target_qd)
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "p.script").write_text("def p():\n  movej([0.5, -1.5, -1.5, 0, 1, 0])\nend\n")
        with run.box(programs=folder) as box, run.dial(box, "realtime"), run.dial(box, "dashboard") as client:
            client.sendall(b"load p.script\n")
            time.sleep(1.0)
            run.go(box, partial(client.sendall, b"play\n"))


def contact(run: Run) -> None:
    """The arm meets a ball, until port 30001 sends the code of the stop; without: the ball is far away."""
    run.is_effect = lambda sent: sent[4:5] == b"\x14" and sent[14] == 6  # a message, with a code
    with run.box() as box, run.dial(box, "primary"):
        (x, y, z), q = box.state.tcp_pose[:3], box.state.q
        box.add_obstacle("ball", "sphere", [0.05], [-y, x, z if run.has_event else 3.0, 0, 0, 0])
        run.is_on = True
        box.run_program(f"movej({[q[0] + 3.0, *q[1:]]})\n")
        run.go(box, lambda: None)


def gripper(run: Run) -> None:
    """`SET POS` at a Robotiq gripper, until the answer to `GET POS` says that the fingers move."""
    run.is_effect = lambda sent: sent.startswith(b"POS ") and int(sent[4:]) > 10
    with run.box(robot="ur5e", tool="robotiq-2f85") as box, run.dial(box, "gripper", b"GET POS\n") as client:
        client.sendall(b"SET ACT 1 GTO 1\n")
        box.wait_until(time=box.state.time + 4.0, timeout=60.0)
        run.go(box, partial(client.sendall, b"SET POS 200\n"))


def limit(run: Run) -> None:
    """A joint range of a robot file, until a frame has the stop at its end; without: a wide range."""
    stop = SafetyMode.PROTECTIVE_STOP
    run.is_effect = lambda sent: len(sent) == LAYOUT.size and LAYOUT.decode(sent).safety_mode == stop
    run.is_on = True
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "arm.toml")
        file.write_text(f'based_on = "ur3"\nq_max = [{0.8 if run.has_event else 6}, 6, 6, 6, 6, 6]\n')
        with run.box(robot=file) as box, run.dial(box, "realtime"):
            box.run_program("speedj([0.5, 0, 0, 0, 0, 0], 1, 9)\n")
            run.go(box, lambda: None)


def control(run: Run) -> None:
    """An operation over HTTP, from the call of the method until its answer is sent."""
    run.is_effect = lambda sent: sent.startswith(b"HTTP/1.1 200")
    with run.box(control_port=0) as box:
        attached = ControlBox.attach(box.host, box.control_port)
        run.go(box, partial(attached.set_digital_input, "standard", 3, True))


def measure(walk: Callable[[Run], None]) -> tuple[list[Function], set[Function]]:
    """The way of a walk in the order of first entry, and what is entered only with the event."""
    runs = [Run(has_event) for has_event in (True, True, False, True, False)]
    for run in runs:
        walk(run)
    _, first, idle, second, again = (run.calls for run in runs)  # in the first run of all, caches are filled
    way: set[Function] = set()
    for function, values in first.items():
        same = values.keys() & second.get(function, {}).keys()
        for value in same - idle.get(function, {}).keys() - again.get(function, {}).keys():
            way |= {function, *values[value]}
    return [function for function in first if function in way], way - idle.keys() - again.keys()


if __name__ == "__main__":
    chosen = [name for name in sys.argv[1:] if name != "--list"]
    for walk in (velocity, recipe, play, contact, gripper, limit, control):
        if not chosen or walk.__name__ in chosen:
            found, only = measure(walk)
            counts = [f"{len({file for file, _ in some}):3} / {len(some):3}" for some in (only, found)]
            print(f"{walk.__name__:9} files / functions: only {counts[0]}, way {counts[1]}")
            for function in found if "--list" in sys.argv else ():
                print("   *" if function in only else "    ", *function)
