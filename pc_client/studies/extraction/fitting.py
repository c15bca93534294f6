"""The sequence of a fit: first strokes, joint refinement, further strokes while they raise the SNR enough.

All parts of a recording share one budget of strokes, and a further stroke goes to where most of the velocity
is still unexplained, whichever part that is. Candidates are found by matched pursuit: the lognormal of some
width at some time that reduces the energy of the residual velocity most is subtracted, and the search goes
on; the strokes are refined together afterwards (`refine`).

Source: the order of Robust XZERO (largest first, subtract, go on); docs/extraction.md, section 6.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pc_client.studies.extraction.chain import Bounds, Chain, inserted, with_chords, without
from pc_client.studies.extraction.initial import TYPICAL_SIGMA, initial_chain
from pc_client.studies.extraction.refine import Fit, FitTarget, refine, residuals
from pc_client.studies.extraction.smoothing import CUTOFF_HZ, SmoothPart, low_passed, velocity

__all__ = [
    "Candidate",
    "FitOptions",
    "Fitted",
    "Scales",
    "best_candidates",
    "fit_parts",
    "left_over",
]


#: Widths (s) of the lognormals that are tried: of the strokes of handwriting, from hasty to calm.
_TRIED_WIDTHS_S = (0.02, 0.032, 0.05)
_REACH = 3.0


class Candidate(NamedTuple):
    """A candidate stroke: its place, and the energy (squared velocity summed over samples) it explains."""

    median: float
    width: float
    energy: float


def best_candidates(t: NDArray[np.float64], v_left: NDArray[np.float64], count: int) -> list[Candidate]:
    """The lognormals that reduce the energy of a residual velocity most, best first.

    Args:
        t: uniform times, (n,), s.
        v_left: residual velocity, (n, dim).
        count: how many at most.
    """
    step = float(t[1] - t[0])
    left = np.array(v_left)
    kernels = [_kernel(width / step) for width in _TRIED_WIDTHS_S]
    found: list[Candidate] = []
    gains = np.stack([_gains(left, kernel) for kernel in kernels])
    for _ in range(count):
        which, at = np.unravel_index(int(np.argmax(gains)), gains.shape)
        energy = float(gains[which, at])
        if energy <= 0.0:
            break
        found.append(Candidate(float(t[at]), _TRIED_WIDTHS_S[which], energy))
        _subtract(left, kernels[which], int(at))
        # Only the neighbourhood has changed; no second candidate is wanted in the first one's core.
        reach = 2 * max(len(kernel) for kernel in kernels)
        low, high = max(0, int(at) - reach), min(len(t), int(at) + reach + 1)
        blocked = gains == -1.0
        for row, kernel in enumerate(kernels):
            gains[row, low:high] = _gains(left[max(0, low - reach) : high + reach], kernel)[
                low - max(0, low - reach) :
            ][: high - low]
        gains[blocked] = -1.0
        core = max(1, round(_TRIED_WIDTHS_S[which] / step))
        gains[:, max(0, int(at) - core) : int(at) + core + 1] = -1.0
    return found


def _idle_strokes(chain: Chain, v_scale: float, step: float, cost: float) -> NDArray[np.bool_]:
    """Strokes with a velocity that is small against the residual, (s,).

    Args:
        chain: the strokes.
        v_scale: scale of velocities in the cost.
        step: distance of the samples, s.
        cost: what is left.
    """
    # Energy of a lognormal: D^2 integral Lambda^2 dt = D^2 exp(sigma^2 / 4) / (2 w sqrt(pi)).
    energy = chain.lengths**2 * np.exp(0.25 * chain.sigma**2) / (2.0 * chain.width * np.sqrt(np.pi)) / step
    idle: NDArray[np.bool_] = v_scale**2 * energy < 0.01 * cost
    return idle


def _kernel(width: float) -> NDArray[np.float64]:
    """A lognormal with energy 1, width in samples."""
    reach = max(1, round(_REACH * width))
    shape = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    scaled: NDArray[np.float64] = shape / np.sqrt(shape @ shape)
    return scaled


def _gains(left: NDArray[np.float64], kernel: NDArray[np.float64]) -> NDArray[np.float64]:
    """Energy that the kernel, centred at each sample, explains; near the ends a cut kernel, rescaled."""
    n, reach = len(left), len(kernel) // 2
    power = np.convolve(np.ones(n), kernel**2)[reach : reach + n]
    total = np.zeros(n)
    for column in left.T:
        total += np.convolve(column, kernel)[reach : reach + n] ** 2
    gains: NDArray[np.float64] = total / power
    return gains


def _subtract(left: NDArray[np.float64], kernel: NDArray[np.float64], at: int) -> None:
    reach = len(kernel) // 2
    low, high = max(0, at - reach), min(len(left), at + reach + 1)
    piece = kernel[low - at + reach : high - at + reach]
    left[low:high] -= np.outer(piece, piece @ left[low:high] / (piece @ piece))


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


@dataclass(frozen=True, slots=True)
class Scales:
    """Size of a recording's movement, by which errors are measured.

    Attributes:
        p: root of the summed squared distances of all samples from the mean of their part.
        v: root of the summed squared velocities of all samples.
    """

    p: float
    v: float

    @classmethod
    def of(cls, parts: Sequence[SmoothPart]) -> Scales:
        """The scales of a recording with these moving parts."""
        p = math.sqrt(sum(float(np.sum((part.p - part.p.mean(axis=0)) ** 2)) for part in parts))
        v = math.sqrt(sum(float(np.sum(part.v**2)) for part in parts))
        return cls(p, v)


@dataclass(frozen=True, slots=True)
class Fitted:
    """The result of a fit.

    Attributes:
        chains: the strokes of each part.
        through: True: the signal is so clean that the strokes were fitted through the low-pass: the filtered
            strokes give the recording, and are compared with it.
    """

    chains: list[Chain]
    through: bool


def fit_parts(parts: Sequence[SmoothPart], budget: int, options: FitOptions) -> Fitted:
    """Strokes for all parts.

    Args:
        parts: at least one; all move.
        budget: most strokes of all parts together, unless these would reconstruct too little, see
            `FitOptions`. Every part gets one for each of its speed peaks in any case.
        options: effort.
    """
    scales = Scales.of(parts)
    fit_targets = [_fit_target(part, part.p, part.v, scales) for part in parts]
    fits = [
        refine(initial_chain(part), fit_target, options.iterations)
        for part, fit_target in zip(parts, fit_targets, strict=True)
    ]
    if _velocity_cost([fit.chain for fit in fits], parts, scales) < 10.0 ** (-_PERHAPS_CLEAN_DB / 10.0):
        sharp = [_given_back(fit, part, scales, options) for fit, part in zip(fits, parts, strict=True)]
        if _passed_cost(sharp, parts, scales) < 10.0 ** (-options.enough_db / 10.0):
            return Fitted(_with_all_chords(sharp, parts), through=True)
    for round_ in range(options.rounds):
        left = budget - sum(len(fit.chain) for fit in fits)
        wanted = left if round_ == options.rounds - 1 else math.ceil(left / 2)
        if left <= 0 or not _add(fits, parts, fit_targets, scales, wanted, options):
            break
    for _ in range(_RESCUES):
        chains = [fit.chain for fit in fits]
        if _velocity_cost(chains, parts, scales) < 10.0 ** (-options.least_db / 10.0):
            break
        if not _add(fits, parts, fit_targets, scales, math.ceil(0.1 * sum(map(len, chains))), options):
            break
    fits = [
        refine(_tidy(fit, fit_target), fit_target, options.last_iterations)
        for fit, fit_target in zip(fits, fit_targets, strict=True)
    ]
    is_clean = _velocity_cost([fit.chain for fit in fits], parts, scales) < 10.0 ** (-_CLEAN_DB / 10.0)
    if is_clean:
        fits = [_given_back(fit, part, scales, options) for fit, part in zip(fits, parts, strict=True)]
    return Fitted(_with_all_chords(fits, parts), through=is_clean)


def left_over(
    chain: Chain, part: SmoothPart, *, through: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Residual positions and velocities of a part, (n, dim) each.

    Args:
        chain: the strokes.
        part: low-passed.
        through: the strokes go through the same low-pass first.
    """
    # What trajectory.evaluate leaves, but piece by piece: all strokes at all times are too many in a long
    # recording.
    p_left, v_left = residuals(chain, part.t, part.p, part.v)
    if not through:
        return p_left, v_left
    passed = low_passed(part.p - p_left, 1.0 / part.step)
    return part.p - passed, part.v - velocity(part.t, passed)


