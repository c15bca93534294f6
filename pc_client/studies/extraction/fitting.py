"""The sequence of a fit: first strokes, joint refinement, further strokes while they raise the SNR enough.

All parts of a recording share one budget of strokes, and a further stroke goes to where most of the velocity
is still unexplained, whichever part that is. Candidates are found by matched pursuit: the Gaussian (the speed
profile of a stroke of small sigma, nearly) of some width at some time that reduces the energy of the residual
velocity most is subtracted, and the search goes on; the strokes are refined together afterwards (`refine`).

Source: the order of Robust XZERO (largest first, subtract, go on); docs/extraction.md, section 6.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pc_client.arrays import Array
from pc_client.studies.extraction.chain import Bounds, Chain, inserted, with_chords, without
from pc_client.studies.extraction.initial import TYPICAL_SIGMA, initial_chain
from pc_client.studies.extraction.refine import Fit, Goal, refine, residuals
from pc_client.studies.extraction.smoothing import CUTOFF_HZ, less_noise
from pc_client.studies.signals import Trace, decibels, velocity

#: The fit looks at every fourth sample of the 200 Hz signal: twice 12 Hz is 24 Hz, 50 Hz is enough.
_DECIMATION = 4
_LEAST_SAMPLES = 16
#: A further stroke pays when, by its first estimate, it raises the SNR by this share of what the strokes have
#: brought on average, SNR_v / number of strokes.
_PAYS = 0.05
#: Above this SNR (dB) what the low-pass took from the strokes is the larger part of the residual.
_CLEAN_DB = 35.0
#: Above this SNR (dB) of the first strokes they may be all there are, blunted by the low-pass.
_PERHAPS_CLEAN_DB = 25.0
#: Most refinements against the signal with what the low-pass took given back. Each divides the error of the
#: strokes by 2.5 for .3 s, by 2 for .25 s. One that leaves more than this share of the cost is the last.
_GIVE_BACKS = 24
_STAGNANT = 0.9
#: Times that a tenth of the strokes is added beyond the budget, at most.
_RESCUES = 12
#: Share of the cost below which the velocity of a stroke has no effect.
_IDLE = 0.01
#: Shortest chord of a stroke over the extent of its part.
_LEAST_CHORD = 1e-6


@dataclass(frozen=True, slots=True)
class FitOptions:
    """How much effort a fit makes.

    Attributes:
        rounds: times that strokes are added; each of them spends half of what is left of the budget, the
            last one all.
        iterations: of the refinement after each round.
        last_iterations: of the last refinement.
        enough_db: SNR of the velocity, dB, above which no stroke is added.
        least_db: SNR of the velocity, dB, below which strokes are added beyond the budget, as long as they
            pay: so poor a reconstruction is of no use. Below it the open extractor SynSig2Vec refits, too.
    """

    rounds: int = 3
    iterations: int = 6
    last_iterations: int = 40
    enough_db: float = 40.0
    least_db: float = 15.0


class Fitted(NamedTuple):
    """The result of a fit.

    Attributes:
        through: the signal is so clean that the strokes were fitted through the low-pass: the filtered
            strokes give the recording, and are compared with it.
    """

    chains: list[Chain]
    through: bool


def fit_parts(parts: Sequence[Trace], budget: int, options: FitOptions) -> Fitted:
    """Strokes for all parts, of which there is at least one; all move.

    Args:
        budget: most strokes of all parts together, unless these would reconstruct too little, see
            `FitOptions`. Every part gets one for each of its speed peaks in any case.
    """
    fitting = _Fitting(parts, options)
    if fitting.snr_v() > _PERHAPS_CLEAN_DB:
        sharp = fitting.given_back()
        if fitting.snr_v(sharp, through=True) > options.enough_db:
            return Fitted(fitting.chains(sharp), through=True)
    for round_ in range(options.rounds):
        left = budget - fitting.n_strokes
        wanted = left if round_ == options.rounds - 1 else math.ceil(left / 2)
        if left <= 0 or not fitting.add(wanted):
            break
    for _ in range(_RESCUES):
        if fitting.snr_v() > options.least_db or not fitting.add(math.ceil(0.1 * fitting.n_strokes)):
            break
    fitting.finish()
    is_clean = fitting.snr_v() > _CLEAN_DB
    return Fitted(fitting.chains(fitting.given_back() if is_clean else fitting.fits), through=is_clean)


def left_over(chain: Chain, part: Trace, *, through: bool) -> tuple[Array, Array]:
    """Residual positions and velocities of a low-passed part, (n, dim) each.

    With `through` the strokes go through the same low-pass first.
    """
    p_left, v_left = residuals(chain, part)
    if not through:
        return p_left, v_left
    passed = less_noise(part.p - p_left, 1.0 / part.step)
    return part.p - passed, part.v - velocity(part.t, passed)


class _Fitting:
    """The parts of a recording and the strokes that they have so far.

    Errors are measured by the size of the whole recording: the root of the summed squared distances of all
    samples from the mean of their part, and that of the summed squared velocities.
    """

    def __init__(self, parts: Sequence[Trace], options: FitOptions) -> None:
        self._parts = parts
        self._options = options
        self._p_size = math.sqrt(sum(float(np.sum((part.p - part.p.mean(axis=0)) ** 2)) for part in parts))
        self._v_size = math.sqrt(sum(float(np.sum(part.v**2)) for part in parts))
        self._goals = [self._goal(part, part.p, part.v) for part in parts]
        self.fits = [
            refine(initial_chain(part), goal, options.iterations)
            for part, goal in zip(parts, self._goals, strict=True)
        ]

    @property
    def n_strokes(self) -> int:
        """Of all parts."""
        return sum(len(fit.chain) for fit in self.fits)

    def snr_v(self, fits: Sequence[Fit] | None = None, *, through: bool = False) -> float:
        """SNR of the velocity over all parts, dB."""
        left = (
            left_over(fit.chain, part, through=through)[1]
            for fit, part in zip(fits or self.fits, self._parts, strict=True)
        )
        return decibels(self._v_size**2, sum(float(np.sum(v**2)) for v in left))

    def add(self, wanted: int) -> bool:
        """Add the best candidates and refine their parts; False when none is worth adding."""
        left = [residuals(fit.chain, part)[1] for fit, part in zip(self.fits, self._parts, strict=True)]
        energy = sum(float(np.sum(v**2)) for v in left)
        snr_v = decibels(self._v_size**2, energy)
        if snr_v > self._options.enough_db:
            return False
        # What a stroke must take of the energy to raise the SNR by a share of what each has brought so far.
        raised = _PAYS * max(snr_v, 0.0) / self.n_strokes
        least = energy * (1.0 - 10.0 ** (-raised / 10.0))
        found = [
            (candidate, index)
            for index, (part, v) in enumerate(zip(self._parts, left, strict=True))
            for candidate in best_candidates(part.t, v, wanted)
            if candidate.energy > least
        ]
        best = sorted(found, key=lambda pair: -pair[0].energy)[:wanted]
        for index in sorted({index for _, index in best}):
            median, width, _ = np.array([candidate for candidate, owner in best if owner == index]).T
            chain = inserted(self._tidy(index), median, width, TYPICAL_SIGMA)
            self.fits[index] = refine(chain, self._goals[index], self._options.iterations)
        return bool(found)

    def finish(self) -> None:
        """The last refinement, without strokes of no effect."""
        self.fits = [
            refine(self._tidy(index), goal, self._options.last_iterations)
            for index, goal in enumerate(self._goals)
        ]

    def given_back(self) -> list[Fit]:
        """Refine against the signal with what the low-pass takes from these strokes given back to it.

        The low-pass flattens fast speed profiles a little. That is far below the noise of a hand's recording,
        but strokes fitted to a clean signal would come out too wide by it.
        """
        fits = []
        for fit, part in zip(self.fits, self._parts, strict=True):
            cost = math.inf
            for _ in range(_GIVE_BACKS):
                p_left, v_left = residuals(fit.chain, part)
                p_model, v_model = part.p - p_left, part.v - v_left
                passed = less_noise(p_model, 1.0 / part.step)
                v_passed = velocity(part.t, passed)
                goal = self._goal(part, part.p + p_model - passed, part.v + v_model - v_passed)
                fit = refine(fit.chain, goal, self._options.last_iterations, tolerance=1e-4)
                if fit.cost > _STAGNANT * cost:
                    break
                cost = fit.cost
            fits.append(fit)
        return fits

    def chains(self, fits: Sequence[Fit]) -> list[Chain]:
        """The chains of fits, every stroke with a chord."""
        return [
            with_chords(fit.chain, _LEAST_CHORD * float(np.linalg.norm(np.ptp(part.p, axis=0))))
            for fit, part in zip(fits, self._parts, strict=True)
        ]

    def _goal(self, part: Trace, p: Array, v: Array) -> Goal:
        """What the strokes of a part shall approximate: some of the samples of p and v."""
        decimation = max(1, min(_DECIMATION, len(part.t) // _LEAST_SAMPLES))
        rows = np.unique([*range(0, len(part.t), decimation), len(part.t) - 1])
        weight = math.sqrt(len(part.t) / len(rows))
        freedom = part.p.shape[1] * (1.0 + 2.0 * CUTOFF_HZ * part.duration)
        signal = Trace(part.t[rows], p[rows], v[rows])
        return Goal(signal, weight / self._p_size, weight / self._v_size, freedom, Bounds.of(part.duration))

    def _tidy(self, index: int) -> Chain:
        """The chain of a part without strokes of no effect; one is kept in any case."""
        fit, goal = self.fits[index], self._goals[index]
        chain = fit.chain
        # Energy of a lognormal: D^2 integral Lambda^2 dt = D^2 exp(sigma^2 / 4) / (2 w sqrt(pi)).
        energy = chain.lengths**2 * np.exp(0.25 * chain.sigma**2) / (2.0 * chain.width * np.sqrt(np.pi))
        idle = goal.v_scale**2 * (energy / goal.signal.step) < _IDLE * fit.cost
        if idle.all():
            idle[int(np.argmax(chain.lengths))] = False
        return without(chain, idle) if idle.any() else chain


#: Widths (s) of the Gaussians that are tried: of the strokes of handwriting, from hasty to calm.
_TRIED_WIDTHS_S = (0.02, 0.032, 0.05)
#: Of a Gaussian, in widths on each side of its middle.
_REACH = 3.0


class Candidate(NamedTuple):
    """A candidate stroke: its place, and the energy (squared velocity summed over samples) it explains."""

    median: float
    width: float
    energy: float


def best_candidates(t: Array, v_left: Array, count: int) -> list[Candidate]:
    """The Gaussians that reduce the energy of a residual velocity (n, dim) most: the best ones, in order.

    The times (n,), s, are uniform.
    """
    step = float(t[1] - t[0])
    left = np.array(v_left)
    kernels = [_kernel(width / step) for width in _TRIED_WIDTHS_S]
    reach = 2 * max(len(kernel) for kernel in kernels)
    gains = np.stack([_gains(left, kernel) for kernel in kernels])
    found: list[Candidate] = []
    for _ in range(count):
        which, at = map(int, np.unravel_index(int(np.argmax(gains)), gains.shape))
        energy = float(gains[which, at])
        if energy <= 0.0:
            break
        found.append(Candidate(float(t[at]), _TRIED_WIDTHS_S[which], energy))
        _subtract(left, kernels[which], at)
        # Only the neighbourhood has changed; no second candidate is wanted in the first one's core.
        low, high = max(0, at - reach), min(len(t), at + reach + 1)
        margin = low - max(0, low - reach)
        blocked = gains == -1.0
        nearby = np.stack([_gains(left[low - margin : high + reach], kernel) for kernel in kernels])
        gains[:, low:high] = nearby[:, margin:][:, : high - low]
        gains[blocked] = -1.0
        core = max(1, round(_TRIED_WIDTHS_S[which] / step))
        gains[:, max(0, at - core) : at + core + 1] = -1.0
    return found


def _kernel(width: float) -> Array:
    """A Gaussian with energy 1, width in samples."""
    reach = max(1, round(_REACH * width))
    shape: Array = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    return shape / math.sqrt(shape @ shape)


def _gains(left: Array, kernel: Array) -> Array:
    """Energy that the kernel, centred at each sample, explains; near the ends a cut kernel, rescaled."""
    n, reach = len(left), len(kernel) // 2
    power = np.convolve(np.ones(n), kernel**2)[reach : reach + n]
    found = [np.convolve(column, kernel)[reach : reach + n] ** 2 for column in left.T]
    gains: Array = np.sum(found, axis=0) / power
    return gains


def _subtract(left: Array, kernel: Array, at: int) -> None:
    reach = len(kernel) // 2
    low, high = max(0, at - reach), min(len(left), at + reach + 1)
    piece = kernel[low - at + reach : high - at + reach]
    left[low:high] -= np.outer(piece, piece @ left[low:high] / (piece @ piece))
