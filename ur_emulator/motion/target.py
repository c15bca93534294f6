"""The joint target: what the controller wants of the arm at the end of a cycle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

Vector6 = tuple[float, float, float, float, float, float]

ZERO6: Vector6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def vector6(values: Sequence[float]) -> Vector6:
    """Return six floats as a tuple of Python floats.

    Raises:
        ValueError: not exactly six values.
    """
    a, b, c, d, e, f = values
    return (float(a), float(b), float(c), float(d), float(e), float(f))


class JointTarget(NamedTuple):
    """Set-point of all joints at the end of a control cycle.

    Attributes:
        q: joint positions [rad].
        qd: joint velocities [rad/s].
        qdd: joint accelerations during the cycle [rad/s^2].
    """

    q: Vector6
    qd: Vector6 = ZERO6
    qdd: Vector6 = ZERO6

    def at_rest(self) -> JointTarget:
        """Return the same position without motion."""
        return JointTarget(self.q)
