"""Joint refinement of all strokes of a part, in space and time, by least squares.

The residual stacks positions and velocities, each divided by its size over the whole recording, so that

    cost = 10^(-SNR_v / 10) + 10^(-SNR_t / 10)        (summed over the parts)

and neither the drift of a fit to velocities alone nor the rough speed of a fit to positions alone can pass.
All targets are free. The method is Levenberg's and Marquardt's with the analytic Jacobian.

A stroke acts only while it runs, so the time axis is cut into pieces, each piece sees only the strokes that
run in it, and the normal equations are a band about the diagonal: work and memory grow linearly with the
length of a recording.

Source: the damping rule is Nielsen's, as in Madsen, Nielsen & Tingleff, "Methods for non-linear least squares
problems" (2004), section 3.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solveh_banded

from pc_client.extraction.chain import Bounds, Chain, in_order, normals_across
from pc_client.extraction.model import linearise, variables_per_stroke
from pc_client.extraction.regularizer import Regularizer, regularizer_terms

__all__ = ["Fit", "FitTarget", "moved", "refine", "residuals"]

#: A stroke counts as begun and as done at this deviation: Phi(-4.5) = 3.4e-6 of its length.
_TAIL = 4.5
#: Samples a piece of the time axis.
_PIECE = 48
#: OpenBLAS spreads larger products (above 2^18 multiplications) over threads. At the sizes here that gains
#: nothing, and on a busy machine it takes ten times as long.
_SMALL_PRODUCT = 230_000
_DAMPING = 1e-3
#: Longest step of median/width, ln width, sigma, turn and bending in one iteration.
_STEP_LIMITS = (1.0, 0.7, 0.2, 1.0, 1.0)
_PINNED = 1e12


@dataclass(frozen=True, slots=True, eq=False)
class FitTarget:
    """The signal that a fit approximates, with its scales and bounds.

    Attributes:
        t: times, (n,), s, rising.
        p: positions, (n, dim).
        v: velocities, (n, dim).
        p_scale: by which position errors are multiplied before they are squared and summed.
        v_scale: by which velocity errors are.
        freedom: how many independent numbers the signal holds.
        bounds: of the strokes.
    """

    t: NDArray[np.float64]
    p: NDArray[np.float64]
    v: NDArray[np.float64]
    p_scale: float
    v_scale: float
    freedom: float
    bounds: Bounds

    @property
    def top_speed(self) -> float:
        """Highest speed, per s."""
        return float(np.sqrt(np.einsum("ij,ij->i", self.v, self.v).max()))


class Fit(NamedTuple):
    """A chain and the sum of its squared, scaled errors."""

    chain: Chain
    cost: float


class _Equations(NamedTuple):
    """Normal equations.

    Attributes:
        band: the matrix, (columns, bandwidth): each column from the diagonal down.
        gradient: downhill, (columns,).
        cost: squared errors and regularizer.
        error: squared errors alone.
    """

    band: NDArray[np.float64]
    gradient: NDArray[np.float64]
    cost: float
    error: float


def refine(chain: Chain, fit_target: FitTarget, iterations: int, tolerance: float = 3e-3) -> Fit:
    """Improve the strokes for some iterations, or until one gains less than `tolerance` of the cost.

    The cost never grows. Every stroke stays inside the bounds of the fit target. The strokes come back sorted
    by their medians.
    """
    chain = in_order(chain)
    data = _data_equations(chain, fit_target)
    regularizer = Regularizer(data.error / fit_target.freedom, fit_target.top_speed)
    now = _regularized(data, chain, regularizer)
    damping, growth = _DAMPING, 2.0
    for _ in range(iterations):
        step = _solve(now, chain, fit_target.bounds, damping)
        if step is not None:
            tried = moved(chain, step, fit_target.bounds)
            then = _regularized(_data_equations(tried, fit_target), tried, regularizer)
            foreseen = float(step @ (damping * _diagonal(now) * step + now.gradient))
            gain = (now.cost - then.cost) / max(foreseen, 1e-300)
            if then.cost < now.cost:
                little = now.cost - then.cost < tolerance * now.cost
                chain, now = tried, then
                damping *= max(1.0 / 3.0, 1.0 - (2.0 * gain - 1.0) ** 3)
                damping, growth = max(damping, 1e-12), 2.0
                if little:
                    break
                continue
        damping *= growth
        growth *= 2.0
        if damping > 1e6:
            break
    return Fit(in_order(chain), now.error)


def residuals(
    chain: Chain, t: NDArray[np.float64], p: NDArray[np.float64], v: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Recorded less reconstructed positions and velocities at the times t, each (n, dim)."""
    p_left, v_left = np.array(p), np.array(v)
    for rows, first, last in _pieces(chain, t):
        model = linearise(chain, t[rows], first, last)
        p_left[rows] -= model.p
        v_left[rows] -= model.v
    return p_left, v_left


