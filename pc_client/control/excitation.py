"""The small movement that reveals the loop delay: smooth pulses of velocity, out and back.

A JointReference like any other; the driver streams it without feedback, `delay` evaluates what came back.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi, sin

DISPLACEMENT = 0.0168
"""Displacement of one pulse [rad]: 0.96 deg."""

PULSE = 0.28
"""Length of one pulse [s]: peak speed 0.12 rad/s, far above encoder noise and far below any limit."""

BRISK_PULSE = 0.12
"""The same displacement in less time: 0.28 rad/s, 7 rad/s2. It separates lag from delay; with
slow pulses friction, which delays the start of a joint, looks like a lag."""

_N_PAIRS = 2
"""Pairs of a pulse out and a pulse back."""

# Neighbouring joints turn against each other, so that the TCP moves less than any joint alone would move it.
_SIGNS = (1.0, 1.0, -1.0, 1.0, -1.0, 1.0)


class Excitation:
    """Raised-cosine velocity pulses, out and back, around a start posture.

    Args:
        q_start: (6,) where the arm stands [rad].
        pulse: length of one pulse [s].
    """

    __slots__ = ("_pulse", "_q_start")

    def __init__(self, q_start: Sequence[float], pulse: float = PULSE) -> None:
        self._q_start = tuple(q_start)
        self._pulse = pulse

    @property
    def duration(self) -> float:
        """Length of the excitation [s]."""
        return 2 * _N_PAIRS * self._pulse

    def at(self, t: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Positions (6,) [rad] and velocities (6,) [rad/s] at time t [s]; at rest outside the excitation."""
        if t <= 0.0 or t >= self.duration:
            return self._q_start, (0.0,) * 6
        n, tau = divmod(t, self._pulse)
        w = 2.0 * pi / self._pulse
        mean = DISPLACEMENT / self._pulse
        speed = mean * (1.0 - cos(w * tau))
        displacement = mean * (tau - sin(w * tau) / w)
        if int(n) % 2:  # back to the start
            speed, displacement = -speed, DISPLACEMENT - displacement
        q = tuple(q0 + sign * displacement for q0, sign in zip(self._q_start, _SIGNS, strict=True))
        return q, tuple(sign * speed for sign in _SIGNS)
