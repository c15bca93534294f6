"""Movements to extract from: own strokes with known parameters, the drawings of the tree, those of people."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest

from pc_client.movements.lognormal import TwoSidedTiming
from pc_client.movements.sigma_lognormal import SigmaLognormal, Stroke
from pc_client.studies.extraction.pen import PenPart, PenRecording

DRAWINGS = Path(__file__).parents[2] / "examples" / "drawings"
DRAWINGS_OF_PEOPLE = os.environ.get("OMNIGLOT")

needs_omniglot = pytest.mark.skipif(
    not DRAWINGS_OF_PEOPLE,
    reason="OMNIGLOT=PATH gives its strokes_background_small1.zip, which is not in the tree",
)


def own_strokes(seed, dim, n=5, stroke_time=1.0, overlap=0.4):
    """A movement of n overlapping strokes, sigma .1 to .3, arcs of up to 1.5 rad, in the plane or in space."""
    rng = np.random.default_rng(seed)
    start, strokes = 0.0, []
    for sigma in rng.uniform(0.1, 0.3, n):
        duration = stroke_time * rng.uniform(0.85, 1.15)
        timing = TwoSidedTiming(start, duration, sigma, 3.0).lognormal
        # Tilt 90 degrees about a level chord: the plane of the arc is the xy plane.
        strokes.append(
            Stroke(timing, rng.uniform(-1.5, 1.5), rng.uniform(-1.0, 1.0) if dim == 3 else math.pi / 2)
        )
        start += duration * (1.0 - overlap)
    heading = np.cumsum(rng.uniform(0.6, 2.2, n) * rng.choice([-1.0, 1.0], n))
    rise = rng.uniform(-0.7, 0.7, n) if dim == 3 else np.zeros(n)
    steps = np.column_stack((np.cos(heading), np.sin(heading), rise)) * rng.uniform(60.0, 140.0, n)[:, None]
    targets = np.vstack((np.zeros(3), np.cumsum(steps, axis=0)))
    return SigmaLognormal(targets, tuple(strokes), start + stroke_time)


def recorded(trajectory, dim, rate=200.0, noise=0.0, seed=0):
    """The movement as a recording that begins and ends at rest.

    Noise is that of the velocity, white, as a share of its rms.
    """
    t = np.arange(-0.3, trajectory.duration + 0.3, 1.0 / rate)
    motion = trajectory.evaluate(t)
    rms = math.sqrt(float(np.mean(np.sum(motion.v**2, axis=1))))
    shaken = np.random.default_rng(seed).normal(size=(len(t), dim)) * noise * rms / math.sqrt(dim)
    return PenRecording("own", (PenPart(t, motion.p[:, :dim] + np.cumsum(shaken, axis=0) / rate),))
