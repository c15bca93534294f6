"""What the robot's Modbus map holds of its own, beside the state that it shows."""

from __future__ import annotations

from dataclasses import dataclass, field

# General purpose words, for scripts and Modbus clients. Source: UR "Modbus server" article.
FIRST_GENERAL = 128
N_GENERAL = 128


@dataclass(slots=True)
class PortMemory:
    """Words that keep what is written.

    Attributes:
        words: the general purpose ones, 0 to 65535.
        latched_tick: when the clock was latched.
        version: of the software, major and minor.
    """

    words: list[int] = field(default_factory=lambda: [0] * N_GENERAL)
    latched_tick: int = 0
    version: tuple[int, int] = (3, 15)
