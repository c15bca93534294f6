"""The page docs/control.md, made from the operations of the control API."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Iterator
from dataclasses import fields
from typing import Any

from protocol.ur_types import Ports
from ur_emulator.budgets import BUDGETS, KIB
from ur_emulator.host.box_options import TOKEN_VARIABLE, ServedAt
from ur_emulator.host.control_api.box_state import BoxState, Question
from ur_emulator.host.control_api.http_client import DEFAULT_PORT
from ur_emulator.host.control_api.operations import OPERATIONS
from ur_emulator.host.control_api.step_operations import ReadState
from ur_emulator.machine.commands.operation import Kind, Operation, Parameter


def _attributes(described: type, names: Iterable[str]) -> Iterator[str]:
    """The rows of a table of attributes, as the docstring of their class describes them."""
    section = (inspect.getdoc(described) or "").partition("Attributes:\n")[2].partition("\n\n")[0]
    texts = dict(re.findall(r"^    (\w+): (.*(?:\n     .*)*)", section, re.MULTILINE))
    for name in names:
        yield f"| `{name}` | {' '.join(texts[name].split()).rstrip('.')} |"


def _fields(described: type[Any]) -> str:
    """A table of all fields of a dataclass."""
    rows = _attributes(described, (field.name for field in fields(described)))
    return "\n".join(("| field | is |", "| -- | -- |", *rows))


_INTRODUCTION = f"""\
# The control API

The control API replaces the hands, wires and buttons around a real arm: it sets an input, presses
the emergency stop, pushes the arm, answers a question, reads the log. The same operations have the
same names in three places:

| from | how |
|---|---|
| Python | `box.push(force=(0, 0, 20), duration=0.5)` on a `ControlBox`, from any thread; operations that only read are properties: `box.state.q` |
| HTTP | `POST /v1/push` with `{{"force": [0, 0, 20], "duration": 0.5}}`; operations that only read use GET: `GET /v1/state`
|
| command line | `ur-emulator ctl push --force 0 0 20 --duration 0.5` |

An operation returns after the cycle in which it was applied, with the number of that cycle. Its
effect may take longer; `wait_until` waits for it. Every operation that changes something is written
to the log of the box, with the source `Control`. What the box does not do in its present state, such as
`power_on` in an emergency stop, is refused; what holds already, such as the power, is not.

In lockstep, time stands still while the box is not active. An operation still gets its cycle. An
effect that needs time (a push without duration, a wait for a condition) waits for a program or a
move.

`time.sleep` in a test has no meaning for a box in lockstep: an idle robot stands still during it, and
a program may run for minutes of robot time. `wait_until` with a `time` lets the box go on until
then, also an idle one. `at` does an operation in an exact cycle, so that every run of a test is the
same; it lets no time pass, so several can be asked for before a program begins:

```python
def test_a_hand_in_the_way_stops_the_arm(ur_box):
    begin = ur_box.state.time  # robot time, in seconds
    ur_box.at(begin + 0.8, "push", {{"force": (0, 0, 250), "duration": 0.5}})
    ur_box.run_program("movej([0.5, -1.5, -1.8, 0, 1.2, 1.5])\\n")
    ur_box.wait_until(safety_mode="PROTECTIVE_STOP", steady=True)
    stopped = ur_box.state.time
    ur_box.wait_until(time=stopped + 6.0)  # a stop can be unlocked after five seconds
    ur_box.unlock_protective_stop()
```

## Python

Methods raise `ArgumentError` for wrong arguments, `RefusedError` if the state of the box does not
allow the operation (`WaitTimeoutError`, also a `TimeoutError`, if a wait times out), and
`NotRunningError` if the box does not run. All are `EmulatorError`s with one line that says what to
do. The methods return the number of the cycle.
`box.log` is a tuple of all entries that are kept. Beside the operations a box has:

{
    chr(10).join(
        (
            "| attribute | is |",
            "| -- | -- |",
            *_attributes(ServedAt, ("host", "ports", "control_port", "port_base", "serial_number")),
        )
    )
}

The fields of `box.ports`:

{_fields(Ports)}

A box that somebody else serves, in another process, in a container or on another machine of the
laboratory, is used by the same methods:

