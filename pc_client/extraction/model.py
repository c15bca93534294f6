"""Position and velocity of a chain of strokes, and their derivatives by every variable, in closed form.

With u = (t - m) / w, z = ln(1 + sigma u) / sigma, F = Phi(z) and Lambda = dF/dt, a stroke with chord c,
arc angle d about the normal n and k = 1 / sinc(d / 2) has

    v(t) = Lambda k [cos(d (F - 1/2)) c + sin(d (F - 1/2)) n x c]
    p(t) = k [C c + S n x c],   C + i S = integral from 0 to F of exp(i d (f - 1/2)) df

Everything is a number per time and stroke, times one of two vectors, c and n x c. That holds for flat and
spatial strokes alike; the latter have one variable more, the bending out of their plane, whose vector is n.

Variables of a stroke, in this order: median (in units of its width), ln width, sigma, arc angle, bending
(rad, spatial strokes only), end target. The first target stands before them all.

Source: section 1.5 of the theory notes; derivatives by hand, held against differences by a test.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from pc_client.extraction.chain import Chain

__all__ = ["Linearisation", "linearise", "variables_per_stroke"]

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
