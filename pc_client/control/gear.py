"""The error of the gears, found from the streams of finished runs, and how to drive a joint against it.

A strain wave gear runs ahead of and behind its motor by up to a tenth of a milliradian, in waves along the
angle of its joint. The error depends on the position alone, so what one movement shows holds for every other:

    q_joint = q_motor + e(q_motor),    e(q) = sum over the waves of  a sin(order q) + b cos(order q)

The order of a wave is how often it repeats in one turn of the joint. Orders and sizes are found joint by
joint, in what the joint did beyond its commands. All whole orders of a grid are tried, and the one that
explains most, in multiples of what noise would explain there, is taken out; so again in what is left. A wave
counts if it is significant against what all of them leave, and if its order is known: the next orders but one
must fit worse. A spectrum over all orders comes from histograms of positions, by one Fourier transform; the
sizes come from least squares over all samples.

A joint follows its reference when the motor is sent to q_ref - e(q_ref).
"""

from collections import deque
from dataclasses import dataclass
from math import log, pi
from typing import NamedTuple

import numpy as np

from pc_client.arrays import Array
from pc_client.control.loop import LoopModel, velocity_response

ORDERS = np.arange(30, 331)
"""Whole numbers, because the error repeats with each turn of the joint. Once and twice a motor turn, of
strain wave gears with the ratios that are made: 30 to 160 (Harmonic Drive, catalogue of component sets)."""

LARGEST_SLOPE = 0.08
"""A wave that would change the speed by more than this share is no gear's error and is left out."""

_MOST_WAVES = 4
_FALSE_ALARM = 1e-4
"""Probability of taking a wave of white noise, of any order."""

_LEAST_LOSS = 9.0
"""What the next order but one must explain less, in squared standard errors: the order is known to 2/3."""

_N_BINS = 1 << 15
"""Of a turn: an order of 330 is misplaced by 1.8 degrees of its wave at most."""


class Wave(NamedTuple):
    """`sine * sin(order q) + cosine * cos(order q)`: by how much a joint at q is ahead of its motor [rad]."""

    order: int
    sine: float
    cosine: float


def find_waves(before: Array, after: Array, surprise: Array) -> list[Wave]:
    """Find the waves of one gear; none for a joint that has hardly moved.

    Args:
        before: (n,) reported positions at one frame each [rad].
        after: (n,) those one cycle later [rad].
        surprise: (n,) what of each step the commands do not explain [rad].
    """
    orders: list[int] = []
    rest = surprise
    for _ in range(_MOST_WAVES):
        gain, noise = _spectrum(before, after, rest)
        if not noise.all():
            return []  # the joint has hardly moved
        orders.append(int(ORDERS[np.argmax(gain / noise)]))
        _, rest = _fit(before, after, surprise, orders)
    # Held against the noise that all of them leave; the waves found first are the strongest.
    level = dict(zip(ORDERS.tolist(), _spectrum(before, after, rest)[1].tolist(), strict=True))
    known = [order for n, order in enumerate(orders) if _is_known(before, after, surprise, orders, n, level)]
    weights, _ = _fit(before, after, surprise, known)
    found = [Wave(order, *pair) for order, pair in zip(known, weights.tolist(), strict=True)]
    return [wave for wave in found if np.hypot(wave.sine, wave.cosine) * wave.order < LARGEST_SLOPE]


def _fit(before: Array, after: Array, surprise: Array, orders: list[int]) -> tuple[Array, Array]:
    """Sizes (m, 2) of waves of these orders, by least squares, and what they leave of the steps (n,)."""
    if not orders:
        return np.zeros((0, 2)), surprise
    columns = [wave(order * after) - wave(order * before) for order in orders for wave in (np.sin, np.cos)]
    waves = np.stack(columns)
    weights: Array = np.asarray(np.linalg.lstsq(waves @ waves.T, waves @ surprise)[0], dtype=np.float64)
    return weights.reshape(-1, 2), surprise - weights @ waves


def _is_known(
    before: Array, after: Array, surprise: Array, orders: list[int], n: int, noise: dict[int, float]
) -> bool:
    """Whether wave n of the orders is significant, and its order known, beside the waves found before it."""

    def left(order: int | None) -> float:
        """The square sum that is left when the wave has this order, or is not there."""
        beside = [*orders[:n], *orders[n + 1 :], *([] if order is None else [order])]
        return float(np.square(_fit(before, after, surprise, beside)[1]).sum())

    order = orders[n]
    best = left(order)
    neighbours = min(left(order - 2), left(order + 2))
    return (
        left(None) - best > 2.0 * log(len(ORDERS) / _FALSE_ALARM) * noise[order]
        and neighbours - best > _LEAST_LOSS * noise[order]
    )


