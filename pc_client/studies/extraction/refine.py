"""Joint refinement of all strokes of a part, in space and time, by least squares with analytic derivatives.

The model is that of the paper, in the variables of `chain`. With u = (t - m) / w, the time since the median
in widths, a stroke of chord c that turns by the arc angle d about the normal n has

    z = ln(1 + sigma u) / sigma                          its deviation, (ln(t - t0) - mu) / sigma
    F = Phi(z)                                           the share of its length that is done (Eq. 4)
    Lambda = dF/dt = phi(z) / (w (1 + sigma u))          its speed profile (Eq. 2)
    d (F - 1/2)                                          the angle from the chord to its velocity (Eq. 3)
    v = Lambda k [cos(d (F - 1/2)) c + sin(d (F - 1/2)) n x c]
    p = k [C c + S n x c],    C + i S = integral from 0 to F of exp(i d (f - 1/2)) df

where k = 1 / sinc(d / 2) is the length of the arc over that of its chord. So everything is a number per time
and stroke, times c or n x c, for flat and spatial strokes alike.

Variables of a stroke, in this order: median (in units of its width), ln width, sigma, arc angle, bending
(rad, spatial strokes only: it turns the plane of the arc), end target. The first target stands before them
all; all targets are free. The residual stacks positions and velocities, each divided by its size over the
whole recording:

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

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solveh_banded
from scipy.special import ndtr

from pc_client.arrays import Array
from pc_client.studies.extraction.chain import Bounds, Chain, in_order, normals_across
from pc_client.studies.signals import Trace

_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-3, 1e-12, 1e6
#: Longest step of median/width, ln width, sigma, arc angle and bending in one iteration.
_STEP_LIMITS = (1.0, 0.7, 0.2, 1.0, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Goal:
    """What a fit approximates.

    Attributes:
        p_scale: by which position errors are multiplied before they are squared and summed.
        v_scale: by which velocity errors are.
        freedom: how many independent numbers the signal holds.
    """

    signal: Trace
    p_scale: float
    v_scale: float
    freedom: float
    bounds: Bounds


class Fit(NamedTuple):
    """A chain and the sum of its squared, scaled errors."""

    chain: Chain
    cost: float


def refine(chain: Chain, goal: Goal, iterations: int, tolerance: float = 3e-3) -> Fit:
    """Improve the strokes for some iterations, or until one gains less than `tolerance` of the cost.

    The cost never grows. Every stroke stays inside the bounds of the goal. The strokes come back sorted by
    their medians.
    """
    chain = in_order(chain)
    data = _data_equations(chain, goal)
    weight, top_speed = data.error / goal.freedom, float(goal.signal.speed.max())
    now = _regularized(data, chain, weight, top_speed)
    damping, growth = _DAMPING, 2.0
    for _ in range(iterations):
        step = _damped_step(now, chain, goal.bounds, damping)
        if step is not None:
            tried = moved(chain, step, goal.bounds)
            then = _regularized(_data_equations(tried, goal), tried, weight, top_speed)
            if then.cost < now.cost:
                gained, before = now.cost - then.cost, now.cost
                foreseen = float(step @ (damping * _diagonal(now) * step + now.gradient))
                success = gained / max(foreseen, 1e-300)
                damping *= max(1.0 / 3.0, 1.0 - (2.0 * success - 1.0) ** 3)
                damping, growth = max(damping, _LEAST_DAMPING), 2.0
                chain, now = tried, then
                if gained < tolerance * before:
                    break
                continue
        damping *= growth
        growth *= 2.0
        if damping > _MOST_DAMPING:
            break
    return Fit(in_order(chain), now.error)


def residuals(chain: Chain, signal: Trace) -> tuple[Array, Array]:
    """Positions and velocities of a signal less those of the strokes, each (n, dim)."""
    p_left, v_left = np.array(signal.p), np.array(signal.v)
    for rows, first, last in _pieces(chain, signal.t):
        model = linearise(chain, signal.t[rows], first, last)
        p_left[rows] -= model.p
        v_left[rows] -= model.v
    return p_left, v_left


def moved(chain: Chain, step: Array, bounds: Bounds) -> Chain:
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


def _bent(chain: Chain, arc_angle: Array, bending: Array, chords: Array) -> tuple[Array, Array]:
    """Arc angles and normals after a step: arc angle x normal is a vector, and bending moves it sideways."""
    sideways = np.cross(chain.normal, chain.chords)
    norms = np.linalg.norm(sideways, axis=1, keepdims=True)
    sideways /= np.where(norms > 0.0, norms, 1.0)
    vector = arc_angle[:, None] * chain.normal + bending[:, None] * sideways
    size = np.linalg.norm(vector, axis=1)
    bent = size > 1e-12
    direction = np.where(bent[:, None], vector / np.where(bent, size, 1.0)[:, None], chain.normal)
    sign = np.where(np.einsum("ij,ij->i", direction, chain.normal) < 0.0, -1.0, 1.0)
    return np.where(bent, sign * size, arc_angle), normals_across(chords, sign[:, None] * direction)


# The model and its derivatives. Arrays of it are (strokes, n) unless they say otherwise.

_SQRT_TWO_PI = math.sqrt(2.0 * math.pi)
#: |arc_angle| below which the first terms of a series replace differences of nearly equal numbers.
_STRAIGHT = 1e-3


class Linearisation(NamedTuple):
    """A piece of a movement at given times and how it changes.

    Attributes:
        p: positions, (n, dim).
        v: velocities, (n, dim).
        jacobian: derivatives, (columns, 2, dim, n): of p, then of v, by each variable.
    """

    p: Array
    v: Array
    jacobian: Array


def variables_per_stroke(dim: int) -> int:
    """Number of variables of one stroke in the plane (2) or in space (3)."""
    return 6 if dim == 2 else 8


def linearise(chain: Chain, t: Array, first: int, last: int) -> Linearisation:
    """Evaluate strokes first .. last - 1 at the times t (n,), when all before are done and none after begun.

    The columns of the Jacobian: the target at which stroke `first` begins, then the variables of each stroke.
    """
    targets, normal = chain.targets[first : last + 1], chain.normal[first:last]
    chord = np.diff(targets, axis=0)
    count, dim = chord.shape
    turning = _turning(normal, dim)
    across = (turning @ chord[:, :, None])[:, :, 0]
    arc_angle = chain.arc_angle[first:last, None]
    done, rate, done_by, log_rate_by = _profiles(chain, t, first, last)

    def vectors(along: Array, sideways: Array) -> Array:
        """(strokes, dim, n), from components along the chord and across it."""
        return along[:, None] * chord[:, :, None] + sideways[:, None] * across[:, :, None]

    # Derivatives of k are k times those of ln k.
    k = 1.0 / np.sinc(0.5 * arc_angle / math.pi)
    k_log_slope = _log_slope(arc_angle)
    lag = done - 0.5
    cos, sin = k * np.cos(arc_angle * lag), k * np.sin(arc_angle * lag)
    v_c, v_q = rate * cos, rate * sin
    p_c, p_q, p_c_slope, p_q_slope = _arc_integrals(arc_angle, done, cos, sin, k)

    size = variables_per_stroke(dim)
    jacobian = np.zeros((dim + count * size, 2, dim, len(t)))
    by_stroke = jacobian[dim:].reshape(count, size, 2, dim, len(t))
    tangent, aside = vectors(cos, sin), vectors(-sin, cos)
    for row in range(3):  # median, ln width, sigma: they act through F and Lambda
        by_stroke[:, row, 0] = done_by[row][:, None] * tangent
        gained, turned = rate * log_rate_by[row], rate * arc_angle * done_by[row]
        by_stroke[:, row, 1] = gained[:, None] * tangent + turned[:, None] * aside
    by_stroke[:, 3, 0] = vectors(k_log_slope * p_c + p_c_slope, k_log_slope * p_q + p_q_slope)
    by_stroke[:, 3, 1] = vectors(k_log_slope * v_c - lag * v_q, k_log_slope * v_q + lag * v_c)
    if dim == 3:  # bending turns the vector across, n x c, towards -n at right angles to both
        out_of_plane = (-normal * np.linalg.norm(chord, axis=1)[:, None])[:, :, None]
        small = np.abs(arc_angle) < _STRAIGHT
        safe = np.where(small, 1.0, arc_angle)
        bend_p = np.where(small, 0.5 * k * (done * done - done), p_q / safe)
        bend_v = rate * np.where(small, k * lag, sin / safe)
        by_stroke[:, 4, 0] = bend_p[:, None] * out_of_plane
        by_stroke[:, 4, 1] = bend_v[:, None] * out_of_plane
    # With G the matrix that makes position or velocity of a chord, a target adds G of the stroke that ends
    # there and takes off G of the next; the first target moves the whole path with it.
    unit = np.eye(dim)[:, :, None]
    for kind, (along, sideways) in enumerate(((p_c, p_q), (v_c, v_q))):
        g = along[:, None, None] * unit + sideways[:, None, None] * turning[:, :, :, None]
        by_stroke[:, -dim:, kind] = g.swapaxes(1, 2)
        by_stroke[:-1, -dim:, kind] -= g[1:].swapaxes(1, 2)
        jacobian[:dim, kind] = (unit if kind == 0 else 0.0) - g[0].swapaxes(0, 1)
    p = targets[0] + p_c.T @ chord + p_q.T @ across
    return Linearisation(p, v_c.T @ chord + v_q.T @ across, jacobian)


class _Profiles(NamedTuple):
    """F and Lambda of strokes; derivatives of F and of ln Lambda by median/width, ln width and sigma."""

    done: Array
    rate: Array
    done_by: tuple[Array, Array, Array]
    log_rate_by: tuple[Array, Array, Array]


def _profiles(chain: Chain, t: Array, first: int, last: int) -> _Profiles:
    m, w, sigma = (values[first:last, None] for values in (chain.median, chain.width, chain.sigma))
    u = (t - m) / w
    x = 1.0 + sigma * u
    begun = x > 1e-12
    x = np.where(begun, x, 1.0)
    g = 1.0 / x
    z = np.log(x) / sigma
    phi = np.exp(-0.5 * z * z) * (1.0 / _SQRT_TWO_PI * begun)
    phi_g = phi * g
    z_sigma = (u * g - z) / sigma
    h = g * (z + sigma)
    return _Profiles(
        ndtr(z) * begun,
        phi_g / w,
        (-phi_g, -u * phi_g, phi * z_sigma),
        (h, u * h - 1.0, -z * z_sigma - u * g),
    )


def _turning(normal: Array, dim: int) -> Array:
    """The matrices that turn a chord by 90 degrees about the normals, (strokes or 1, dim, dim)."""
    if dim == 2:
        return np.array([[[0.0, -1.0], [1.0, 0.0]]])
    return np.cross(normal[:, None], np.eye(3)).swapaxes(1, 2)


def _log_slope(arc_angle: Array, straight: float = _STRAIGHT) -> Array:
    """The derivative of ln k by the arc angle; near 0 by its series."""
    small = np.abs(arc_angle) < straight
    safe = np.where(small, 1.0, arc_angle)
    return np.where(small, arc_angle / 12.0, 1.0 / safe - 0.5 / np.tan(0.5 * safe))


def _arc_integrals(
    arc_angle: Array, done: Array, cos: Array, sin: Array, k: Array
) -> tuple[Array, Array, Array, Array]:
    """The integrals k C and k S, and k dC/dd and k dS/dd; cos and sin are those of the tangent, times k."""
    half = 0.5 * arc_angle
    reach = k * done * np.sinc(half * done / math.pi)
    angle = half * done - half
    c, s = reach * np.cos(angle), reach * np.sin(angle)
    small = np.abs(arc_angle) < _STRAIGHT
    safe = np.where(small, 1.0, arc_angle)
    lag = done - 0.5
    c_slope = (lag * cos + 0.5 * k * np.cos(half) - c) / safe
    s_slope = (lag * sin - 0.5 * k * np.sin(half) - s) / safe
    if small.any():
        c_slope = np.where(small, -arc_angle * (lag**3 + 0.125) / 3.0, c_slope)
        s_slope = np.where(small, 0.5 * (done * done - done), s_slope)
    return c, s, c_slope, s_slope


# The normal equations.

#: A stroke counts as begun and as done at this deviation: Phi(-4.5) = 3.4e-6 of its length.
_TAIL = 4.5
#: Samples a piece of the time axis.
_PIECE = 48
#: OpenBLAS spreads larger products (above 2^18 multiplications) over threads. At the sizes here that gains
#: nothing, and on a busy machine it takes ten times as long.
_SMALL_PRODUCT = 230_000
#: Added to the diagonal for a variable that must not move, over the largest of its elements.
_PINNED = 1e12
#: Middle and spread (of the logarithm) of sigma in handwriting: docs/extraction.md, section 5.
_SIGMA, _SPREAD = 0.2, 0.5


class _Equations(NamedTuple):
    """Normal equations.

    Attributes:
        band: the matrix, (columns, bandwidth): each column from the diagonal down.
        gradient: downhill, (columns,).
        cost: squared errors and regularizer.
        error: squared errors alone.
    """

    band: Array
    gradient: Array
    cost: float
    error: float


def _pieces(chain: Chain, t: Array) -> list[tuple[slice, int, int]]:
    """Pieces of the time axis: rows, first stroke that is not done before, last that begins in it, plus 1."""
    begins, ends = chain.time_at_deviation(-_TAIL), chain.time_at_deviation(_TAIL)
    # Up to stroke j all are done at done_by[j]; from stroke j on none begins before begun_from[j].
    done_by = np.maximum.accumulate(ends)
    begun_from = np.minimum.accumulate(begins[::-1])[::-1]
    pieces = []
    edges = np.linspace(0, len(t), max(1, round(len(t) / _PIECE)) + 1).astype(int)
    for start, stop in pairwise(edges.tolist()):
        first = min(int(np.searchsorted(done_by, t[start])), len(chain) - 1)
        last = max(int(np.searchsorted(begun_from, t[stop - 1])), first + 1)
        pieces.append((slice(start, stop), first, last))
    return pieces


def _data_equations(chain: Chain, goal: Goal) -> _Equations:
    """The equations of the errors alone, piece by piece."""
    signal = goal.signal
    dim = signal.p.shape[1]
    size = variables_per_stroke(dim)
    pieces = _pieces(chain, signal.t)
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
        model = linearise(chain, signal.t[rows], first, last)
        p_left, v_left = signal.p[rows] - model.p, signal.v[rows] - model.v
        left = np.concatenate((goal.p_scale * p_left.T, goal.v_scale * v_left.T)).ravel()
        model.jacobian[:, 0] *= goal.p_scale
        model.jacobian[:, 1] *= goal.v_scale
        flat = model.jacobian.reshape(len(model.jacobian), -1)
        place = slice(first * size, first * size + len(flat))
        step = max(8, _SMALL_PRODUCT // len(flat) ** 2)
        for start in range(0, len(left), step):
            block = flat[:, start : start + step]
            square[place, place] += block @ block.T
            gradient[place] += block @ left[start : start + step]
        error += float(left @ left)
    return _Equations(band[1:, :bandwidth], gradient, error, error)


def _regularized(data: _Equations, chain: Chain, weight: float, top_speed: float) -> _Equations:
    """Add the regularizer to the equations of the data, in their memory."""
    value, jacobian = _regularizer(chain, weight, top_speed)
    gradient = -np.einsum("sri,sr->si", jacobian, value)
    matrix = jacobian.transpose(0, 2, 1) @ jacobian
    width, size = gradient.shape[1], variables_per_stroke(chain.targets.shape[1])
    for i in range(width):
        places = slice(i, i + size * len(chain), size)
        data.gradient[places] += gradient[:, i]
        data.band[places, : width - i] += matrix[:, i, i:]
    return _Equations(data.band, data.gradient, data.error + float(np.sum(value**2)), data.error)


def _regularizer(chain: Chain, weight: float, top_speed: float) -> tuple[Array, Array]:
    """What the regularizer squares for each stroke, (strokes, dim + 1), and its derivatives.

    Its values are the vector of the peak speed and the logarithm of sigma. The derivatives, (strokes,
    dim + 1, columns), are by the target at which the stroke begins and by the variables of the stroke.
    """
    root = math.sqrt(weight)
    count, dim = len(chain), chain.targets.shape[1]
    size = variables_per_stroke(dim)
    per_chord = root / (np.sinc(0.5 * chain.arc_angle / math.pi) * chain.width * _SQRT_TWO_PI * top_speed)
    peak = per_chord[:, None] * chain.chords
    skew = root * np.log(chain.sigma / _SIGMA) / _SPREAD
    jacobian = np.zeros((count, dim + 1, dim + size))
    for i in range(dim):
        jacobian[:, i, i] = -per_chord
        jacobian[:, i, size + i] = per_chord
    jacobian[:, :dim, dim + 1] = -peak
    jacobian[:, :dim, dim + 3] = _log_slope(chain.arc_angle, 2.0 * _STRAIGHT)[:, None] * peak
    jacobian[:, dim, dim + 2] = root / (_SPREAD * chain.sigma)
    return np.column_stack((peak, skew)), jacobian


def _diagonal(equations: _Equations) -> Array:
    diagonal = equations.band[:, 0]
    return diagonal + 1e-9 * float(diagonal.max())


def _damped_step(equations: _Equations, chain: Chain, bounds: Bounds, damping: float) -> Array | None:
    """The damped step; variables that stand at a bound and are pushed over it stay where they are."""
    band = equations.band.T.copy()
    diagonal = _diagonal(equations)
    band[0] += damping * diagonal
    pinned = _pinned(chain, bounds, equations.gradient)
    band[0, pinned] += _PINNED * float(diagonal.max())
    try:
        step: Array = solveh_banded(band, equations.gradient, lower=True, check_finite=False)
    except LinAlgError:
        return None
    step[pinned] = 0.0
    return step if np.isfinite(step).all() else None


def _pinned(chain: Chain, bounds: Bounds, downhill: Array) -> NDArray[np.bool_]:
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