def _with_all_chords(fits: Sequence[Fit], parts: Sequence[SmoothPart]) -> list[Chain]:
    """The chains of the fits, every stroke with a chord."""
    return [
        with_chords(fit.chain, _LEAST_CHORD * float(np.linalg.norm(np.ptp(part.p, axis=0))))
        for fit, part in zip(fits, parts, strict=True)
    ]


def _add(
    fits: list[Fit],
    parts: Sequence[SmoothPart],
    fit_targets: Sequence[FitTarget],
    scales: Scales,
    wanted: int,
    options: FitOptions,
) -> bool:
    """Add the best candidates to the fits and refine those fits; False when none is worth adding."""
    left = [residuals(fit.chain, part.t, part.p, part.v)[1] for fit, part in zip(fits, parts, strict=True)]
    energy = sum(float(np.sum(v**2)) for v in left)
    if energy < scales.v**2 * 10.0 ** (-options.enough_db / 10.0):
        return False
    snr = 10.0 * math.log10(scales.v**2 / energy)
    raised = _PAYS * max(snr, 0.0) / sum(len(fit.chain) for fit in fits)
    least = energy * (1.0 - 10.0 ** (-raised / 10.0))
    found = [
        (candidate, index)
        for index, (part, v) in enumerate(zip(parts, left, strict=True))
        for candidate in best_candidates(part.t, v, wanted)
        if candidate.energy > least
    ]
    found.sort(key=lambda pair: -pair[0].energy)
    for index in sorted({index for _, index in found[:wanted]}):
        mine = [candidate for candidate, owner in found[:wanted] if owner == index]
        median = np.array([candidate.median for candidate in mine])
        width = np.array([candidate.width for candidate in mine])
        chain = inserted(_tidy(fits[index], fit_targets[index]), median, width, TYPICAL_SIGMA)
        fits[index] = refine(chain, fit_targets[index], options.iterations)
    return bool(found)


