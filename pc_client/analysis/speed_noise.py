"""What noise of a velocity does to its length, the speed that Eq. 10 judges.

Along a fast motion only the noise in its direction counts. Near rest the length of a noisy zero is never
negative: the speed is too high on average, and all directions count. Both come out of one expectation.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_NODES = 5
"""Nodes of the Gauss-Hermite rule an axis: exact for polynomials up to the ninth degree."""


def speed_noise(v: Array, covariance: Array) -> tuple[Array, Array]:
    """Mean and variance of |v + n| - |v|, n being normal with mean zero.

    Args:
        v: (n, 3) velocities [m/s].
        covariance: (n, 3, 3) or (3, 3), of n [(m/s)2].

    Returns:
        Mean (n,) [m/s] and variance (n,) [(m/s)2], by Gauss-Hermite quadrature.
    """
    nodes, weights = np.polynomial.hermite_e.hermegauss(_NODES)
    grid = np.stack(np.meshgrid(nodes, nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 3)
    share = np.einsum("i,j,k->ijk", weights, weights, weights).ravel()
    share /= share.sum()
    # A root of each covariance; a tiny negative eigenvalue is rounding.
    values, vectors = np.linalg.eigh(np.broadcast_to(covariance, (len(v), 3, 3)))
    roots = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    noisy = np.linalg.norm(v[:, None, :] + grid @ roots.transpose(0, 2, 1), axis=2)
    excess = noisy - np.linalg.norm(v, axis=1)[:, None]
    mean: Array = excess @ share
    variance: Array = np.square(excess) @ share - np.square(mean)
    return mean, np.maximum(variance, 0.0)
