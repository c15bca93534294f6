"""Thermometers: joint temperatures that follow the heat of the motors; deterministic.

Source: production log of a UR3 (UCI "UR3 CobotOps"): 28 to 45 °C, wrists hottest. Time constant and heat per
current are assumed.
"""

from collections.abc import Sequence
from math import exp

from ur_emulator.machine.models.robot_generation import RobotGeneration
from ur_emulator.machine.models.robot_model import Vector6, six

_RISE: Vector6 = (0.25, 0.25, 0.5, 0.8, 0.8, 0.8)  # °C per A²
_LARGEST_RISE = 20.0  # °C
_TIME_CONSTANT = 900.0  # s
_INTERVAL = 1.0  # s between updates
_STEPS_PER_DEGREE = 16.0


class Thermometers:
    """Six thermometers; `reading` has their values [°C]."""

    def __init__(self, generation: RobotGeneration) -> None:
        period, self._idle = generation.period_s, generation.electrics.joint_temperatures
        self._every = max(1, round(_INTERVAL / period))
        self._gain = 1.0 - exp(-self._every * period / _TIME_CONSTANT)
        self._countdown = self._every
        self._exact = list(self._idle)
        self.reading = self._idle

    def step(self, current: Sequence[float]) -> None:
        """Advance by one cycle with these motor currents (6,) [A]."""
        self._countdown -= 1
        if self._countdown:
            return
        self._countdown = self._every
        for i, amperes in enumerate(current):
            final = self._idle[i] + min(_LARGEST_RISE, _RISE[i] * amperes * amperes)
            self._exact[i] += self._gain * (final - self._exact[i])
        self.reading = six([round(_STEPS_PER_DEGREE * value) / _STEPS_PER_DEGREE for value in self._exact])
