"""Joint refinement of all strokes of a part, in space and time, by least squares with analytic derivatives.

With u = (t - m) / w, z = ln(1 + sigma u) / sigma, F = Phi(z) and Lambda = dF/dt, a stroke with chord c,
arc angle d about the normal n and k = 1 / sinc(d / 2) has

    v(t) = Lambda k [cos(d (F - 1/2)) c + sin(d (F - 1/2)) n x c]
    p(t) = k [C c + S n x c],   C + i S = integral from 0 to F of exp(i d (f - 1/2)) df

so everything is a number per time and stroke, times c or n x c, for flat and spatial strokes alike; these
have one variable more, the bending out of their plane, whose vector is n. Variables of a stroke, in this
order: median (in units of its width), ln width, sigma, arc angle, bending (rad, spatial strokes only), end
target. The first target stands before them all; all targets are free.

The residual stacks positions and velocities, each divided by its size over the whole recording:

    cost        = 10^(-SNR_v / 10) + 10^(-SNR_t / 10)        (summed over the parts), and the regularizer
    regularizer = weight * sum over strokes of [ (ln(sigma / .2) / .5)^2 + (peak speed / top speed)^2 ]

The regularizer chooses between chains that explain a recording equally well: for narrow speed profiles sigma
is hardly visible, and of two neighbouring strokes only the sum is. Its weight is the residual per independent
number of a 12 Hz signal, so it vanishes with the residual: clean strokes are recovered unchanged.

The method is Levenberg's and Marquardt's. A stroke acts only while it runs, so the time axis is cut into
pieces and the normal equations are a band: work and memory grow linearly with the length of a recording.

Source: docs/theory.md, section 1, "The path of a stroke"; the damping rule is Nielsen's, as in Madsen,
Nielsen & Tingleff, "Methods for non-linear least squares problems" (2004), section 3.2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solveh_banded
from scipy.special import ndtr

from pc_client.studies.extraction.chain import Bounds, Chain, in_order, normals_across

__all__ = [
    "Fit",
    "FitTarget",
    "Linearisation",
    "Regularizer",
    "RegularizerTerms",
    "linearise",
    "moved",
    "refine",
    "residuals",
    "variables_per_stroke",
]


_INV_SQRT_TWO_PI = 1.0 / math.sqrt(2.0 * math.pi)
#: |arc_angle| below which the first terms of a series replace differences of nearly equal numbers.
_STRAIGHT = 1e-3


class Linearisation(NamedTuple):
    """A piece of a movement at given times and how it changes.

    Attributes:
        p: positions, (n, dim).
        v: velocities, (n, dim).
        jacobian: derivatives, (columns, 2, dim, n): of p, then of v, by each variable.
    """

    p: NDArray[np.float64]
    v: NDArray[np.float64]
    jacobian: NDArray[np.float64]


def variables_per_stroke(dim: int) -> int:
    """Number of variables of one stroke in the plane (2) or in space (3)."""
    return 6 if dim == 2 else 8


def linearise(chain: Chain, t: NDArray[np.float64], first: int, last: int) -> Linearisation:
    """Evaluate strokes first .. last - 1 at the times t (n,), when all before are done and none after begun.

    The rows of the Jacobian: the target at which stroke `first` begins, then the variables of each stroke.
    """
    s = slice(first, last)
    m, w, sigma, arc_angle = (
        values[s, None] for values in (chain.median, chain.width, chain.sigma, chain.arc_angle)
    )
    targets = chain.targets[first : last + 1]
    chord = targets[1:] - targets[:-1]
    dim = chord.shape[1]
    across = _cross(chain.normal[s], chord)

    # The speed profiles, (strokes, n): F, Lambda and the logarithmic derivatives of Lambda.
    u = (t - m) / w
    x = 1.0 + sigma * u
    begun = x > 1e-12
    x = np.where(begun, x, 1.0)
    g = 1.0 / x
    z = np.log(x) / sigma
    phi = np.exp(-0.5 * z * z) * (_INV_SQRT_TWO_PI * begun)
    done = ndtr(z) * begun
    phi_g = phi * g
    rate = phi_g / w
    z_sigma = (u * g - z) / sigma
    h = g * (z + sigma)
    log_rate = (h, u * h - 1.0, -z * z_sigma - u * g)
    done_by = (-phi_g, -u * phi_g, phi * z_sigma)

    # The arcs: coefficients of the chord and of the vector across it.
    k = 1.0 / _sinc(0.5 * arc_angle)
    k_log_slope = np.where(np.abs(arc_angle) < _STRAIGHT, arc_angle / 12.0, _safe_slope(arc_angle))
    lag = done - 0.5
    beta = arc_angle * lag
    cos, sin = k * np.cos(beta), k * np.sin(beta)
    v_c, v_q = rate * cos, rate * sin
    p_c, p_q, dp_c, dp_q = _arc_integrals(arc_angle, done, cos, sin, k)

    n, size = len(t), variables_per_stroke(dim)
    jacobian = np.zeros((dim + (last - first) * size, 2, dim, n))
    by_stroke = jacobian[dim:].reshape(last - first, size, 2, dim, n)
    p_turned = (k_log_slope * p_c + dp_c, k_log_slope * p_q + dp_q)
    v_turned = (k_log_slope * v_c - lag * v_q, k_log_slope * v_q + lag * v_c)
    turned_rates = tuple(rate * arc_angle * change for change in done_by)
    gained_rates = tuple(rate * gain for gain in log_rate)
    for i in range(dim):
        c, q = chord[:, i, None], across[:, i, None]
        along, sideways = cos * c + sin * q, cos * q - sin * c
        for row in range(3):
            np.multiply(done_by[row], along, out=by_stroke[:, row, 0, i])
            by_stroke[:, row, 1, i] = gained_rates[row] * along + turned_rates[row] * sideways
        by_stroke[:, 3, 0, i] = p_turned[0] * c + p_turned[1] * q
        by_stroke[:, 3, 1, i] = v_turned[0] * c + v_turned[1] * q
    if dim == 3:
        # Bending turns the vector across, n x c, towards -n at right angles to both.
        out_of_plane = -chain.normal[s] * np.linalg.norm(chord, axis=1)[:, None]
        small = np.abs(arc_angle) < _STRAIGHT
        safe = np.where(small, 1.0, arc_angle)
        bend_v = rate * np.where(small, k * lag, sin / safe)
        bend_p = np.where(small, 0.5 * k * (done * done - done), p_q / safe)
        by_stroke[:, 4, 0] = bend_p[:, None] * out_of_plane[:, :, None]
        by_stroke[:, 4, 1] = bend_v[:, None] * out_of_plane[:, :, None]
    _add_targets(jacobian, by_stroke, chain.normal[s], ((p_c, p_q), (v_c, v_q)))
    p = targets[0] + p_c.T @ chord + p_q.T @ across
    return Linearisation(p, v_c.T @ chord + v_q.T @ across, jacobian)


def _cross(normal: NDArray[np.float64], chord: NDArray[np.float64]) -> NDArray[np.float64]:
    if chord.shape[1] == 2:
        return np.column_stack((-chord[:, 1], chord[:, 0]))
    return np.cross(normal, chord)


def _sinc(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    nonzero = np.where(angle == 0.0, 1e-20, angle)
    value: NDArray[np.float64] = np.sin(nonzero) / nonzero
    return value


def _safe_slope(arc_angle: NDArray[np.float64]) -> NDArray[np.float64]:
    safe = np.where(np.abs(arc_angle) < _STRAIGHT, 1.0, arc_angle)
    slope: NDArray[np.float64] = 1.0 / safe - 0.5 / np.tan(0.5 * safe)
    return slope


def _arc_integrals(
    arc_angle: NDArray[np.float64],
    done: NDArray[np.float64],
    cos: NDArray[np.float64],
    sin: NDArray[np.float64],
    k: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """The integrals k C and k S, and k dC/dd and k dS/dd; cos and sin are those of the tangent, times k."""
    half = 0.5 * arc_angle
    reach = k * done * _sinc(half * done)
    angle = half * done - half
    c, s = reach * np.cos(angle), reach * np.sin(angle)
    small = np.abs(arc_angle) < _STRAIGHT
    safe = np.where(small, 1.0, arc_angle)
    lag = done - 0.5
    dc = (lag * cos + 0.5 * k * np.cos(half) - c) / safe
    ds = (lag * sin - 0.5 * k * np.sin(half) - s) / safe
    if small.any():
        dc = np.where(small, -arc_angle * (lag**3 + 0.125) / 3.0, dc)
        ds = np.where(small, 0.5 * (done * done - done), ds)
    return c, s, dc, ds


def _add_targets(
    jacobian: NDArray[np.float64],
    by_stroke: NDArray[np.float64],
    normal: NDArray[np.float64],
    coefficients: tuple[tuple[NDArray[np.float64], NDArray[np.float64]], ...],
) -> None:
    """The rows of the targets: a target ends one stroke, G_j, and takes from the next, - G_(j+1)."""
    dim = jacobian.shape[2]
    if dim == 2:
        turning = np.array([[[0.0, -1.0], [1.0, 0.0]]])
    else:
        x, y, z = normal.T
        o = np.zeros_like(x)
        turning = np.array([[o, -z, y], [z, o, -x], [-y, x, o]]).transpose(2, 0, 1)
    for kind, (along, sideways) in enumerate(coefficients):
        for i in range(dim):
            for j in range(dim):
                own = along if i == j else sideways * turning[:, i, j, None]
                ends = by_stroke[:, j - dim, kind, i]
                ends[...] = own
                ends[:-1] -= own[1:]
                jacobian[j, kind, i] = (1.0 if kind == 0 and i == j else 0.0) - own[0]


#: Middle and spread (of the logarithm) of sigma in handwriting: docs/extraction.md, section 5.
_SIGMA, _SPREAD = 0.2, 0.5
_SQRT_TWO_PI = math.sqrt(2.0 * math.pi)


class Regularizer(NamedTuple):
    """How strongly a fit is regularized.

    Attributes:
        weight: of the regularizer in the cost.
        top_speed: of the part, > 0.
    """

    weight: float
    top_speed: float


class RegularizerTerms(NamedTuple):
    """The regularizer at a chain: cost, and for every stroke its part of the normal equations.

    Attributes:
        cost: of all strokes.
        gradient: (s, columns), downhill.
        matrix: (s, columns, columns). The columns are the target at which the stroke begins and the
            variables of the stroke, as in `linearise`.
    """

    cost: float
    gradient: NDArray[np.float64]
    matrix: NDArray[np.float64]


def _regularizer_terms(chain: Chain, regularizer: Regularizer) -> RegularizerTerms:
    """Cost, gradient and (Gauss-Newton) matrix of the regularizer."""
    root = math.sqrt(regularizer.weight)
    count, dim = len(chain), chain.targets.shape[1]
    size = 6 if dim == 2 else 8
    half = 0.5 * chain.arc_angle
    per_chord = root / (np.sinc(half / math.pi) * chain.width * _SQRT_TWO_PI * regularizer.top_speed)
    peak = per_chord[:, None] * chain.chords
    skew = root * np.log(chain.sigma / _SIGMA) / _SPREAD
    jacobian = np.zeros((count, dim + 1, dim + size))
    for i in range(dim):
        jacobian[:, i, i] = -per_chord
        jacobian[:, i, size + i] = per_chord
    jacobian[:, :dim, dim + 1] = -peak
    straight = np.abs(half) < 1e-3
    safe = np.where(straight, 1.0, half)
    slope = np.where(straight, half / 6.0, 0.5 / safe - 0.5 / np.tan(safe))
    jacobian[:, :dim, dim + 3] = slope[:, None] * peak
    jacobian[:, dim, dim + 2] = root / (_SPREAD * chain.sigma)
    value = np.column_stack((peak, skew))
    return RegularizerTerms(
        float(np.sum(value**2)),
        -np.einsum("sri,sr->si", jacobian, value),
        jacobian.transpose(0, 2, 1) @ jacobian,
    )


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
    terms = _regularizer_terms(chain, regularizer)
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