```sh
pip install ur-hil
ur-emulator serve --control-port {DEFAULT_PORT} --ready-file box.json
```

```python
from ur_emulator import ControlBox

box = ControlBox.attach("127.0.0.1", {DEFAULT_PORT})  # token="...", if it has one
box.push(force=(0, 0, 20), duration=0.5)
print(box.state.safety_mode, box.ports.rtde)
```

`--ready-file` writes a JSON object once all ports accept, and removes it at the end: `host`,
`ports` (numbers by name), `serial_number` and `control_port` of the first box, and `boxes`, a list
of the same for all. A box that was attached goes on when the program ends; `submit` and
`follow_log` are for boxes of one's own.

## HTTP

The HTTP port is off by default. `ur-emulator serve --control-port {DEFAULT_PORT}` opens it;
`ControlBox(control_port=0)` opens a free port, whose number is `box.control_port`. It listens on
the host of the box. If a token is set, every request must contain the header `Authorization: Bearer
TOKEN` (401 otherwise). The token is set by `ur-emulator serve --token TOKEN`,
`ControlBox(control_token="TOKEN")`, or the environment variable `{TOKEN_VARIABLE}` of `ur-emulator
serve` and `ur-emulator ctl`, which other users of the machine cannot see. On a loopback address the
token is optional; without it, every program that reaches the port controls the box. On any other
address a control port requires a token.

- `GET /v1/operations` lists everything below as JSON.
- `POST` takes a JSON object (content type `application/json`); without a body all defaults are taken.
- The answer is a JSON object. An error is `{{"error": "one line"}}` with status 400 (wrong
  arguments), 401 (no token), 403 (see below), 404 (unknown operation), 405 (GET instead of POST, or
  the reverse), 408 (a wait has timed out), 409 (the state of the box does not allow it), 413 (body above {
    BUDGETS.body_bytes // KIB
} KiB; send longer programs to port 30002) or 431 (header above 16 KiB).
- Connections are kept alive; the requests of a client are answered one after the other. The box
  keeps {BUDGETS.control_clients} connections; for a new one it closes the one that has been silent
  longest.
- Pages in a browser cannot reach the box: `Host` must be the address that it listens on, or `localhost` (403
  otherwise, against DNS rebinding), and requests of foreign origins are refused (`Origin`, `Sec-Fetch-Site`).
- Scripts of the box cannot reach the port either. [security.md](security.md) lists the attacks that
  were tried.

```sh
curl http://127.0.0.1:{DEFAULT_PORT}/v1/state
curl -H 'Content-Type: application/json' -d '{{"group": "standard", "n": 3, "level": true}}' http://127.0.0.1:{
    DEFAULT_PORT
}/v1/set_digital_input
```

## Command line

`ur-emulator ctl OPERATION [--option value ...] [--host H] [--control-port {
    DEFAULT_PORT
}] [--token TOKEN] [--json]`. The exit code is 0 if the operation was applied, 1 if it was refused or no box answers, 2 for wrong
usage. `ctl log --follow` runs until Ctrl-C; `ctl run_program --script-file FILE` sends a local
file; `ctl OPERATION --help` lists the options.

## Operations
"""  # noqa: E501 - the lines of a page


def render() -> str:
    """Return the page."""
    return "\n".join([_INTRODUCTION, *(_section(*row) for row in OPERATIONS.items())])


def _section(name: str, operation: type[Operation[Any]]) -> str:
    verb = "GET" if operation.only_reads else "POST"
    lines = [f"### {name}\n", f"{operation.meaning} ({verb})\n"]
    if operation.parameters:
        lines += ["| parameter | is | allowed | default |", "|---|---|---|---|"]
        lines += [_row(parameter) for parameter in operation.parameters]
        lines.append("")
    lines.append(f"Returns {operation.result}.\n")
    if operation is ReadState:
        lines += [_fields(BoxState), "\nEach of `questions`:\n", _fields(Question), ""]
    return "\n".join(lines)


def _row(parameter: Parameter) -> str:
    default = (
        "required" if parameter.is_required else "" if parameter.default is None else f"{parameter.default}"
    )
    if parameter.kind is Kind.BOOLEAN and default != "required":
        default = default.lower()
    return f"| `{parameter.name}` | {parameter.meaning} | {parameter.allowed} | {default} |"