def _spectrum(before: Array, after: Array, rest: Array) -> tuple[Array, Array]:
    """What a wave of each order explains of the square sum of `rest`, and what it explains of noise.

    The noise has the spectrum of the encoders', which grows with the order; below the middle order it is
    taken to be as large as there, since friction adds to it. Its level is that at most orders.
    """
    moments = np.fft.rfft(_histogram(after, rest) - _histogram(before, rest))[ORDERS]
    # Of steps d: the sums of cos(order d) and cos(2 order d).
    steps = np.fft.rfft(_histogram(after - before, np.ones_like(rest))).real
    n, once, twice = len(rest), steps[ORDERS], steps[2 * ORDERS]
    power = np.maximum(n - once, 1e-9)  # of a wave's sine and of its cosine, in steps
    gain = np.square(np.abs(moments)) / power
    of_encoders = np.maximum((6.0 * n - 8.0 * once + 2.0 * twice) / power, 1e-9)
    # A chi-square of two degrees of freedom, as noise gives it, has the median 2 ln 2.
    level = float(np.median(gain / of_encoders)) / (2.0 * log(2.0))
    return gain, level * np.maximum(of_encoders, float(np.median(of_encoders)))


def _histogram(q: Array, weights: Array) -> Array:
    """Sum of the weights (n,) by position in a turn, (_N_BINS,)."""
    bins = np.rint(q * (_N_BINS / (2.0 * pi))).astype(np.int64) % _N_BINS
    return np.bincount(bins, weights, _N_BINS).astype(np.float64)


_LONGEST = 480.0
"""Older runs are forgotten beyond so much time [s]: twice what ten movements take."""


@dataclass(frozen=True, slots=True)
class GearModel:
    """Waves of six gears; a joint with fewer than another has zeros.

    Attributes:
        orders: (n, 6) waves in a turn of the joint.
        sines: (n, 6) a [rad].
        cosines: (n, 6) b [rad].
    """

    orders: Array
    sines: Array
    cosines: Array

    @property
    def n_waves(self) -> int:
        """How many waves are known."""
        return int(np.count_nonzero(np.hypot(self.sines, self.cosines)))

    def error(self, q: Array) -> tuple[Array, Array]:
        """Error e [rad] and its slope de/dq [1] at joint angles q (6,), (6,) each."""
        angles = self.orders * q
        sin, cos = np.sin(angles), np.cos(angles)
        error: Array = (self.sines * sin + self.cosines * cos).sum(axis=0)
        slope: Array = (self.orders * (self.sines * cos - self.cosines * sin)).sum(axis=0)
        return error, slope

    def motors(self, q: Array, qd: Array) -> tuple[Array, Array]:
        """Positions [rad] and velocities [rad/s] of the motors for those of the joints, (6,) each."""
        error, slope = self.error(q)
        return q - error, qd * (1.0 - slope)


class GearObserver:
    """Collects runs; each makes the waves better known.

    Args:
        loop: says what of a motion the commands explain.
        period: control cycle [s].
    """

    def __init__(self, loop: LoopModel, period: float) -> None:
        self._response = velocity_response(loop, period) * period
        self._most = round(_LONGEST / period)  # steps
        self._runs: deque[tuple[Array, Array]] = deque()

    def take(self, qd_cmd: Array, q: Array) -> None:
        """Take a run without gaps: commands (n, 6) from rest [rad/s], one a cycle; positions (n, 6) [rad]."""
        n = len(q)
        commanded = [np.convolve(joint, self._response)[1:n] for joint in qd_cmd.T]  # up to frames 1, 2, ...
        self._runs.append((q, np.diff(q, axis=0) - np.transpose(commanded)))
        while sum(len(surprise) for _, surprise in self._runs) > self._most and len(self._runs) > 1:
            self._runs.popleft()

    def model(self) -> GearModel | None:
        """The waves that are known by now; None when there are none."""
        if not self._runs:
            return None
        before, after, surprise = (
            np.concatenate(parts)
            for parts in zip(*((q[:-1], q[1:], rest) for q, rest in self._runs), strict=True)
        )
        joints = [find_waves(before[:, j], after[:, j], surprise[:, j]) for j in range(6)]
        table = np.zeros((3, max(map(len, joints)), 6))
        for j, waves in enumerate(joints):
            for n, wave in enumerate(waves):
                table[:, n, j] = wave
        return GearModel(*table) if table.any() else None
