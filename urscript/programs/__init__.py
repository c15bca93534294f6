"""Programs for the arm that come with this package, as text with the client's values filled in.

They are ordinary URScript for a CB3 3.15: nothing in them is special to this interpreter.
"""

from __future__ import annotations

import re
from importlib.resources import files

_ADDRESS = re.compile(r"[0-9A-Za-z.:-]+")


def velocity_receiver(
    host: str,
    port: int,
    *,
    acceleration: float = 20.0,
    stop_deceleration: float = 20.0,
    read_timeout: float = 1.0,
    missed_allowed: int = 1,
) -> str:
    """The program that lets a PC stream joint velocities.

    Args:
        host: Address of the PC as the robot reaches it.
        port: TCP port the PC listens on.
        acceleration: Of the leading axis towards a new set-point, rad/s^2.
        stop_deceleration: Of the leading axis when ramping to rest, rad/s^2.
        read_timeout: Silence of the PC after which the program ends, s.
        missed_allowed: Cycles without a message in which the last set-point is repeated.

    Raises:
        ValueError: A value that cannot stand in the program.
    """
    if not _ADDRESS.fullmatch(host):
        raise ValueError(f"{host!r} is no address; give a name or a number such as 192.168.0.10")
    if not 0 < port < 65536:
        raise ValueError(f"port {port} is out of range, allowed are 1 to 65535")
    for name, value in (
        ("acceleration", acceleration),
        ("stop_deceleration", stop_deceleration),
        ("read_timeout", read_timeout),
    ):
        if not 0 < value < 1000:
            raise ValueError(f"{name} {value} is out of range, allowed are positive numbers below 1000")
    if missed_allowed < 0:
        raise ValueError(f"missed_allowed {missed_allowed} is negative")
    text = files("urscript.programs").joinpath("velocity_receiver.script").read_text(encoding="ascii")
    text = _fill_in(text, "pc_address", f'"{host}"')
    text = _fill_in(text, "pc_port", str(port))
    text = _fill_in(text, "acceleration", repr(float(acceleration)))
    text = _fill_in(text, "stop_deceleration", repr(float(stop_deceleration)))
    text = _fill_in(text, "read_timeout", repr(float(read_timeout)))
    return _fill_in(text, "missed_allowed", str(int(missed_allowed)))


def _fill_in(text: str, name: str, value: str) -> str:
    """Replace the value in the one line `name = value  # <- client`."""
    line = re.compile(rf"^(\s+{name} = )\S+(\s+# <- client)$", re.MULTILINE)
    filled, count = line.subn(lambda match: f"{match[1]}{value}{match[2]}", text)
    if count != 1:
        raise ValueError(f"velocity_receiver.script has {count} lines to fill in for '{name}', not one")
    return filled
