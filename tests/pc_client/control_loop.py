"""A hand-made arm for the control tests: integrates velocities after a delay and a first-order lag."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np

from pc_client.control.controller import CONTROLLERS
from pc_client.control.loop import LoopModel
from pc_client.control.reference import RunRecipe

PERIOD = 0.008


def recipe(lookahead=None, lag=0.0, period=PERIOD):
    """Of a reference without feed-forward ahead, or ahead by so much [s]."""
    config = replace(CONTROLLERS["preview"], uses_preview=lookahead is not None, compensates_lag=True)
    return RunRecipe(config, LoopModel(lookahead or 0.0, lag, None, 0.0), period)


class DelayedArm:
    """Six joints; `advance(qd)` applies one command and moves one cycle.

    A command shows in `q` after `cycles` further cycles, through a lag of `lag` seconds.
    """

    def __init__(self, q, *, cycles=0, lag=0.0, period=PERIOD):
        self.q = np.array(q, dtype=float)
        self.qd = np.zeros(6)
        self.period = period
        self._pipe = deque([np.zeros(6)] * cycles)
        self._keep = np.exp(-period / lag) if lag > 0 else 0.0
        self._lag = lag

    def advance(self, qd):
        self._pipe.append(np.array(qd, dtype=float))
        target = self._pipe.popleft()
        before = self.qd
        self.qd = target + (before - target) * self._keep
        # exact integral of the exponential over the cycle
        self.q = self.q + target * self.period + (before - target) * self._lag * (1.0 - self._keep)


class Ramp:
    """A reference of constant velocity."""

    def __init__(self, qd, duration, q0=None):
        self.qd = np.array(qd, dtype=float)
        self.q0 = np.zeros(6) if q0 is None else np.array(q0, dtype=float)
        self.duration = duration

    def at(self, t):
        inside = 0.0 < t < self.duration
        t = min(max(t, 0.0), self.duration)
        return self.q0 + self.qd * t, self.qd if inside else np.zeros(6)
