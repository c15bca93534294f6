"""The loop delay from a logged stream: by how much reported positions trail the integral of the commands.

The figure holds everything between the moment a command is computed and the moment its effect is reported:
network, dead time of the controller, lag of the drives, age of the feedback. It is found from the stream
alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pc_client.errors import DriverError

LONGEST_DELAY = 0.2
"""Delays up to this are looked for [s]; UR users report 16 to 80 ms."""

_COARSE_STEP = 2e-3
_FINE_STEP = 0.25e-3
_LEAST_MOTION = 2e-3
"""A joint that was commanded to move less than this [rad] says nothing."""

_WORST_RESIDUAL = 0.25
"""Share of the commanded motion that may stay unexplained before the estimate is refused."""


@dataclass(frozen=True, slots=True)
class DelayEstimate:
    """An identified loop delay.

    Attributes:
        delay: the delay [s].
        residual: rms of what the delayed commands do not explain [rad].
        motion: rms of the commanded motion about its mean [rad].
        n_samples: frames used.
    """

    delay: float
    residual: float
    motion: float
    n_samples: int


def estimate_delay(
    t: NDArray[np.float64], qd_cmd: NDArray[np.float64], q: NDArray[np.float64], period: float
) -> DelayEstimate:
    """Find the delay T that best explains q(t) = q0 + integral of qd_cmd up to t - T, over all joints.

    Args:
        t: (n,) time stamps of the frames [s], rising.
        qd_cmd: (n, 6) command sent in answer to each frame, in force until the next [rad/s].
        q: (n, 6) reported positions in each frame [rad].
        period: control cycle [s].

    Returns:
        The estimate; sub-sample, as the integral is a continuous function of time.

    Raises:
        DriverError: too little motion, or the arm did not follow the commands.
    """
    # Command k acts from its frame to the next one: the integral is piecewise linear, knots at the stamps.
    steps = np.append(np.diff(t), period)
    knots = np.append(t, t[-1] + period)
    displacement = np.vstack([np.zeros(qd_cmd.shape[1]), np.cumsum(qd_cmd * steps[:, None], axis=0)])
    moved = np.ptp(displacement, axis=0) > _LEAST_MOTION
    if not moved.any():
        raise DriverError("the loop delay cannot be identified: the logged stream holds no motion")
    displacement, q = displacement[:, moved], q[:, moved]

    def mean_square(delay: float) -> float:
        commanded = [np.interp(t - delay, knots, joint) for joint in displacement.T]
        return float(np.var(q.T - commanded, axis=1).mean())

    coarse = np.arange(0.0, LONGEST_DELAY + _COARSE_STEP, _COARSE_STEP)
    best: float = coarse[int(np.argmin([mean_square(delay) for delay in coarse]))]
    if best > LONGEST_DELAY - 2.0 * _COARSE_STEP:
        raise DriverError(
            f"the loop delay is {LONGEST_DELAY * 1e3:.0f} ms or more: the network to the robot is too slow"
        )
    fine = np.arange(max(best - _COARSE_STEP, 0.0), best + _COARSE_STEP + _FINE_STEP / 2, _FINE_STEP)
    errors = np.array([mean_square(delay) for delay in fine])
    # The mean square is a parabola near its minimum; fitting one averages what noise does to single values.
    a, b, _ = np.polyfit(fine - best, errors, 2)
    delay = float(best + np.clip(-b / (2.0 * a), -_COARSE_STEP, _COARSE_STEP)) if a > 0.0 else float(best)

    residual = float(np.sqrt(mean_square(max(delay, 0.0))))
    motion = float(np.sqrt(np.mean(np.var(displacement, axis=0))))
    if residual > _WORST_RESIDUAL * motion:
        raise DriverError(
            f"the loop delay cannot be identified: the arm's motion differs from the commands by "
            f"{residual:.1e} rad rms, allowed is {_WORST_RESIDUAL:.0%} of {motion:.1e} rad; "
            "is another program moving it, or is it blocked?"
        )
    return DelayEstimate(max(delay, 0.0), residual, motion, len(t))
