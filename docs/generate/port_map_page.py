"""The page docs/protocol/modbus.md, made from the tables of the robot's Modbus map."""

from __future__ import annotations

from docs.generate.page_parts import modes
from protocol.ur_types import JointMode, RobotMode, SafetyMode
from ur_emulator.machine.controller.modbus_map import COILS, REGISTERS, WORD_MAX, MapRow

_INTRODUCTION = """\
# Modbus TCP

Made from `ur_emulator/machine/controller/modbus_map.py` by `make docs`.

## The box as a server: port 502

The same in all versions of CB3 and e-Series software. Functions 1 and 2 read coils, 3 and 4
registers; 5 and 15 write coils, 6 and 16 registers. The unit number is ignored. Several clients can
connect at once. Scripts access the same map with `read_port_register` and similar functions.

A request is a number of your choice, 0, the number of bytes that follow (16 bits each, big-endian),
a unit and a function (a byte each), then what the function takes; the answer repeats the number,
unit and function, with 0x80 added to the function for an exception. Reading the six registers from
400 on, and its answer at (-300.0, 87.2, 412.5) mm and (0, 3.142, 0) rad:

```text
00 01 00 00 00 06 ff 03 01 90 00 06
00 01 00 00 00 0f ff 03 0c f4 48 03 68 10 1d 00 00 0c 46 00 00
```

| refused | exception |
|---|---|
| another function | 1 |
| an address that does not exist, or a write to a read-only address; nothing is written then | 2 |
| no address, or more than 125 registers or 2000 coils (to write: 123, 1968) | 3 |
| sizes that do not match, a coil that is neither 0xFF00 nor 0 | 3 |

A write acts in the next control cycle and is answered after it, so that a client reads back the
written value. Data that is not Modbus ends the connection. Port 502 needs privileges on most
systems: without them `ur-emulator serve` reports this in one line and serves all other ports.
`--port-base N` moves this port too.
"""

_SCALES = f"""\
### Registers

A register is a word of 16 bits, rounded to the unit that the table gives: 3142 mrad are 3.142 rad.
Values that may be negative are signed, in two's complement: velocities, currents, temperatures,
turns, pose, speed and offset of the TCP. Words of bits, angles, levels and the clock are unsigned.

* The position of a joint is 2 pi times its turns (320) plus its angle (270), which is 0 to 6283 mrad.
* The TCP of 0.1 mm: 4125 in register 402 is z = 412.5 mm. The offset of the TCP is in whole mm.
* A part of a range is 0 to {WORD_MAX}: from 4 to 20 mA in the domain current, from 0 to 10 V in the
  domain voltage. {WORD_MAX // 2} is 12 mA or 5 V.
* A word of outputs (1, 31) sets all of them; those to set and to clear (2, 3, 32, 33) take the bits
  that shall change.
"""

_CLIENT = """\
## The box as a client: signals of scripts

`modbus_add_signal("192.168.0.7", 255, 16, 1, "valve")` connects to a unit, here on port 502;
`"192.168.0.7:1502"` names another port.

| signal type | read with | written with |
|---|---|---|
| 0 digital input | 2 | |
| 1 digital output | 1, until a program has set it | 5 |
| 2 register input | 4 | |
| 3 register output | 3, until a program has set it | 6 |

Signals are refreshed at their frequency (10 Hz, or the value of
`modbus_set_signal_update_frequency`) in robot time, and keep their last value meanwhile. Each unit
has one connection, which is opened again after it breaks. If no valid answer has come for 2 s, the
next use of the signal is a run-time error with the reason. In lockstep nothing waits for a unit:
the cycle in which a value arrives is not fixed. [fidelity.md](../fidelity.md) lists the choices.
"""


def render() -> str:
    """Return the page."""
    return "\n".join(
        (
            _INTRODUCTION,
            _SCALES,
            *_table(REGISTERS),
            "\n### Coils\n",
            *_table(COILS),
            "",
            *modes(RobotMode, JointMode, SafetyMode),
            _CLIENT.rstrip() + "\n",
        )
    )


def _table(rows: tuple[MapRow, ...]) -> list[str]:
    return ["| address | content | access |", "|---|---|---|", *map(_line, rows)]


def _line(row: MapRow) -> str:
    last = row.first + row.count - 1
    where = f"{row.first}" if last == row.first else f"{row.first} - {last}"
    # What gives no value can be read all the same, as 0.
    access = ("R" if row.read or not row.write else "") + ("W" if row.write else "")
    return f"| {where} | {row.meaning} | {access} |"
