"""The control cycle: its length, and the tick at which a box begins to serve."""

from __future__ import annotations

PERIOD_US = 8_000  # control cycle of a CB3: 125 Hz
# A box that serves has booted a minute ago: clients distrust a controller clock below 40 s (public client
# library).
BOOT_TICK = 60 * 1_000_000 // PERIOD_US


def controller_time(tick: int) -> float:
    """Return the seconds since controller start at a tick, without an accumulated rounding error."""
    return tick * PERIOD_US / 1e6
