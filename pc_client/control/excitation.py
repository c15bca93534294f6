"""The small movement that reveals the loop delay: smooth pulses of velocity, out and back.

A JointReference like any other; the driver streams it without feedback, `delay` evaluates what came back.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi, sin

PEAK_SPEED = 0.12
"""Peak joint speed [rad/s]: far above encoder noise and friction's slow end, far below any limit."""

PULSE = 0.28
"""Length of one pulse [s]. A raised-cosine pulse moves PEAK_SPEED * PULSE / 2 = 0.0168 rad = 0.96 deg."""

N_PAIRS = 2
"""Pairs of a pulse out and a pulse back."""

# Neighbouring joints turn against each other, so that the TCP moves less than any joint alone would move it.
_SIGNS = (1.0, 1.0, -1.0, 1.0, -1.0, 1.0)


class Excitation:
    """Raised-cosine velocity pulses, out and back, around a start posture.

    Args:
        q_start: (6,) where the arm stands [rad].
    """

    __slots__ = ("_q_start",)

    def __init__(self, q_start: Sequence[float]) -> None:
        self._q_start = tuple(q_start)

    @property
    def duration(self) -> float:
        """Length of the excitation [s]."""
        return 2 * N_PAIRS * PULSE

    def at(self, t: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Positions (6,) [rad] and velocities (6,) [rad/s] at time t [s]; at rest outside the excitation."""
        if t <= 0.0 or t >= self.duration:
            return self._q_start, (0.0,) * 6
        n, tau = divmod(t, PULSE)
        w = 2.0 * pi / PULSE
        speed = 0.5 * PEAK_SPEED * (1.0 - cos(w * tau))
        way = 0.5 * PEAK_SPEED * (tau - sin(w * tau) / w)
        if int(n) % 2:  # the way back
            speed, way = -speed, 0.5 * PEAK_SPEED * PULSE - way
        q = tuple(q0 + sign * way for q0, sign in zip(self._q_start, _SIGNS, strict=True))
        return q, tuple(sign * speed for sign in _SIGNS)
