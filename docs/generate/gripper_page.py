"""The page docs/protocol/gripper.md, made from the variables of Robotiq's port."""

from __future__ import annotations

from protocol.robotiq import INPUTS, OUTPUTS, VARIABLES, Variable

_INTRODUCTION = """\
# Grippers: what is answered, and how well

Made from `protocol/robotiq.py` by `make docs`. [Grippers](../grippers.md) explains how they are used,
[fidelity.md](../fidelity.md) what was chosen. *Exact*: as sources describe a real one. *Approximate*:
the same kind of answer, from a simpler model. *Declared*: kept and read back, or constant.

## Robotiq: variables of port 63352

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


def render() -> str:
    """Return the page."""
    rows = (_line(name, variable, _HERE[name]) for name, variable in VARIABLES.items())
    return _INTRODUCTION + "\n".join(rows) + "\n" + _REGISTERS


def _line(name: str, variable: Variable, here: str) -> str:
    most = "text" if variable.most is None else f"0 - {variable.most}"
    return f"| {name} | {variable.access.value} | {most} | {variable.meaning} | {here} |"
