"""Dead time and lag apart, from a logged stream.

A delay moves a motion, a lag also rounds it: two parameters, found together by least squares over all joints.
The gear of a joint is no part of the loop; over the small excitation its error is a smooth function of the
position, so a cubic in the displacement of each joint takes it up, and with it any error of scale.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from pc_client.control.delay import LONGEST_DELAY, estimate_delay
from pc_client.control.loop_model import NO_LAG, LoopModel, lagged_displacement
from pc_client.errors import DriverError

Array = NDArray[np.float64]

_LONGEST_LAG = 0.06
"""Lags up to this are looked for [s]: a drive of 2.6 Hz."""

_LEAST_DISPLACEMENT = 2e-3
"""A joint that was commanded to move less than this [rad] says nothing."""

_WORST_RESIDUAL = 0.1
"""Share of the motion that dead time and lag may leave unexplained."""


def identify_loop(t: Array, qd_cmd: Array, q: Array, period: float) -> LoopModel:
    """Find dead time and lag of a loop.

    Args:
        t: (n,) time stamps of the frames [s], rising.
        qd_cmd: (n, 6) command sent in answer to each frame, in force until the next [rad/s].
        q: (n, 6) reported positions in each frame [rad].
        period: control cycle [s].

    Returns:
        The model, and by how much single joints differ from it.

    Raises:
        DriverError: too little motion, or the arm did not follow the commands.
    """
    total = estimate_delay(t, qd_cmd, q, period).delay
    moved = np.ptp(np.cumsum(qd_cmd, axis=0) * period, axis=0) > _LEAST_DISPLACEMENT
    commands, actual = qd_cmd[:, moved], q[:, moved]
    knots = np.append(t, t[-1] + period)

    def unexplained(parameters: Array) -> Array:
        displacement, _ = _delayed(t, knots, commands, *parameters)
        return np.concatenate(
            [_beside(displacement[:, j], actual[:, j]) for j in range(displacement.shape[1])]
        )

    fit = least_squares(
        unexplained,
        [0.7 * total, 0.3 * total],
        bounds=([0.0, 0.0], [LONGEST_DELAY, _LONGEST_LAG]),
        x_scale=1e-3,
        diff_step=1e-3,
    )
    dead_time, lag = (float(x) for x in fit.x)
    displacement, velocity = _delayed(t, knots, commands, dead_time, lag)
    residual = float(np.sqrt(np.mean(np.square(fit.fun))))
    motion = float(np.sqrt(np.mean(np.var(displacement, axis=0))))
    if residual > _WORST_RESIDUAL * motion:
        raise DriverError(
            f"dead time and lag cannot be separated: {residual:.1e} rad rms of the arm's motion stay "
            f"unexplained, allowed is {_WORST_RESIDUAL:.0%} of {motion:.1e} rad"
        )
    # What a joint is later than the model: its rest against its own velocity.
    later = []
    for j in range(displacement.shape[1]):
        slope = _beside(displacement[:, j], velocity[:, j])
        later.append(-float(slope @ _beside(displacement[:, j], actual[:, j])) / float(slope @ slope))
    return LoopModel(dead_time, lag, max(abs(x) for x in later), residual)


def _delayed(t: Array, knots: Array, commands: Array, dead_time: float, lag: float) -> tuple[Array, Array]:
    """Displacement and velocity (n, j) that the model expects at the stamps t (n,)."""
    displacement, velocity = lagged_displacement(knots, commands, lag)
    at = np.clip(t - dead_time, knots[0], knots[-1])
    k = np.minimum(np.searchsorted(knots, at, side="right") - 1, len(commands) - 1)
    since = (at - knots[k])[:, None]
    if lag < NO_LAG:
        return displacement[k] + commands[k] * since, commands[k]
    excess = velocity[k] - commands[k]
    left = np.exp(-since / lag)
    return displacement[k] + commands[k] * since + lag * excess * (1.0 - left), commands[k] + excess * left


def _beside(displacement: Array, signal: Array) -> Array:
    """The part of a signal (n,) that is no cubic function of the displacement (n,)."""
    centred = displacement - displacement.mean()
    scaled = centred / max(float(np.abs(centred).max()), 1e-12)
    basis, _ = np.linalg.qr(np.vander(scaled, 4))
    rest: Array = signal - basis @ (basis.T @ signal)
    return rest