def _tidy(fit: Fit, fit_target: FitTarget) -> Chain:
    """The fit's chain without strokes of no effect; one is kept in any case."""
    idle = _idle_strokes(fit.chain, fit_target.v_scale, float(fit_target.t[1] - fit_target.t[0]), fit.cost)
    if idle.all():
        idle[int(np.argmax(fit.chain.lengths))] = False
    return without(fit.chain, idle) if idle.any() else fit.chain


def _given_back(fit: Fit, part: SmoothPart, scales: Scales, options: FitOptions) -> Fit:
    """Refine against the signal with what the low-pass takes from these strokes given back to it.

    The low-pass flattens fast speed profiles a little. That is far below the noise of a hand's recording, but
    strokes fitted to a clean signal would come out too wide by it.
    """
    cost = math.inf
    for _ in range(_GIVE_BACKS):
        p_left, v_left = residuals(fit.chain, part.t, part.p, part.v)
        p_model, v_model = part.p - p_left, part.v - v_left
        passed = low_passed(p_model, 1.0 / part.step)
        p, v = part.p + p_model - passed, part.v + v_model - velocity(part.t, passed)
        fit = refine(fit.chain, _fit_target(part, p, v, scales), options.last_iterations, tolerance=1e-4)
        if fit.cost > _STAGNANT * cost:
            break
        cost = fit.cost
    return fit


def _passed_cost(fits: Sequence[Fit], parts: Sequence[SmoothPart], scales: Scales) -> float:
    """Share of the velocity that low-passed strokes do not explain."""
    energy = 0.0
    for fit, part in zip(fits, parts, strict=True):
        energy += float(np.sum(left_over(fit.chain, part, through=True)[1] ** 2))
    return energy / scales.v**2


def _velocity_cost(chains: Sequence[Chain], parts: Sequence[SmoothPart], scales: Scales) -> float:
    left = (residuals(chain, part.t, part.p, part.v)[1] for chain, part in zip(chains, parts, strict=True))
    return sum(float(np.sum(v**2)) for v in left) / scales.v**2


def _fit_target(
    part: SmoothPart, p: NDArray[np.float64], v: NDArray[np.float64], scales: Scales
) -> FitTarget:
    decimation = max(1, min(_DECIMATION, len(part.t) // _LEAST_SAMPLES))
    rows = np.arange(0, len(part.t), decimation)
    if rows[-1] != len(part.t) - 1:
        rows = np.append(rows, len(part.t) - 1)
    weight = math.sqrt(len(part.t) / len(rows))
    duration = float(part.t[-1] - part.t[0])
    freedom = part.p.shape[1] * (1.0 + 2.0 * CUTOFF_HZ * duration)
    bounds = Bounds.of(duration)
    return FitTarget(part.t[rows], p[rows], v[rows], weight / scales.p, weight / scales.v, freedom, bounds)
