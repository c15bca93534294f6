"""The page docs/protocol/gripper.md, made from the tables of Robotiq's port and of OnRobot's."""

from __future__ import annotations

from protocol.robotiq import INPUTS, OUTPUTS, VARIABLES, Variable
from ur_emulator.host.ports.onrobot import METHODS
from ur_emulator.machine.tools.onrobot import STATUS

_INTRODUCTION = """\
# Grippers: what is answered, and how well

Made from `protocol/robotiq.py` and `ur_emulator/host/ports/onrobot.py` by `make docs`.
[Grippers](../grippers.md) explains how they are used, [fidelity.md](../fidelity.md) what was chosen.
*Exact*: as sources describe a real one. *Approximate*:
the same kind of answer, from a simpler model. *Declared*: kept and read back, or constant.

## Robotiq: variables of port 63352

A request is a line of ASCII. `SET POS 100 SPE 255 GTO 1` is answered with `ack`, three bytes without a
newline, or with `nak`; `GET POS` with `POS 100` and a newline, or with `?`.

| variable | access | range | meaning | here |
|---|---|---|---|---|
"""

_HERE = {
    "ACT": "exact; the activation takes 1.5 s and ends open",
    "GTO": "exact",
    "ATR": "exact",
    "ARD": "exact",
    "MOD": "declared",
    "POS": "exact; the width is linear in it",
    "SPE": "approximate: linear between the ends of the table",
    "FOR": "approximate: linear, the same at all widths",
    "MSC": "declared",
    "LBP": "declared",
    "LRD": "declared",
    "LBL": "declared",
    "LGN": "declared",
    "SCN_BLOCK": "declared",
    "MUTE": "declared",
    "TOOL": "declared",
    "PRE": "exact",
    "STA": "exact",
    "OBJ": "exact",
    "FLT": "exact for 0, 5, 7, 11, 13, 15; no others occur",
    "COU": "approximate: 100 mA while the fingers move, else 0",
    "NCY": "declared: 1",
    "SNU": "declared: a number that no real gripper has",
    "FWV": "declared",
    "VER": "declared",
    "DST": "declared: 4",
    "PCO": "declared: 0",
}

_REGISTERS = f"""\

`SID` selects the gripper of a connection and lists those that are there: exact.

## Robotiq: registers of the serial line

Functions 3, 4, 6, 16 and 23: exact. Registers {INPUTS:04X} to {INPUTS + 2:04X} are written and read
back, {OUTPUTS:04X} to {OUTPUTS + 15:04X} are read; others are refused with exception 2.

| register | high byte | low byte | here |
|---|---|---|---|
| {INPUTS:04X} | ACT bit 0, MOD 1, GTO 3, ATR 4, ARD 5 | 0 | exact; MOD declared |
| {INPUTS + 1:04X} | 0 | requested position | exact |
| {INPUTS + 2:04X} | speed | force | as SPE and FOR |
| {OUTPUTS:04X} | ACT bit 0, GTO 3, STA 4 and 5, OBJ 6 and 7 | 0 | exact |
| {OUTPUTS + 1:04X} | FLT | echo of the requested position | exact; kFLT 0 |
| {OUTPUTS + 2:04X} | position | current, 10 mA | as POS and COU |
| {OUTPUTS + 3:04X} - {OUTPUTS + 15:04X} | 0 | 0 | declared |
"""

_METHODS = """
## OnRobot: methods of port 41414

XML-RPC over HTTP, at any path: `http://HOST:41414/`.
The first number of a method is the place of the device: 0, or 1 and 2 of two. Other types are fault
-501, other names -506, what is no call -503.

| method | arguments | result | meaning | here |
|---|---|---|---|---|
"""

_METHODS_HERE = {
    "get_discovery": "approximate: serial number and messages are empty",
    "cb_report_robot_type": "declared: 0",
    "cb_reset_tool_power": "approximate: 1 s without supply",
    "rg_grip": "exact; speed and force approximate",
    "rg_calibration": "declared: 0, calibrates nothing",
    "rg_get_all_variables": "approximate: the names are chosen",
    "rg_get_busy": "approximate: until the motion ends",
    "rg_get_speed": "approximate: the unit is chosen",
    "rg_get_angle_speed": "approximate: the unit is chosen",
    "rg_get_relative_depth": "approximate: since the last command",
    **{f"rg_get_{name}": "declared: false" for name in STATUS[2:6]},
    "rg_get_safety_failed": "declared: true without power",
}

_ONROBOT_REGISTERS = """\

## OnRobot: registers of unit 65

Of two grippers units 66 and 67. Functions 3, 4, 6, 16 and 23: exact. All other registers from 0100 to
011F are read as 0; others are refused with exception 2.

| register | access | meaning | here |
|---|---|---|---|
| 0000 | w | force, 0.1 N | exact; beyond its range the nearest |
| 0001 | w | width, 0.1 mm | exact; beyond its range the nearest |
| 0002 | w | 1 grip (between the metal tips), 8 stop, 16 grip (between the fingertips) | exact |
| 0407 | w | thickness of a fingertip, 0.1 mm | exact |
| 0102 | r | thickness of a fingertip, signed | exact |
| 0107 | r | depth, 0.1 mm | exact |
| 0108 | r | relative depth | approximate: since the last command |
| 010B | r | width between the metal tips | exact |
| 010C | r | status: busy, grip, S1, S2, safety | as the methods |
| 0113 | r | width between the fingertips | exact |
| 0000 of unit 63 | w | 2: supply off and on | approximate: 1 s; port 502 only |

Registers of a 2FG and a VG10 are not there.
"""


def render() -> str:
    """Return the page."""
    rows = (_line(name, variable, _HERE[name]) for name, variable in VARIABLES.items())
    methods = (_method_line(name, *METHODS[name]) for name in METHODS)
    variables = _INTRODUCTION + "\n".join(rows) + "\n" + _REGISTERS
    return variables + _METHODS + "\n".join(methods) + "\n" + _ONROBOT_REGISTERS


def _method_line(name: str, result: str, arguments: str, meaning: str) -> str:
    here = "exact: not there" if name.startswith(("twofg", "vg10")) else _METHODS_HERE.get(name, "exact")
    return f"| {name} | {arguments.replace(' ', ', ')} | {result} | {meaning} | {here} |"


def _line(name: str, variable: Variable, here: str) -> str:
    most = "text" if variable.most is None else f"0 - {variable.most}"
    return f"| {name} | {variable.access.value} | {most} | {variable.meaning} | {here} |"
