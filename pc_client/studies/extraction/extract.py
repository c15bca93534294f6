"""From a recording to Sigma-Lognormal strokes, and how well they reconstruct the recording.

    extraction = extract(read_pen(path))
    extraction.snr_v_db, extraction.n_strokes, extraction.parts[0].trajectory

The figures, over all parts of a recording that move, against the recording low-passed at 12 Hz:

    SNR_v        10 log10( sum |v|^2 / sum |v - v_hat|^2 ), on the velocity vector
    SNR_t        10 log10( sum |p - mean p|^2 / sum |p - p_hat|^2 ), mean p of each part by itself
    lognormality SNR_v / number of strokes

A signal so clean that the strokes could be fitted through the low-pass is judged through it, too: the filter
flattens fast speed profiles in the recording, too.

Source: docs/extraction.md, section 1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pc_client.arrays import Array
from pc_client.movements.sigma_lognormal import SigmaLognormal
from pc_client.studies.extraction.chain import Bounds, Chain, sigma_lognormal
from pc_client.studies.extraction.fitting import FitOptions, fit_parts, left_over
from pc_client.studies.extraction.pen import PenPart, PenRecording
from pc_client.studies.extraction.smoothing import moves, smooth_part, speed_peaks
from pc_client.studies.signals import Trace, decibels


@dataclass(frozen=True, slots=True)
class ExtractOptions:
    """What an extraction may do.

    Attributes:
        strokes_per_peak: most strokes per speed peak of a recording. Every moving part gets one stroke in any
            case, and a recording as many as `fit.least_db` takes.
    """

    strokes_per_peak: float = 1.2
    fit: FitOptions = field(default_factory=FitOptions)

    @classmethod
    def strict(cls, strokes_per_peak: float) -> ExtractOptions:
        """No more strokes than this per peak, but one for each speed peak, however little they add."""
        return cls(strokes_per_peak, FitOptions(least_db=-math.inf))


@dataclass(frozen=True, slots=True, eq=False)
class PartExtraction:
    """The strokes of one pen-down part; the ratios are of this part alone.

    Attributes:
        t: uniform times, (n,), s, on the recording's axis.
        p: low-passed positions, (n, 2) or (n, 3), in the recording's unit.
        v: their velocities, the same shape, per second.
        trajectory: the reconstruction, on the same time axis (t0 of a stroke may be negative); flat parts lie
            in z = 0.
    """

    t: Array
    p: Array
    v: Array
    trajectory: SigmaLognormal
    snr_v_db: float
    snr_t_db: float
    n_strokes: int
    n_speed_peaks: int


@dataclass(frozen=True, slots=True, eq=False)
class Extraction:
    """The strokes of a recording.

    Attributes:
        parts: those that move, in order of time.
        snr_v_db: over all parts, or None when nothing moves; so the next.
        lognormality: SNR_v per stroke, dB, or None when nothing moves.
        remarks: what was mended in the recording, and what to know about the strokes.
        still: parts without a movement: dots and touches. They have no strokes.
    """

    name: str
    parts: tuple[PartExtraction, ...]
    snr_v_db: float | None
    snr_t_db: float | None
    n_strokes: int
    n_speed_peaks: int
    lognormality: float | None
    remarks: tuple[str, ...]
    still: tuple[PenPart, ...] = ()


def extract(recording: PenRecording, options: ExtractOptions | None = None) -> Extraction:
    """Find the strokes of a recording. It does not fail: what cannot be used is left out with a remark."""
    options = options or ExtractOptions()
    still = tuple(part for part in recording.parts if not moves(part))
    smooth = [smooth_part(part) for part in recording.parts if moves(part)]
    remarks = list(recording.remarks)
    if still:
        remarks.append(f"{len(still)} of {len(recording.parts)} parts hold no movement (dots) and no stroke")
    if not smooth:
        return Extraction(recording.name, (), None, None, 0, 0, None, tuple(remarks), still)
    n_peaks = [len(speed_peaks(part)) for part in smooth]
    budget = max(len(smooth), math.floor(options.strokes_per_peak * sum(n_peaks) + 1e-9))
    fitted = fit_parts(smooth, budget, options.fit)
    remarks += _degenerate(fitted.chains)
    judged = [
        _judge(part, chain, count, fitted.through)
        for part, chain, count in zip(smooth, fitted.chains, n_peaks, strict=True)
    ]
    powers = np.sum([power for _, power in judged], axis=0)
    snr_v, snr_t = decibels(powers[0], powers[1]), decibels(powers[2], powers[3])
    n_strokes = sum(map(len, fitted.chains))
    if n_strokes > budget:
        remarks.append(
            f"{n_strokes} strokes, {n_strokes - budget} more than asked: fewer reconstruct too little"
        )
    return Extraction(
        recording.name,
        tuple(part for part, _ in judged),
        snr_v,
        snr_t,
        n_strokes,
        sum(n_peaks),
        snr_v / n_strokes,
        tuple(remarks),
        still,
    )


def _judge(part: Trace, chain: Chain, n_peaks: int, through: bool) -> tuple[PartExtraction, Array]:
    """A part's result, and its powers: of velocity and its error, of position and its error."""
    p_left, v_left = left_over(chain, part, through=through)
    moved = part.p - part.p.mean(axis=0)
    powers = np.array([np.sum(values**2) for values in (part.v, v_left, moved, p_left)])
    result = PartExtraction(
        part.t,
        part.p,
        part.v,
        sigma_lognormal(chain, float(part.t[-1])),
        decibels(powers[0], powers[1]),
        decibels(powers[2], powers[3]),
        len(chain),
        n_peaks,
    )
    return result, powers


def _degenerate(chains: Sequence[Chain]) -> list[str]:
    sigma = np.concatenate([chain.sigma for chain in chains])
    least = Bounds().sigma[0]
    count = int(np.count_nonzero(sigma <= least))
    if not count:
        return []
    return [
        f"{count} of {len(sigma)} strokes held at the least sigma, {least}: "
        "their speed profiles are near Gaussians, t0 is open"
    ]
