"""The trapezoidal speed profile of one move: a pure function of time.

Source: URScript manual CB3 3.15, movej and movel: "trapezoidal speed profile", constant acceleration `a` up
to speed `v`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Trapezoid:
    """Rest-to-rest travel over a distance: accelerate, cruise, decelerate.

    Attributes:
        distance: length of the travel, >= 0 [m or rad].
        acceleration: slope of both ramps, > 0 [unit/s^2].
        cruise_speed: highest speed reached [unit/s]; below the speed asked for if the travel is short.
        ramp_time: duration of each ramp [s].
        duration: duration of the travel [s].
    """

    distance: float
    acceleration: float
    cruise_speed: float
    ramp_time: float
    duration: float

    @classmethod
    def from_limits(cls, distance: float, speed: float, acceleration: float) -> Trapezoid:
        """Return the fastest profile under a speed and an acceleration limit.

        Args:
            distance: length of the travel, >= 0.
            speed: speed limit, > 0.
            acceleration: acceleration limit, > 0.

        Raises:
            ValueError: a limit is not positive.
        """
        if not (speed > 0.0 and acceleration > 0.0):
            raise ValueError(f"speed {speed:g} and acceleration {acceleration:g} must both be above 0")
        if distance * acceleration >= speed * speed:
            ramp = speed / acceleration
            return cls(distance, acceleration, speed, ramp, distance / speed + ramp)
        ramp = math.sqrt(distance / acceleration)
        return cls(distance, acceleration, acceleration * ramp, ramp, 2.0 * ramp)

    @classmethod
    def from_duration(cls, distance: float, duration: float, like: Trapezoid) -> Trapezoid:
        """Return `like` stretched in time so that the travel takes `duration`.

        The manual only says that `t` has priority over `a` and `v`; keeping the shape of the profile is our
        reading.

        Args:
            distance: length of the travel, >= 0.
            duration: time to take [s], > 0.
            like: profile whose ratio of ramp to duration is kept.
        """
        if distance == 0.0 or like.duration == 0.0:
            return cls(distance, like.acceleration, 0.0, 0.0, duration)
        scale = duration / like.duration
        return cls(
            distance,
            like.acceleration / scale**2,
            like.cruise_speed / scale,
            like.ramp_time * scale,
            duration,
        )

    def at(self, t: float) -> tuple[float, float, float]:
        """Return travelled distance, speed and acceleration at time `t` [s] after the start."""
        if t <= 0.0:
            return 0.0, 0.0, 0.0
        if t >= self.duration:
            return self.distance, 0.0, 0.0
        if t < self.ramp_time:
            return 0.5 * self.acceleration * t * t, self.acceleration * t, self.acceleration
        left = self.duration - t
        if left < self.ramp_time:
            return (
                self.distance - 0.5 * self.acceleration * left * left,
                self.acceleration * left,
                -self.acceleration,
            )
        return self.cruise_speed * (t - 0.5 * self.ramp_time), self.cruise_speed, 0.0
