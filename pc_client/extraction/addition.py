"""Where a further stroke would raise the SNR most, and which strokes have no effect.

Candidates are found by matched pursuit: a lognormal of some width at some time, with the amplitude vector
that fits best, reduces the energy of the residual velocity; the one that reduces it most is chosen and
subtracted, and the search goes on. The strokes are refined together afterwards (`refine`).

Source: the order of Robust XZERO (largest first, subtract, go on), section 3.1 of the theory notes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pc_client.extraction.chain import Chain

__all__ = ["Candidate", "best_candidates", "idle_strokes"]

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


def idle_strokes(chain: Chain, v_scale: float, step: float, cost: float) -> NDArray[np.bool_]:
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
