"""Kalman estimate of positions and velocities as reported, from the encoders and from what was commanded.

Per joint, from one frame to the next, with the commands that act on this report (dead time and lag of the
identified loop) as input u:

    q  <- q + way of the lagged command          qd <- u + (qd - u) exp(-T / lag) + w
    then, by the encoder's word:  (q, qd) += (k_q, k_qd) (reported q - q)

w is what the model does not know, mostly gear and friction. Its size and the encoder's noise are identified
from the stream of the excitation; together they give the two constant gains.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, floor, log

import numpy as np
from numpy.typing import NDArray

from pc_client.control.loop_model import NO_LAG, LoopModel

Array = NDArray[np.float64]

_RATIOS = np.geomspace(0.03, 30.0, 31)
"""Velocity disturbance a cycle, in units of encoder noise over a cycle: the likeliest of these is taken."""


@dataclass(frozen=True, slots=True)
class EstimatorGains:
    """A steady Kalman filter for one joint; all joints have the same.

    Attributes:
        k_q: correction of the position by 1 rad of surprise [1].
        k_qd: correction of the velocity by it [1/s].
        encoder_sigma: sd of the reported position at rest [rad].
    """

    k_q: float
    k_qd: float
    encoder_sigma: float


class StateEstimator:
    """Estimates all joints, one frame after the other.

    Args:
        loop: dead time and lag.
        gains: of `identify_estimator`.
        period: control cycle [s].

    Attributes:
        q: (6,) estimated positions at the last frame [rad].
        qd: (6,) estimated velocities [rad/s].
    """

    __slots__ = ("_gains", "_lag", "_pieces", "_sent", "q", "qd")

    def __init__(self, loop: LoopModel, gains: EstimatorGains, period: float) -> None:
        self._gains = gains
        self._lag = loop.lag
        # In the cycle before a report two commands act one after the other: one of `older` cycles ago, whose
        # end the dead time has moved into this cycle, and its successor. Each piece: time, what is left of an
        # excess of velocity after it.
        cycles = loop.dead_time / period
        older = floor(cycles) + 1
        first = (cycles - floor(cycles)) * period
        self._pieces = [(time, _keep(loop, time)) for time in (first, period - first)]
        self._sent: deque[Sequence[float]] = deque([(0.0,) * 6] * (older + 1), maxlen=older + 1)
        self.q: list[float] = []
        self.qd = [0.0] * 6

    def update(self, q: Sequence[float], cycles: int = 1) -> list[float]:
        """Take the positions of a new frame, some cycles after the last one; returns the estimate.

        Frames that were lost or late had no command of their own: the last one stayed in force.
        """
        if not self.q:
            self.q = list(q)
            return self.q
        for _ in range(cycles - 1):
            self._predict()
            self._sent.append(self._sent[-1])
        self._predict()
        k_q, k_qd = self._gains.k_q, self._gains.k_qd
        for j, reported in enumerate(q):
            surprise = reported - self.q[j]
            self.q[j] += k_q * surprise
            self.qd[j] += k_qd * surprise
        return self.q

    def sent(self, qd_cmd: Sequence[float]) -> None:
        """Remember the command that was sent in answer to the last frame."""
        self._sent.append(qd_cmd)

    def _predict(self) -> None:
        lag, q, qd = self._lag, self.q, self.qd
        for (time, keep), command in zip(self._pieces, (self._sent[0], self._sent[1]), strict=True):
            for j, u in enumerate(command):
                excess = qd[j] - u
                q[j] += u * time + lag * excess * (1.0 - keep)
                qd[j] = u + excess * keep


def kalman_gains(ratio: float, keep: float, lag: float, period: float) -> tuple[float, float, float]:
    """Steady gains of the filter, from the Riccati recursion.

    Args:
        ratio: sd of the velocity disturbance a cycle times the cycle, over the encoder's sd.
        keep: exp(-period / lag).
        lag: [s].
        period: control cycle [s].

    Returns:
        k_q [1], k_qd [1/s], and the variance of a surprise in units of the encoder's.
    """
    model = np.array([[1.0, lag * (1.0 - keep) / period], [0.0, keep]])  # of q and period * qd
    disturbance = np.array([[0.25, 0.5], [0.5, 1.0]]) * ratio**2
    covariance = np.eye(2)
    for _ in range(500):
        ahead = model @ covariance @ model.T + disturbance
        gain = ahead[:, 0] / (ahead[0, 0] + 1.0)
        covariance = ahead - np.outer(gain, ahead[0])
    return float(gain[0]), float(gain[1]) / period, float(ahead[0, 0] + 1.0)


def identify_estimator(
    qd_cmd: Array, q: Array, loop: LoopModel, period: float, n_rest: int
) -> EstimatorGains:
    """Choose the likeliest filter for a logged stream without gaps.

    Args:
        qd_cmd: (n, 6) commands [rad/s].
        q: (n, 6) reported positions [rad]; the arm rests in the last `n_rest` of them.
        loop: the loop.
        period: control cycle [s].
        n_rest: frames at rest, at least 3.

    Returns:
        The gains.
    """
    steps = np.diff(q[-n_rest:], axis=0)
    sigma = max(float(np.sqrt(np.mean(np.square(steps - steps.mean(axis=0))) / 2.0)), 1e-9)
    keep = _keep(loop, period)
    best: tuple[float, EstimatorGains] | None = None
    for ratio in _RATIOS:
        k_q, k_qd, variance = kalman_gains(float(ratio), keep, loop.lag, period)
        gains = EstimatorGains(k_q, k_qd, sigma)
        surprises = _surprises(qd_cmd, q, loop, gains, period)
        unlikely = log(variance) + float(np.mean(np.square(surprises))) / (variance * sigma**2)
        if best is None or unlikely < best[0]:
            best = (unlikely, gains)
    assert best is not None  # there are ratios
    return best[1]


def _keep(loop: LoopModel, time: float) -> float:
    """Share of a velocity's distance from the command that the lag leaves after some time [s]."""
    return exp(-time / loop.lag) if loop.lag >= NO_LAG else 0.0


def _surprises(qd_cmd: Array, q: Array, loop: LoopModel, gains: EstimatorGains, period: float) -> Array:
    """Reported less predicted positions (n - 1, 6) along a stream."""
    estimator = StateEstimator(loop, gains, period)
    surprises = []
    estimator.update(q[0].tolist())
    for command, reported in zip(qd_cmd[:-1], q[1:], strict=True):
        estimator.sent(command.tolist())
        estimated = np.array(estimator.update(reported.tolist()))
        surprises.append((reported - estimated) / (1.0 - gains.k_q))
    return np.array(surprises)
