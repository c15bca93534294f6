"""SmoothPlan: a plan whose acceleration has no steps: the jerk is limited.

The length at a time is the mean of that of another plan over the time before it. So the path and its end stay
as they are, speed and acceleration do not become greater, and a step of the acceleration becomes a ramp.
"""

from __future__ import annotations

from bisect import bisect_right
from itertools import accumulate

from ur_emulator.motion.speed_plan import SpeedPlan


class SmoothPlan:
    """See the module; times as in SpeedPlan.

    Args:
        plan: from rest to rest.
        window: duration of the mean, in which the acceleration changes [s], above 0.

    Attributes:
        duration: when the end is reached.
    """

    def __init__(self, plan: SpeedPlan, window: float) -> None:
        self._plan = plan
        self._window = window
        self.duration = plan.duration + window
        ends = (*plan.times[1:], plan.duration)
        parts = [
            _area(phase.s, phase.v, phase.a, end - begin)
            for phase, begin, end in zip(plan.phases, plan.times, ends, strict=True)
        ]
        # Integral of the length over the time at the beginning of each phase, and at the end.
        self._areas = (0.0, *accumulate(parts))

    def at(self, t: float) -> tuple[float, float]:
        """Return length travelled and speed at a time; at rest at the end from the end on."""
        if t >= self.duration:
            return self._plan.length, 0.0
        before = t - self._window
        s0 = self._plan.at(before)[0] if before > 0.0 else 0.0
        s = self._plan.at(t)[0]
        return (self._area(t) - self._area(before)) / self._window, (s - s0) / self._window

    def _area(self, t: float) -> float:
        """Return the integral of the length from the beginning to a time [unit s]."""
        plan = self._plan
        if t <= 0.0:
            return 0.0
        if t >= plan.duration:
            return self._areas[-1] + plan.length * (t - plan.duration)
        k = max(0, bisect_right(plan.times, t) - 1)
        s, v, a = plan.phases[k]
        return self._areas[k] + _area(s, v, a, t - plan.times[k])


def _area(s: float, v: float, a: float, t: float) -> float:
    return (s + (0.5 * v + a * t / 6.0) * t) * t
