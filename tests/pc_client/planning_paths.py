"""Small movements for planning tests: straight and circular min-jerk strokes in closed form."""

from __future__ import annotations

from math import pi

import numpy as np

from pc_client.experiment.experiment import Experiment
from pc_client.kinematics.model import robot_model
from pc_client.planning.plan import make_plan
from ur_hil.cell import NO_CELL


def min_jerk(u):
    """Return the way 0..1 and its derivative at u in 0..1."""
    return u**3 * (10 - 15 * u + 6 * u**2), 30 * u**2 * (1 - u) ** 2


class StraightStrokes:
    """Straight min-jerk strokes through points, at rest at each of them."""

    kind = "uniform"

    def __init__(self, points, stroke_time=1.0, name="strokes"):
        self.name = name
        self.target_points = np.array(points, dtype=float)
        self.stroke_time = stroke_time
        self.duration = stroke_time * (len(self.target_points) - 1)

    def sample(self, t):
        t = np.asarray(t, dtype=float)
        k = np.clip((t / self.stroke_time).astype(int), 0, len(self.target_points) - 2)
        done, rate = min_jerk(t / self.stroke_time - k)
        begin = self.target_points[k]
        chord = self.target_points[k + 1] - begin
        return begin + done[:, None] * chord, rate[:, None] / self.stroke_time * chord


class Arc:
    """A min-jerk turn on a circle around a centre, in the plane spanned by two unit vectors."""

    kind = "lognormal"

    def __init__(self, centre, radius, turn=2 * pi, duration=2.0, axes=((1, 0, 0), (0, 0, 1)), name="arc"):
        self.name, self.duration = name, duration
        self.centre, self.radius, self.turn = np.array(centre, dtype=float), radius, turn
        self.axes = np.array(axes, dtype=float)
        self.target_points = self.sample(np.array([0.0, duration]))[0]

    def sample(self, t):
        done, rate = min_jerk(np.asarray(t, dtype=float) / self.duration)
        angle, speed = self.turn * done, self.turn * rate / self.duration
        out = np.stack((np.cos(angle), np.sin(angle)), axis=1) @ self.axes
        along = np.stack((-np.sin(angle), np.cos(angle)), axis=1) @ self.axes
        return self.centre + self.radius * out, self.radius * speed[:, None] * along


class Spoiled:
    """Another movement with values overwritten: edit(t, p, v) changes the arrays in place."""

    def __init__(self, movement, edit):
        self.movement, self.edit = movement, edit
        self.name, self.kind, self.duration = movement.name, movement.kind, movement.duration
        self.target_points = movement.target_points

    def sample(self, t):
        p, v = self.movement.sample(t)
        self.edit(np.asarray(t), p, v)
        return p, v


INSIDE_THE_BOX = ((0.30, -0.15, 0.20), (0.40, 0.10, 0.30), (0.35, 0.18, 0.17), (0.29, 0.0, 0.34))
"""Points of the box recommended for a UR3 (.275-.425, -.2-.2, .15-.35 m)."""


def prepare_experiment(movements, *, repeat, out, cell=NO_CELL):
    """Plan movements for a UR3 in a cell."""
    model = robot_model("ur3", cell)
    return Experiment(model, tuple(make_plan(movement, model) for movement in movements), repeat, out)