def _pieces(chain: Chain, t: NDArray[np.float64]) -> list[tuple[slice, int, int]]:
    """Pieces of the time axis: rows, first stroke that is not done before, last that begins in it, plus 1."""
    begins, ends = chain.time_at_deviation(-_TAIL), chain.time_at_deviation(_TAIL)
    # Up to stroke j all are done at done_by[j]; from stroke j on none begins before begun_from[j].
    done_by = np.maximum.accumulate(ends)
    begun_from = np.minimum.accumulate(begins[::-1])[::-1]
    pieces = []
    n_pieces = max(1, round(len(t) / _PIECE))
    bounds = np.linspace(0, len(t), n_pieces + 1).astype(int)
    for start, stop in pairwise(bounds.tolist()):
        first = min(int(np.searchsorted(done_by, t[start])), len(chain) - 1)
        last = max(int(np.searchsorted(begun_from, t[stop - 1])), first + 1)
        pieces.append((slice(start, stop), first, last))
    return pieces


def _data_equations(chain: Chain, fit_target: FitTarget) -> _Equations:
    dim = fit_target.p.shape[1]
    size = variables_per_stroke(dim)
    pieces = _pieces(chain, fit_target.t)
    bandwidth = max(last - first for _, first, last in pieces) * size + dim
    columns = dim + len(chain) * size
    # Column j of the matrix from its diagonal down is band[j, : bandwidth]. Seen with steps one shorter, the
    # same memory is the matrix itself, (column, row), so a piece is added as a square. What lies above the
    # diagonal falls into the second half of the columns, which are not read.
    band = np.zeros((columns + 1, 2 * bandwidth))
    stride = band.strides[1]
    square = np.lib.stride_tricks.as_strided(
        band[1:], (columns, columns), ((2 * bandwidth - 1) * stride, stride), writeable=True
    )
    gradient = np.zeros(columns)
    error = 0.0
    for rows, first, last in pieces:
        model = linearise(chain, fit_target.t[rows], first, last)
        left = np.stack(
            (
                (fit_target.p[rows] - model.p).T * fit_target.p_scale,
                (fit_target.v[rows] - model.v).T * fit_target.v_scale,
            )
        )
        model.jacobian[:, 0] *= fit_target.p_scale
        model.jacobian[:, 1] *= fit_target.v_scale
        flat = model.jacobian.reshape(len(model.jacobian), -1)
        flat_left = left.reshape(-1)
        place = slice(first * size, first * size + len(flat))
        step = max(8, _SMALL_PRODUCT // len(flat) ** 2)
        for start in range(0, len(flat_left), step):
            block = flat[:, start : start + step]
            square[place, place] += block @ block.T
            gradient[place] += block @ flat_left[start : start + step]
        error += float(flat_left @ flat_left)
    return _Equations(band[1:, :bandwidth], gradient, error, error)


def _regularized(data: _Equations, chain: Chain, regularizer: Regularizer) -> _Equations:
    terms = regularizer_terms(chain, regularizer)
    width = terms.gradient.shape[1]
    size = variables_per_stroke(chain.targets.shape[1])
    for i in range(width):
        places = slice(i, i + size * len(chain), size)
        data.gradient[places] += terms.gradient[:, i]
        data.band[places, : width - i] += terms.matrix[:, i, i:]
    return _Equations(data.band, data.gradient, data.error + terms.cost, data.error)


def _diagonal(equations: _Equations) -> NDArray[np.float64]:
    diagonal = equations.band[:, 0]
    floored: NDArray[np.float64] = diagonal + 1e-9 * float(diagonal.max())
    return floored


def _solve(equations: _Equations, chain: Chain, bounds: Bounds, damping: float) -> NDArray[np.float64] | None:
    """The damped step; variables that stand at a bound and are pushed over it stay where they are."""
    band = equations.band.T.copy()
    diagonal = _diagonal(equations)
    band[0] += damping * diagonal
    pinned = _pinned(chain, bounds, equations.gradient)
    band[0, pinned] += _PINNED * float(diagonal.max())
    try:
        step: NDArray[np.float64] = solveh_banded(band, equations.gradient, lower=True, check_finite=False)
    except LinAlgError:
        return None
    step[pinned] = 0.0
    return step if np.isfinite(step).all() else None


def _pinned(chain: Chain, bounds: Bounds, downhill: NDArray[np.float64]) -> NDArray[np.bool_]:
    dim = chain.targets.shape[1]
    pinned = np.zeros(len(downhill), dtype=bool)
    table = pinned[dim:].reshape(len(chain), -1)
    pushes = downhill[dim:].reshape(len(chain), -1)
    bounded = (
        (1, chain.width, bounds.width),
        (2, chain.sigma, bounds.sigma),
        (3, chain.arc_angle, bounds.arc_angle),
    )
    for column, values, (least, most) in bounded:
        push = pushes[:, column]
        table[:, column] = ((values <= least) & (push < 0.0)) | ((values >= most) & (push > 0.0))
    return pinned


def moved(chain: Chain, step: NDArray[np.float64], bounds: Bounds) -> Chain:
    """The chain after a step of all variables (columns of `linearise`), kept inside the bounds."""
    dim = chain.targets.shape[1]
    table = step[dim:].reshape(len(chain), -1)
    limits = np.array(_STEP_LIMITS[: table.shape[1] - dim])
    change = np.clip(table[:, :-dim], -limits, limits)
    targets = chain.targets + np.vstack((step[:dim], table[:, -dim:]))
    arc_angle, normal = chain.arc_angle + change[:, 3], chain.normal
    if dim == 3:
        arc_angle, normal = _bent(chain, arc_angle, change[:, 4], np.diff(targets, axis=0))
    return Chain(
        chain.median + chain.width * change[:, 0],
        np.clip(chain.width * np.exp(change[:, 1]), *bounds.width),
        np.clip(chain.sigma + change[:, 2], *bounds.sigma),
        np.clip(arc_angle, *bounds.arc_angle),
        normal,
        targets,
    )


def _bent(
    chain: Chain, arc_angle: NDArray[np.float64], bending: NDArray[np.float64], chords: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Arc angles and normals after a step: arc angle x normal is a vector, and bending moves it sideways."""
    sideways = np.cross(chain.normal, chain.chords)
    norms = np.linalg.norm(sideways, axis=1, keepdims=True)
    vector = arc_angle[:, None] * chain.normal + bending[:, None] * sideways / np.where(
        norms > 0.0, norms, 1.0
    )
    size = np.linalg.norm(vector, axis=1)
    bent = size > 1e-12
    direction = np.where(bent[:, None], vector / np.where(bent, size, 1.0)[:, None], chain.normal)
    sign = np.where(np.einsum("ij,ij->i", direction, chain.normal) < 0.0, -1.0, 1.0)
    return np.where(bent, sign * size, arc_angle), normals_across(chords, sign[:, None] * direction)
