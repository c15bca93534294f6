"""The page docs/protocol/modbus.md, made from the tables of the robot's Modbus map."""

from __future__ import annotations

from ur_emulator.controller.modbus_map import COILS, REGISTERS, MapRow

_INTRODUCTION = """\
# Modbus TCP

Made from `ur_emulator/controller/modbus_map.py` by `make docs`.

## The box as a server: port 502

The same in all versions of CB3 and e-Series software. Functions 1 and 2 read coils, 3 and 4
registers; 5 and 15 write coils, 6 and 16 registers. The unit number is ignored. Several clients can
connect at once. Scripts access the same map with `read_port_register` and similar functions.
A register is a word of 16 bits; signed values are in two's complement.

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
            "### Registers\n",
            *_table(REGISTERS),
            "\n### Coils\n",
            *_table(COILS),
            "",
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
