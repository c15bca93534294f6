"""The first strokes of a part: one for each interval between speed minima, by closed forms.

The minima are the salient points; in time they divide the part into intervals, in space they are the first
virtual targets. The heights of the inflections (2, 4) and of the peak (3) give sigma, by one formula each,
and with sigma their times the rest; docs/extraction.md, section 4, has the equations. Of the
candidates the one that fits the measured speed best is taken; the arc angle is from the directions at the
inflections. Their errors, overlap above all, are corrected by the joint refinement.

Source: segmentation of iDeLog (Ferrer et al., IEEE TPAMI 42 (2020)), parameters of Robust XZERO (O'Reilly &
Plamondon, Pattern Recognition 42 (2009)).
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid, trapezoid
from scipy.signal import find_peaks

from pc_client.arrays import Array
from pc_client.movements.lognormal import Lognormal, evaluate_lognormals
from pc_client.studies.extraction.chain import Bounds, Chain, normals_across
from pc_client.studies.signals import Trace

#: Peaks that stand out by less than this share of the top speed are ripples on their neighbours at first;
#: strokes for those that deserve one are added where the refined residual is worst.
_RIPPLE = 0.05
#: Sigma of a speed profile whose shape says nothing: the middle of what is found in handwriting.
TYPICAL_SIGMA = 0.2
#: Peak speed times width over length of a speed profile, 1 / sqrt(2 pi), nearly for every sigma.
_PEAK_WIDTH = 1.0 / math.sqrt(2.0 * math.pi)
#: Largest arc angle that a first guess may have, rad.
_MAX_FIRST_TURN = 2.5


def salient_points(part: Trace) -> NDArray[np.intp]:
    """Indices (n_intervals + 1,) that divide a part: its first sample, the speed minima, its last sample."""
    speed = part.speed
    peaks, _ = find_peaks(speed, prominence=_RIPPLE * float(speed.max()))
    minima = [a + int(np.argmin(speed[a:b])) for a, b in pairwise(peaks)]
    return np.array([0, *minima, len(speed) - 1])


def initial_chain(part: Trace) -> Chain:
    """One stroke for each interval."""
    marks = salient_points(part)
    speed = part.speed
    path_length = cumulative_trapezoid(speed, dx=part.step, initial=0.0)
    first = [_timing(part.t[a : b + 1], speed[a : b + 1]) for a, b in pairwise(marks)]
    median, width, sigma = np.array(first).T
    targets = part.p[marks]
    vectors = np.array([_arc_angle(part, path_length, a, b) for a, b in pairwise(marks)])
    if targets.shape[1] == 2:
        up = np.tile([0.0, 0.0, 1.0], (len(vectors), 1))
        return Chain(median, width, sigma, vectors[:, 2], up, targets)
    sizes = np.linalg.norm(vectors, axis=1)
    normals = np.where(sizes[:, None] > 1e-6, vectors, [0.0, 0.0, 1.0])
    return Chain(median, width, sigma, sizes, normals_across(np.diff(targets, axis=0), normals), targets)


def _timing(t: Array, speed: Array) -> tuple[float, float, float]:
    """Median, width and sigma for a speed profile between two minima: the best of the candidates."""
    candidates = [_by_area(t, speed), *_by_closed_forms(t, speed)]
    errors = []
    for median, width, sigma in candidates:
        shape = evaluate_lognormals(t, median - width / sigma, math.log(width / sigma), sigma).rate
        power = float(shape @ shape)
        scale = float(shape @ speed) / power if power > 0.0 else 0.0
        errors.append(float(np.sum((speed - scale * shape) ** 2)))
    return candidates[int(np.argmin(errors))]


def _by_area(t: Array, speed: Array) -> tuple[float, float, float]:
    """The lognormal with the area and the peak of the measured speed profile; it always exists."""
    top = int(np.argmax(speed))
    area = float(trapezoid(speed, dx=float(t[1] - t[0])))
    peak = float(speed[top])
    width = _clipped(_PEAK_WIDTH * area / peak if peak > 0.0 else 0.0, Bounds().width)
    return float(t[top]) + width * TYPICAL_SIGMA, width, TYPICAL_SIGMA


def _by_closed_forms(t: Array, speed: Array) -> list[tuple[float, float, float]]:
    points = characteristic_points(t, speed)
    if points is None:
        return []
    v2, v3, v4 = points.speeds
    sigmas = sigma_from_peak_ratio(v2 / v3), sigma_from_peak_ratio(v4 / v3), sigma_from_slope_ratio(v4 / v2)
    found = []
    for sigma in sigmas:
        lognormal = lognormal_from_points(points, _clipped(sigma, Bounds().sigma))
        width = _clipped(math.exp(lognormal.mu) * lognormal.sigma, Bounds().width)
        found.append((lognormal.median, width, lognormal.sigma))
    return found


def _arc_angle(part: Trace, path_length: Array, a: int, b: int) -> Array:
    """Arc angle of the stroke between two salient points as a vector along its axis, (3,), rad."""
    length = float(path_length[b] - path_length[a])
    if length <= 0.0:
        return np.zeros(3)
    # A quarter and three quarters of the length stand for the inflections: they always exist.
    i, k = np.searchsorted(path_length, (path_length[a] + 0.25 * length, path_length[a] + 0.75 * length))
    v = np.zeros((2, 3))
    v[:, : part.v.shape[1]] = part.v[[i, min(k, len(part.v) - 1)]]
    axis = np.cross(v[0], v[1])
    size = float(np.linalg.norm(axis))
    if size == 0.0 or path_length[k] <= path_length[i]:
        return np.zeros(3)
    angle = math.atan2(size, float(v[0] @ v[1]))
    total = angle / (float(path_length[k]) - float(path_length[i])) * length
    return min(total, _MAX_FIRST_TURN) * axis / size


def _clipped(value: float, bounds: tuple[float, float]) -> float:
    return min(max(value, bounds[0]), bounds[1])


class CharacteristicPoints(NamedTuple):
    """Times (s) and speeds of the inflection before the peak, the peak and the inflection after it."""

    times: tuple[float, ...]
    speeds: tuple[float, ...]


def sigma_from_peak_ratio(ratio: float) -> float:
    """Sigma from the speed at one inflection over the speed at the peak.

    The ratio is v2/v3, in (0, e^-1/2), or v4/v3, in [e^-1/2, 1): a Gaussian has e^-1/2 on both sides, a
    lognormal less before the peak and more behind it.
    """
    b = math.log(ratio)
    return math.sqrt(max(0.0, -2.0 - 2.0 * b - 1.0 / (2.0 * b)))


def sigma_from_slope_ratio(ratio: float) -> float:
    """Sigma from the speed at the inflection behind the peak over that at the one before, v4/v2, >= 1."""
    return math.sqrt(2.0 * math.sqrt(1.0 + math.log(ratio) ** 2) - 2.0)


def lognormal_from_points(points: CharacteristicPoints, sigma: float) -> Lognormal:
    """The lognormal of a known sigma, > 0, that has its inflections at the times of the points."""
    root = sigma * math.sqrt(0.25 * sigma * sigma + 1.0)
    before, after = 1.5 * sigma**2 + root, 1.5 * sigma**2 - root
    mu = math.log((points.times[0] - points.times[2]) / (math.exp(-before) - math.exp(-after)))
    return Lognormal(points.times[0] - math.exp(mu - before), mu, sigma)


def characteristic_points(t: Array, speed: Array) -> CharacteristicPoints | None:
    """Inflections and peak of a speed profile, or None where one of them is not inside."""
    top = int(np.argmax(speed))
    if top < 2 or top > len(speed) - 3:
        return None
    slope = np.gradient(speed, t)
    before, after = int(np.argmax(slope[: top + 1])), top + int(np.argmin(slope[top:]))
    at = [before, top, after]
    points = CharacteristicPoints(tuple(t[at].tolist()), tuple(speed[at].tolist()))
    v2, v3, v4 = points.speeds
    return points if 0 < before < top < after and 0.0 < v2 < v3 > v4 > 0.0 else None
