"""What a small movement of the arm tells about the loop: its delay, or dead time and lag apart.

`Excitation` is the movement: smooth pulses of velocity, out and back, that the driver streams without
feedback. `estimate_delay` finds by how much reported positions trail the integral of the commands; the figure
holds everything between the moment a command is computed and the moment its effect is reported: network, dead
time of the controller, lag of the drives, age of the feedback. `identify_loop` separates it: a delay moves a
motion, a lag also rounds it, and both are found together by least squares over all joints. The gear of a
joint is no part of the loop; over the small movement its error is a smooth function of the position, so a
cubic in the displacement of each joint takes it up, and with it any error of scale.
"""

from collections.abc import Sequence
from math import cos, pi, sin

import numpy as np
from scipy.optimize import least_squares

from pc_client.arrays import Array
from pc_client.control.loop import NO_LAG, LoopModel, lagged_displacement
from pc_client.errors import DriverError

DISPLACEMENT = 0.0168
"""Displacement of one pulse [rad]: 0.96 deg."""

PULSE = 0.28
"""Length of one pulse [s]: peak speed 0.12 rad/s, far above encoder noise and far below any limit."""

BRISK_PULSE = 0.12
"""The same displacement in less time: 0.28 rad/s, 7 rad/s2. It separates lag from delay; with
slow pulses friction, which delays the start of a joint, looks like a lag."""

_N_PAIRS = 2
"""Pairs of a pulse out and a pulse back."""

# Neighbouring joints turn against each other, so that the TCP moves less than any joint alone would move it.
_SIGNS = (1.0, 1.0, -1.0, 1.0, -1.0, 1.0)


class Excitation:
    """Raised-cosine velocity pulses, out and back, around a start posture.

    Args:
        q_start: (6,) where the arm stands [rad].
        pulse: length of one pulse [s].
    """

    def __init__(self, q_start: Sequence[float], pulse: float = PULSE) -> None:
        self._q_start = tuple(q_start)
        self._pulse = pulse

    @property
    def duration(self) -> float:
        """Length of the excitation [s]."""
        return 2 * _N_PAIRS * self._pulse

    def at(self, t: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Positions (6,) [rad] and velocities (6,) [rad/s] at time t [s]; at rest outside the excitation."""
        if t <= 0.0 or t >= self.duration:
            return self._q_start, (0.0,) * 6
        n, tau = divmod(t, self._pulse)
        w = 2.0 * pi / self._pulse
        mean = DISPLACEMENT / self._pulse
        speed = mean * (1.0 - cos(w * tau))
        displacement = mean * (tau - sin(w * tau) / w)
        if int(n) % 2:  # back to the start
            speed, displacement = -speed, DISPLACEMENT - displacement
        q = tuple(q0 + sign * displacement for q0, sign in zip(self._q_start, _SIGNS, strict=True))
        return q, tuple(sign * speed for sign in _SIGNS)


_LONGEST_DELAY = 0.2
"""Delays up to this are looked for [s]; UR users report 16 to 80 ms."""

_COARSE_STEP = 2e-3
_FINE_STEP = 0.25e-3
_LEAST_MOTION = 2e-3
"""A joint that was commanded to move less than this [rad] says nothing."""

_WORST_RESIDUAL = 0.25
"""Share of the commanded motion that may stay unexplained before the estimate is refused."""


def estimate_delay(t: Array, qd_cmd: Array, q: Array, period: float) -> LoopModel:
    """Find the delay T that best explains q(t) = q0 + integral of qd_cmd up to t - T, over all joints.

    The estimate is finer than a cycle, as the integral is a continuous function of time.

    Args:
        t: (n,) time stamps of the frames [s], rising.
        qd_cmd: (n, 6) command sent in answer to each frame, in force until the next [rad/s].
        q: (n, 6) reported positions in each frame [rad].
        period: control cycle [s].

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

    coarse = np.arange(0.0, _LONGEST_DELAY + _COARSE_STEP, _COARSE_STEP)
    best: float = coarse[int(np.argmin([mean_square(delay) for delay in coarse]))]
    if best > _LONGEST_DELAY - 2.0 * _COARSE_STEP:
        raise DriverError(
            f"the loop delay is {_LONGEST_DELAY * 1e3:.0f} ms or more: the network to the robot is too slow"
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
    return LoopModel.of_delay(max(delay, 0.0), residual)


_LONGEST_LAG = 0.06
"""Lags up to this are looked for [s]: a drive of 2.6 Hz."""

_WORST_REST = 0.1
"""Share of the motion that dead time and lag may leave unexplained."""


def identify_loop(t: Array, qd_cmd: Array, q: Array, period: float) -> LoopModel:
    """Find dead time and lag of a loop, and by how much single joints differ; arguments of `estimate_delay`.

    Raises:
        DriverError: too little motion, or the arm did not follow the commands.
    """
    total = estimate_delay(t, qd_cmd, q, period).delay
    moved = np.ptp(np.cumsum(qd_cmd, axis=0) * period, axis=0) > _LEAST_MOTION
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
        bounds=([0.0, 0.0], [_LONGEST_DELAY, _LONGEST_LAG]),
        x_scale=1e-3,
        diff_step=1e-3,
    )
    dead_time, lag = (float(x) for x in fit.x)
    displacement, velocity = _delayed(t, knots, commands, dead_time, lag)
    residual = float(np.sqrt(np.mean(np.square(fit.fun))))
    motion = float(np.sqrt(np.mean(np.var(displacement, axis=0))))
    if residual > _WORST_REST * motion:
        raise DriverError(
            f"dead time and lag cannot be separated: {residual:.1e} rad rms of the arm's motion stay "
            f"unexplained, allowed is {_WORST_REST:.0%} of {motion:.1e} rad"
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
    return signal - basis @ (basis.T @ signal)
