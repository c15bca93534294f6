"""From a recording to Sigma-Lognormal strokes, and how well they reconstruct the recording.

    extraction = extract(read_recording(path))
    extraction.snr_v_db, extraction.n_strokes, extraction.parts[0].trajectory

The figures, over all parts of a recording that move, against the recording low-passed at 12 Hz:

    SNR_v        10 log10( sum |v|^2 / sum |v - v_hat|^2 ), on the velocity vector
    SNR_t        10 log10( sum |p - mean p|^2 / sum |p - p_hat|^2 ), mean p of each part by itself
    lognormality SNR_v / number of strokes

The raw SNR_v and SNR_t are against the samples of the recording as they are: SNR_t at their times, SNR_v on
the mean velocities between them, each weighted by the time between them.

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
from pc_client.studies.extraction.refine import residuals
from pc_client.studies.extraction.smoothing import moves, smooth_part, speed_peaks
from pc_client.studies.signals import Trace, decibels

#: Samples that are nearer count as this far from each other, s: no hand moves in less.
_SHORTEST_STEP_S = 1e-6


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
    n_speed_peaks: int

    @property
    def n_strokes(self) -> int:
        """Number of strokes."""
        return len(self.trajectory.strokes)


@dataclass(frozen=True, slots=True, eq=False)
class Extraction:
    """The strokes of a recording.

    Attributes:
        parts: those that move, in order of time.
        snr_v_db: over all parts, or None when nothing moves; so the next three.
        raw_snr_v_db: against the samples before the low-pass; so the next.
        remarks: what was mended in the recording, and what to know about the strokes.
        still: parts without a movement: dots and touches. They have no strokes.
    """

    name: str
    parts: tuple[PartExtraction, ...] = ()
    snr_v_db: float | None = None
    snr_t_db: float | None = None
    raw_snr_v_db: float | None = None
    raw_snr_t_db: float | None = None
    remarks: tuple[str, ...] = ()
    still: tuple[PenPart, ...] = ()

    @property
    def n_strokes(self) -> int:
        """Of all parts."""
        return sum(part.n_strokes for part in self.parts)

    @property
    def n_speed_peaks(self) -> int:
        """Of all parts."""
        return sum(part.n_speed_peaks for part in self.parts)

    @property
    def lognormality(self) -> float | None:
        """SNR_v per stroke, dB, or None when nothing moves."""
        return None if self.snr_v_db is None else self.snr_v_db / self.n_strokes


def extract(recording: PenRecording, options: ExtractOptions | None = None) -> Extraction:
    """Find the strokes of a recording. It does not fail: what cannot be used is left out with a remark."""
    options = options or ExtractOptions()
    moving = [part for part in recording.parts if moves(part)]
    still = tuple(part for part in recording.parts if not moves(part))
    remarks = list(recording.remarks)
    if still:
        remarks.append(f"{len(still)} of {len(recording.parts)} parts hold no movement (dots) and no stroke")
    if not moving:
        return Extraction(recording.name, remarks=tuple(remarks), still=still)
    smooth = [smooth_part(part) for part in moving]
    n_peaks = [len(speed_peaks(part)) for part in smooth]
    budget = max(len(smooth), math.floor(options.strokes_per_peak * sum(n_peaks) + 1e-9))
    fitted = fit_parts(smooth, budget, options.fit)
    remarks += _degenerate(fitted.chains)
    n_strokes = sum(map(len, fitted.chains))
    if n_strokes > budget:
        remarks.append(
            f"{n_strokes} strokes, {n_strokes - budget} more than asked: fewer reconstruct too little"
        )
    parts, powers, raw_powers = [], [], []
    for pen, part, chain, count in zip(moving, smooth, fitted.chains, n_peaks, strict=True):
        powers.append(_powers(part, *left_over(chain, part, through=fitted.through)))
        raw_powers.append(_raw_powers(pen, chain))
        trajectory = sigma_lognormal(chain, float(part.t[-1]))
        parts.append(PartExtraction(part.t, part.p, part.v, trajectory, *ratios(powers[-1]), count))
    snr, raw_snr = ratios(np.sum(powers, axis=0)), ratios(np.sum(raw_powers, axis=0))
    return Extraction(recording.name, tuple(parts), *snr, *raw_snr, tuple(remarks), still)


def _powers(signal: Trace, p_left: Array, v_left: Array) -> Array:
    """Of velocity and its error, of position and its error."""
    moved = signal.p - signal.p.mean(axis=0)
    return np.array([np.sum(values**2) for values in (signal.v, v_left, moved, p_left)])


def _raw_powers(part: PenPart, chain: Chain) -> Array:
    """The same for the samples as they are."""
    still = np.zeros_like(part.p)
    p_left, _ = residuals(chain, Trace(part.t, part.p, still))
    root_steps = np.sqrt(np.diff(part.t).clip(_SHORTEST_STEP_S))[:, None]
    v, v_left = (np.diff(p, axis=0) / root_steps for p in (part.p, p_left))
    return _powers(Trace(part.t, part.p, v), p_left, v_left)


def ratios(powers: Array) -> tuple[float, float]:
    """SNR_v and SNR_t, dB, by powers: of velocity and its error, of position and its error."""
    return decibels(powers[0], powers[1]), decibels(powers[2], powers[3])


def _degenerate(chains: Sequence[Chain]) -> list[str]:
    sigma = np.concatenate([chain.sigma for chain in chains])
    least = Bounds().sigma[0]
    if not (count := int(np.count_nonzero(sigma <= least))):
        return []
    return [
        f"{count} of {len(sigma)} strokes held at the least sigma, {least}: "
        "their speed profiles are near Gaussians, t0 is open"
    ]
