"""Driving a plant in tests: holding, speed ramps, smooth moves; and link frames by the textbook."""

from __future__ import annotations

import numpy as np

from ur_emulator.machine.models.cb3_arms import UR3
from ur_emulator.machine.motion.generators import JointTarget

PERIOD = 0.008
ZERO = (0.0,) * 6
HOME = np.array(UR3.home_q)


def target(q, qd=ZERO, qdd=ZERO):
    return JointTarget(tuple(map(float, q)), tuple(map(float, qd)), tuple(map(float, qdd)))


def dh_frames(rows, q):
    """Frames of all links by plain matrix products, (n, 4, 4)."""
    frame, frames = np.eye(4), []
    for row, angle in zip(rows, q, strict=True):
        c, s = np.cos(angle + row.theta), np.sin(angle + row.theta)
        ca, sa = np.cos(row.alpha), np.sin(row.alpha)
        frame = frame @ np.array(
            [
                [c, -s * ca, s * sa, row.a * c],
                [s, c * ca, -c * sa, row.a * s],
                [0, sa, ca, row.d],
                [0, 0, 0, 1],
            ]
        )
        frames.append(frame)
    return np.array(frames)


def hold(plant, q, n):
    """Hold joint angles q for n cycles; the states of every cycle."""
    states = []
    for _ in range(n):
        plant.step(target(q))
        states.append(plant.sense())
    return states


class SpeedRamp:
    """Targets as speedj makes them: linear acceleration to a speed, positions integrated from it."""

    def __init__(self, q, acceleration=5.0):
        self.q = np.array(q, dtype=float)
        self.qd = np.zeros(6)
        self.acceleration = acceleration

    def next(self, speed):
        change = self.acceleration * PERIOD
        qd = np.clip(np.broadcast_to(speed, 6), self.qd - change, self.qd + change)
        qdd = (qd - self.qd) / PERIOD
        self.q = self.q + 0.5 * (qd + self.qd) * PERIOD
        self.qd = qd
        return target(self.q, qd, qdd)

    def run(self, plant, speed, n):
        """Run n cycles towards a speed (scalar or (6,)); targets q (n, 6) and the states."""
        targets, states = [], []
        for _ in range(n):
            plant.step(self.next(speed))
            targets.append(self.q)
            states.append(plant.sense())
        return np.array(targets), states


def column(states, name):
    return np.array([getattr(state, name) for state in states])
