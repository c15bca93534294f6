"""The dead time of an arm's drives: drawn once a box, or another one every cycle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ur_emulator.models.fidelity import Fidelity
from ur_emulator.models.random_streams import random_stream
from ur_emulator.models.robot_generation import RobotGeneration

_WANDER_LEVELS = 64
"""A dead time that wanders goes through so many values: steps of 30 us for 2 ms."""


@dataclass(frozen=True, slots=True)
class DeadTime:
    """From the start of a cycle to the drives acting on its target.

    Attributes:
        least_s: where it wanders, its least value [s].
        substeps: in steps of the physics; several values take turns, one a cycle.
    """

    least_s: float
    substeps: int | list[float]


def draw_dead_time(fidelity: Fidelity, seed: int, generation: RobotGeneration) -> DeadTime:
    """Draw the dead time of a box.

    Args:
        fidelity: its range.
        seed: of the box.
        generation: has the cycle and the physics step.
    """
    substep = generation.substep_us * 1e-6
    spread = fidelity.dead_time_spread * float(random_stream(seed, "delay").uniform())
    least = int((fidelity.dead_time + spread) / substep + 1e-9)
    if not fidelity.dead_time_wander:
        return DeadTime(least * substep, least)
    n = round(fidelity.dead_time_period / generation.period_s)
    begin = random_stream(seed, "wander").uniform()
    share = 0.5 - 0.5 * np.cos(2.0 * np.pi * (begin + np.arange(n) / n))
    levels = np.rint(share * _WANDER_LEVELS) / _WANDER_LEVELS
    return DeadTime(least * substep, (least + fidelity.dead_time_wander / substep * levels).tolist())
