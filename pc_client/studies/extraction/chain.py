"""The strokes of a part in the extraction: arrays, in variables that make the fit well-conditioned.

The theory's (t0, mu, sigma) are strongly correlated: for small sigma a lognormal tends to a Gaussian, and
the data determine only the median time t0 + e^mu and the width e^mu sigma. So these two are variables here,
with sigma as a pure number that sets the skewness:

    median m = t0 + e^mu,   width w = e^mu sigma,   sigma     <=>     t0 = m - w / sigma,   mu = ln(w / sigma)

The positions are those of the virtual target points. Each belongs to the stroke that ends there and the
stroke that begins there; moving one changes the movement only while these two strokes run, so the
computations of a fit are local in time. Targets that may lie off the path are the idea of iDeLog.

Source: docs/theory.md, section 1; docs/extraction.md, section 5.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pc_client.arrays import Array
from pc_client.movements.lognormal import Lognormal
from pc_client.movements.sigma_lognormal import SigmaLognormal, Stroke, tilt_of_normal

#: Most width of a stroke over the duration of its part; a stroke that fills it has 1/6.
_WIDEST = 0.35


class Bounds(NamedTuple):
    """Bounds of a stroke, each as (least, most).

    Attributes:
        sigma: below .08 a lognormal is nearly a Gaussian (skewness .24), and its t0 is undetermined.
        width: s; from the narrowest lognormal that a 12 Hz signal can show to one of a slow sweep.
        arc_angle: rad; an arc of 2 pi has no chord, so its target points could not carry it.
    """

    sigma: tuple[float, float] = (0.08, 0.6)
    width: tuple[float, float] = (0.012, 4.0)
    arc_angle: tuple[float, float] = (-4.5, 4.5)

    @classmethod
    def of(cls, duration: float) -> Bounds:
        """Bounds for a part of this duration, s: a much wider stroke would be an invented drift."""
        least, most = cls().width
        return cls(width=(least, min(most, max(2.0 * least, _WIDEST * duration))))


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """Strokes from target to target.

    Attributes:
        median: times at which half of each stroke is done, (s,), s.
        width: e^mu sigma, (s,), s.
        sigma: (s,).
        arc_angle: (s,), rad; positive turns from the chord towards normal x chord.
        normal: unit vectors (s, 3) about which the strokes turn, at right angles to their chords. Flat
            strokes have +z.
        targets: (s + 1, 2) or (s + 1, 3).
    """

    median: Array
    width: Array
    sigma: Array
    arc_angle: Array
    normal: Array
    targets: Array

    def __len__(self) -> int:
        return len(self.median)

    @property
    def chords(self) -> Array:
        """From the start of each stroke to its end, (s, dim)."""
        return np.diff(self.targets, axis=0)

    @property
    def lengths(self) -> Array:
        """Arc lengths D, (s,)."""
        lengths: Array = np.linalg.norm(self.chords, axis=1) / np.sinc(self.arc_angle / (2 * math.pi))
        return lengths

    def picked(self, which: NDArray[np.bool_ | np.intp], targets: Array) -> Chain:
        """Some of the strokes, or all in another order, from target to target of these."""
        names = ("median", "width", "sigma", "arc_angle", "normal")
        return replace(self, targets=targets, **{name: getattr(self, name)[which] for name in names})

    def time_at_deviation(self, z: float) -> Array:
        """Times (s,) at which each stroke has done Phi(z) of its length."""
        return self.median + self.width * np.expm1(self.sigma * z) / self.sigma


def normals_across(chords: Array, normals: Array) -> Array:
    """The unit vectors at right angles to the chords that are nearest to given ones, both (s, 3).

    Where the two are parallel (or a chord is nothing) any right angle will do.
    """
    norms = np.linalg.norm(chords, axis=1, keepdims=True)
    unit = chords / np.where(norms > 0.0, norms, 1.0)
    across = normals - np.einsum("ij,ij->i", normals, unit)[:, None] * unit
    sizes = np.linalg.norm(across, axis=1)
    for index in np.flatnonzero(sizes < 1e-9):
        axis = np.eye(3)[int(np.argmin(np.abs(unit[index])))]
        across[index] = axis - (axis @ unit[index]) * unit[index]
        sizes[index] = np.linalg.norm(across[index])
    nearest: Array = across / sizes[:, None]
    return nearest


def inserted(chain: Chain, median: Array, width: Array, sigma: float) -> Chain:
    """The chain with further strokes that do not move anything yet (chord 0), each put in by its median.

    A fit gives them their chords in its first, linear step; an insertion changes no error.
    """
    order = np.argsort(median)
    at = np.searchsorted(chain.median, median[order])
    dim = chain.targets.shape[1]
    up = np.array([0.0, 0.0, 1.0])
    if dim == 3 and len(chain):
        up = chain.normal.mean(axis=0) + np.array([0.0, 0.0, 1e-6])
    return Chain(
        np.insert(chain.median, at, median[order]),
        np.insert(chain.width, at, width[order]),
        np.insert(chain.sigma, at, sigma),
        np.insert(chain.arc_angle, at, 0.0),
        np.insert(chain.normal, at, up / np.linalg.norm(up), axis=0),
        np.insert(chain.targets, at, chain.targets[at], axis=0),
    )


def without(chain: Chain, drop: NDArray[np.bool_]) -> Chain:
    """The chain without some strokes (drop is (s,)): the stroke after a dropped one begins at its start.

    The end of the whole chain is kept when its last stroke is dropped.
    """
    targets = np.vstack((chain.targets[:1], chain.targets[1:][~drop]))
    targets[-1] = chain.targets[-1]
    return chain.picked(~drop, targets)


def with_chords(chain: Chain, least: float) -> Chain:
    """The chain without strokes whose chord is shorter than `least`; a last one gets a chord of that length.

    A stroke without a chord has no direction, so no movement of the package could hold it.
    """
    sizes = np.linalg.norm(chain.chords, axis=1)
    short = sizes < least
    short[int(np.argmax(sizes))] = False
    kept = without(chain, short) if short.any() else chain
    if len(kept) == 1 and float(np.linalg.norm(kept.chords)) < least:
        along = np.eye(kept.targets.shape[1])[0]
        normal = normals_across(np.eye(3)[:1], kept.normal)
        targets = np.vstack((kept.targets[0], kept.targets[0] + least * along))
        return replace(kept, targets=targets, normal=normal)
    return kept


def in_order(chain: Chain) -> Chain:
    """The strokes sorted by their medians. The movement stays the same: each keeps its own chord."""
    order = np.argsort(chain.median, kind="stable")
    if (np.diff(order) > 0).all():  # they are
        return chain
    ends = chain.targets[0] + np.cumsum(chain.chords[order], axis=0)
    return chain.picked(order, np.vstack((chain.targets[:1], ends)))


def sigma_lognormal(chain: Chain, duration: float) -> SigmaLognormal:
    """The chain, no chord of which is nothing, as a movement of the package; flat ones lie in z = 0.

    The movement ends at `duration`, s.
    """
    targets = np.zeros((len(chain.targets), 3))
    targets[:, : chain.targets.shape[1]] = chain.targets
    strokes = []
    for j, chord in enumerate(np.diff(targets, axis=0)):
        unit = chord / np.linalg.norm(chord)
        median, width, sigma = float(chain.median[j]), float(chain.width[j]), float(chain.sigma[j])
        timing = Lognormal(median - width / sigma, math.log(width / sigma), sigma)
        # A stroke of the package swings from -m to +m, m the normal in its plane: turning about n, that is
        # n x chord.
        tilt = tilt_of_normal(unit, np.cross(chain.normal[j], unit))
        strokes.append(Stroke(timing, float(chain.arc_angle[j]), tilt))
    return SigmaLognormal(targets, tuple(strokes), duration)
