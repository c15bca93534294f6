"""The page docs/protocol/robot_api.md, made from the table of calls."""

from __future__ import annotations

from collections.abc import Iterator

from docs.generate.page_parts import table
from protocol.robot_api import API_VERSIONS, BASE, CALLS, ROBOT_MODE_NAMES, SAFETY_MODE_NAMES
from protocol.ur_types import Ports
from ur_emulator.budgets import BUDGETS, KIB, MIB

_INTRODUCTION = f"""\
# Robot API of PolyScope X: port {Ports().robot_api}

Made from `protocol/robot_api.py` by `make docs`.

`ur-emulator serve --robot ur5e --software 10.11` starts a box with PolyScope X. It has no dashboard
server. Clients call `http://HOST{BASE}` instead: JSON over HTTP. Port {Ports().robot_api} needs
privileges on most systems; `--port-base N` moves it with the others.

The ports of two services stay closed until somebody enables the service, as on a new robot:
`--services primary,rtde`. The service `primary` opens 30001, 30002, 30003 and their read-only
twins, `rtde` opens 30004. Modbus and interpreter mode are open.

Answers: 200 with the fields of the table; 403 for a call marked with R in local control, 404 for a
path or a program that does not exist, 405 for another method, 409 for what the robot cannot do now,
422 for a body that is not JSON or lacks a field. The body of an error is
`{{"message": "Forbidden", "details": "..."}}`, that of 422 `{{"detail": [{{"msg": "..."}}]}}`. A call is
answered when it is complete: POWER_ON when the robot is IDLE.

Programs are the files `NAME.urpx`, `NAME.urp` and `NAME.script` of the folder `--programs`. A `.urpx`
is JSON; the box plays the script that PolyScope X has stored in it, first that of the application,
then that of the program. A `.urpx` that a client sends gets the name that stands in it, whatever the
name of the file; 400 if there is one already. At most {BUDGETS.upload_bytes // KIB} KiB,
all programs of the folder together {BUDGETS.uploads_bytes // MIB} MiB.
"""


_EXAMPLES = """\
## Try it

```sh
pip install ur-hil
ur-emulator serve --robot ur5e --software 10.14 --programs my_programs --port-base 1000
```

A body needs its content type. With `pick.script` in the folder:

<!-- not run: the port moves; tests/integration/test_clients_from_pages.py does it -->
"""

# Method, path, body ("" for none) and answer, one after the other on a box that has just started.
_SESSION = (
    ("GET", "/robotstate/v1/robotmode", "", '{"mode":"RUNNING","message":""}'),
    ("PUT", "/robotstate/v1/state", '{"action": "POWER_OFF"}', '{"message":"done"}'),
    ("PUT", "/robotstate/v1/state", '{"action": "BRAKE_RELEASE"}',
     '{"message":"Conflict","details":"BRAKE_RELEASE given: the robot is in POWER_OFF"}'),
    ("PUT", "/robotstate/v1/state", '{"action": "POWER_ON"}', '{"message":"done"}'),
    ("PUT", "/robotstate/v1/state", '{"action": "BRAKE_RELEASE"}', '{"message":"done"}'),
    ("PUT", "/program/v1/load", '{"programName": "pick"}',
     '{"message":"Program loaded successfully","name":"pick"}'),
    ("PUT", "/program/v1/state", '{"action": "play"}', '{"message":"done","state":"PLAYING","details":""}'),
    ("GET", "/program/v1/state", "", '{"state":"PLAYING","message":"","details":""}'),
    ("PUT", "/program/v1/state", '{"action": "stop"}', '{"message":"done","state":"STOPPED","details":""}'),
    ("POST", "/popup/v1", '{"title": "pick", "message": "empty"}', '{"message":"Popup opened successfully"}'),
    ("DELETE", "/popup/v1", "", '{"message":"Popup closed","closed":true}'),
)  # fmt: skip


def _session() -> Iterator[str]:
    yield "```console"
    for method, path, body, answer in _SESSION:
        how = f"-X {method} " * (method != "GET")
        what = f"-H 'Content-Type: application/json' -d '{body}' " * bool(body)
        yield f"$ curl {how}{what}http://127.0.0.1:{Ports().robot_api + 1000}{BASE}{path}"
        yield answer
    yield "```\n"


def render() -> str:
    """Return the page."""
    return "\n".join(
        (
            _INTRODUCTION,
            _EXAMPLES,
            *_session(),
            "A file is a form: `curl -F file=@pick.script http://127.0.0.1:1080" + BASE + "/programs/v1`.\n",
            "## Calls\n",
            *table(
                ("call", "does", "since", "R"),
                (
                    (
                        f"`{row.method} {row.path}`",
                        row.does,
                        f"{row.since.major}.{row.since.minor}",
                        "R" * row.needs_remote,
                    )
                    for row in CALLS
                ),
            ),
            "",
            f"* Robot modes: {', '.join(ROBOT_MODE_NAMES.values())}.",
            f"* Safety modes: {', '.join(dict.fromkeys(SAFETY_MODE_NAMES.values()))}.",
            "",
            "Version of the API, `info.version` of `/openapi.json`:",
            "",
            *table(
                ("from software", "version"),
                ((f"{since.major}.{since.minor}", version) for since, version in API_VERSIONS),
            ),
            "",
        )
    )
