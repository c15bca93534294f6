"""MapMemory: the words of the robot's Modbus map that are not part of the state of the box."""

from __future__ import annotations

# General purpose words, for scripts and Modbus clients. Source: UR "Modbus server" article.
FIRST_GENERAL = 128
N_GENERAL = 128


class MapMemory:
    """Words that keep what is written, and the clock as it was latched.

    Attributes:
        words: the general purpose ones, 0 to 65535.
        latched_tick: when the clock was latched.
        version: of the software, major and minor.
    """

    __slots__ = ("latched_tick", "version", "words")

    def __init__(self, version: tuple[int, int]) -> None:
        self.version = version
        self.words = [0] * N_GENERAL
        self.latched_tick = 0

    def write(self, offset: int, word: int) -> None:
        """Write a general purpose word."""
        self.words[offset] = word

    def latch_clock(self, tick: int) -> None:
        """Store a time, in cycles."""
        self.latched_tick = tick
