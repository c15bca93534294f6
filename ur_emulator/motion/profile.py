"""The trapezoidal speed profile of one move: a pure function of time.

Source: URScript manual CB3 3.15, movej and movel: "trapezoidal speed profile", constant acceleration `a` up
to speed `v`. Blends make the ends of a profile move as well.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Trapezoid:
    """Travel over a distance: accelerate, cruise, decelerate.

    Attributes:
        distance: length of the travel, >= 0 [m or rad].
        acceleration: slope of both ramps, > 0 [unit/s^2].
        cruise_speed: highest speed reached [unit/s]; below the speed asked for if the travel is short.
        ramp_time: duration of the ramp up [s].
        duration: duration of the travel [s].
        entry_speed: speed at the start [unit/s]; 0 for a start from rest.
        exit_speed: speed at the end [unit/s]; 0 for an end at rest.
    """

    distance: float
    acceleration: float
    cruise_speed: float
    ramp_time: float
    duration: float
    entry_speed: float = 0.0
    exit_speed: float = 0.0

    @classmethod
    def from_limits(
        cls, distance: float, speed: float, acceleration: float, entry: float = 0.0, leave: float = 0.0
    ) -> Trapezoid:
        """Return the fastest profile under a speed and an acceleration limit.

        Args:
            distance: length of the travel, >= 0.
            speed: speed limit, > 0.
            acceleration: acceleration limit, > 0.
            entry: speed at the start, <= `speed`.
            leave: speed at the end, <= `speed`, within reach of `entry` over the distance.

        Raises:
            ValueError: a limit is not positive.
        """
        if not (speed > 0.0 and acceleration > 0.0):
            raise ValueError(f"speed {speed:g} and acceleration {acceleration:g} must both be above 0")
        # Without a limit the speed would rise until it must fall again.
        peak = math.sqrt(distance * acceleration + 0.5 * (entry * entry + leave * leave))
        peak = max(min(speed, peak), entry, leave)
        up, down = (peak - entry) / acceleration, (peak - leave) / acceleration
        ramps = 0.5 * (up * (peak + entry) + down * (peak + leave))
        cruise = max(0.0, distance - ramps) / peak if peak > 0.0 else 0.0
        return cls(distance, acceleration, peak, up, up + cruise + down, entry, leave)

    @classmethod
    def from_duration(cls, distance: float, duration: float, like: Trapezoid) -> Trapezoid:
        """Return the rest-to-rest profile `like` stretched in time so that the travel takes `duration`.

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
            return 0.0, self.entry_speed, 0.0
        if t >= self.duration:
            return self.distance, self.exit_speed, 0.0
        if t < self.ramp_time:
            return (
                (self.entry_speed + 0.5 * self.acceleration * t) * t,
                self.entry_speed + self.acceleration * t,
                self.acceleration,
            )
        left = self.duration - t
        if left < (self.cruise_speed - self.exit_speed) / self.acceleration:
            return (
                self.distance - (self.exit_speed + 0.5 * self.acceleration * left) * left,
                self.exit_speed + self.acceleration * left,
                -self.acceleration,
            )
        ramp = 0.5 * (self.entry_speed + self.cruise_speed) * self.ramp_time
        return ramp + self.cruise_speed * (t - self.ramp_time), self.cruise_speed, 0.0
