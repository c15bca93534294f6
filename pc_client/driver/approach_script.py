"""The short programs that we write ourselves: move to a posture, stop the arm. Text only."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, pi

from pc_client.errors import DriverError

APPROACH_NAME = "ur_client_approach"
STOP_DECELERATION = 2.0
"""[rad/s2] of the stop program: firm, without jerking the base. Source: ur_rtde's default for stopJ."""

STOP_WORD = "stop program\n"
"""A controller's own word, no program: ends what runs or is paused. Source: public client library."""

_FASTEST_APPROACH = 1.05
"""[rad/s], PolyScope's default speed of movej (60 deg/s): an approach is never faster."""


def approach_script(q: Sequence[float], speed: float, acceleration: float) -> str:
    """A program that moves the joints straight to a posture and ends.

    Args:
        q: (6,) where to [rad].
        speed: of the joint with the longest way [rad/s].
        acceleration: of the same joint [rad/s2].

    Raises:
        DriverError: not six finite angles within two turns, or not a slow speed.
    """
    angles = [float(angle) for angle in q]
    if len(angles) != 6 or not all(isfinite(angle) and abs(angle) <= 2.0 * pi for angle in angles):
        raise DriverError(f"cannot move to {angles}: give six joint angles within +-2 pi rad")
    if not (0.0 < speed <= _FASTEST_APPROACH and 0.0 < acceleration <= 2.0):
        raise DriverError(
            f"an approach with {speed} rad/s and {acceleration} rad/s2 is not slow: "
            f"use at most {_FASTEST_APPROACH} rad/s and 2 rad/s2"
        )
    goal = ", ".join(f"{angle:.9f}" for angle in angles)
    return f"def {APPROACH_NAME}():\n  movej([{goal}], a={acceleration:.4f}, v={speed:.4f})\nend\n"


def stop_script() -> str:
    """A program that replaces whatever runs and brings the arm to rest."""
    return f"def ur_client_stop():\n  stopj({STOP_DECELERATION})\nend\n"
