"""The signals of one movement: as planned, as planned but sampled and filtered, as executed.

The last two go through the same steps (sampled at the control cycle with some rest at both ends, filtered,
differentiated), so that they differ by what the robot did and by nothing else.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from pc_client.analysis.run import MeasuredRun
from pc_client.comparison.filtering import filtered_motion
from pc_client.control.loop_model import SAMPLING_TIME
from pc_client.movements.movement import Movement
from pc_client.movements.stroke import Motion

__all__ = ["PLAN_RATE", "Signal", "executed_signal", "filtered_signal", "planned_signal"]

#: Samples a second (Hz) of the plan: the rate of the reference figures.
PLAN_RATE = 1000.0
#: Rest (s) before and after a movement that is filtered with it.
_REST = 0.2


@dataclass(frozen=True, slots=True)
class Signal:
    """A movement as samples, from start to end.

    Attributes:
        t: (n,), s since its start.
        motion: each (n, 3).
        rate: samples a second, Hz.
    """

    t: NDArray[np.float64]
    motion: Motion
    rate: float

    @property
    def speed(self) -> NDArray[np.float64]:
        """(n,), m/s."""
        speed: NDArray[np.float64] = np.linalg.norm(self.motion.v, axis=1)
        return speed


def planned_signal(movement: Movement) -> Signal:
    """The movement's own closed form, at 1 kHz, unfiltered."""
    t = np.arange(math.floor(movement.duration * PLAN_RATE + 1e-6) + 1) / PLAN_RATE
    return Signal(t, movement.motion(t), PLAN_RATE)


def filtered_signal(movement: Movement, rate: float) -> Signal:
    """The plan as a perfect robot would report it, through the filter.

    Args:
        movement: what was planned.
        rate: of the control cycle, Hz.
    """
    t = _grid(movement.duration, rate)
    return _inner(t, filtered_motion(movement.sample(t).p, rate), movement.duration, rate)


def sampling_rate(run: MeasuredRun) -> float:
    """Samples a second of the track of a run, Hz."""
    return 1.0 / max(run.provenance.cycle_time_s, SAMPLING_TIME)


def executed_signal(run: MeasuredRun, duration: float) -> Signal:
    """What the robot did, through the filter.

    The window is that of the plan, later by the robot's lag, so that a late robot is not cut off.

    Args:
        run: a recording and what was measured on it.
        duration: of the movement, s.
    """
    rate = sampling_rate(run)
    t = _grid(duration, rate)
    at = t + run.track.t_begin + run.snr.speed_lag_s
    # Frames come on the same grid but for the lag, which is no whole number of cycles.
    p = CubicSpline(run.track.t, run.track.p_actual)(np.clip(at, run.track.t[0], run.track.t[-1]))
    return _inner(t, filtered_motion(p, rate), duration, rate)


def _grid(duration: float, rate: float) -> NDArray[np.float64]:
    before, after = round(_REST * rate), round((duration + _REST) * rate)
    return np.arange(-before, after + 1) / rate


def _inner(t: NDArray[np.float64], motion: Motion, duration: float, rate: float) -> Signal:
    moving = (t >= -1e-9) & (t <= duration + 1e-9)
    return Signal(t[moving], Motion(*(values[moving] for values in motion)), rate)
