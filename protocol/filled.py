"""Where the emulated box takes a value from: the mark that every table of the wire puts on its values."""

from __future__ import annotations

from enum import Enum

__all__ = ["Filled"]


class Filled(Enum):
    """Where the emulated box takes a value from."""

    MEASURED = "measured"
    """From the simulated arm through its simulated sensors: delay, noise and dead band included."""
    MODELLED = "modelled"
    """Computed in the box: set-points, kinematics of measured joints, estimates, states of its machines."""
    PROPERTY = "of this arm"
    """From the numbers of the arm, its type or its calibration: the same as long as the box lives."""
    CONSTANT = "constant"
    """A plausible fixed value; nothing is simulated behind it."""
    INTERNAL_ZERO = "internal, zero"
    """Meaning unpublished; always sent as 0, and clients ignore it."""
