"""CommandPath: from the controller's target, once a cycle, to the set-point of the drives, every sub-step.

Three things happen on the way. The drives interpolate between the targets of successive cycles (cubic in
position, so that it agrees with the target speeds; linear in speed and torque). They do so some dead time
later. And their set-point filter, a first-order lag, rounds what arrives.

All of it is linear in the targets, so one matrix, built once from the plain definition below, does a whole
cycle in one product. This module knows neither the arm nor the servo.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

N_SIGNALS = 3  # position, speed, torque


class CommandPath:
    """The delayed and filtered set-point of all joints.

    Args:
        n_substeps: sub-steps in a control cycle.
        substep: length of a sub-step [s].
        dead_substeps: dead time in sub-steps.
        lag: time constant of the set-point filter [s].
    """

    def __init__(self, n_substeps: int, substep: float, dead_substeps: int, lag: float) -> None:
        self._period = n_substeps * substep
        self._delay = dead_substeps * substep + lag
        # A delayed cycle lies between targets that are up to this many cycles old.
        n_knots = 2 + -(-dead_substeps // n_substeps)
        n_inputs = N_SIGNALS * (1 + n_knots)
        n_rows = n_substeps + 1
        # Column by column: the response to a unit in one input while all others are zero.
        self._matrix = np.empty((N_SIGNALS * n_rows, n_inputs))
        for column in range(n_inputs):
            unit = np.zeros(n_inputs)
            unit[column] = 1.0
            filtered, knots = unit[:N_SIGNALS], unit[N_SIGNALS:].reshape(n_knots, N_SIGNALS)
            rows = trace_cycle(filtered, knots, n_substeps, substep, dead_substeps, lag)
            self._matrix[:, column] = rows.T.reshape(-1)
        # Inputs of the product: filter state, then the targets, newest first; each N_SIGNALS rows.
        self._inputs = np.zeros((n_inputs, 6))
        self._filtered = self._inputs[:N_SIGNALS]
        self._newest = self._inputs[N_SIGNALS : 2 * N_SIGNALS]
        self._targets = self._inputs[N_SIGNALS:]
        self._younger = self._inputs[N_SIGNALS:-N_SIGNALS]
        self._older = self._inputs[2 * N_SIGNALS :]
        self._outputs = np.zeros((N_SIGNALS * n_rows, 6))
        by_signal = self._outputs.reshape(N_SIGNALS, n_rows, 6)
        self._final = by_signal[:, -1]
        # What the servo reads, at the start of each sub-step, (n_substeps, 6) each.
        self.q = by_signal[0, :-1]
        self.qd = by_signal[1, :-1]
        self.tau = by_signal[2, :-1]
        self.q_final: NDArray[np.float64] = by_signal[0, -1]
        """Set-point position at the end of the cycle (6,) [rad]."""

    def reset(
        self, q: NDArray[np.float64], tau: NDArray[np.float64], qd: NDArray[np.float64] | None = None
    ) -> None:
        """Start anew, as if the present motion had always been so.

        Args:
            q: newest target (6,) [rad].
            tau: torque (6,) [Nm].
            qd: speed of the target (6,) [rad/s]; None for rest.
        """
        speed = np.zeros(6) if qd is None else qd
        n_knots = len(self._targets) // N_SIGNALS
        ages = [self._delay, *(k * self._period for k in range(n_knots))]
        self._inputs[:] = np.concatenate([[q - age * speed, speed, tau] for age in ages])
        self._outputs[:] = np.repeat(self._filtered, len(self._outputs) // N_SIGNALS, axis=0)

    def advance(self, target: NDArray[np.float64]) -> None:
        """Take the target (3, 6) for the end of this cycle (q, qd, tau) and fill q, qd, tau and q_final."""
        self._older[:] = self._younger
        self._newest[:] = target
        np.dot(self._matrix, self._inputs, self._outputs)
        self._filtered[:] = self._final


def trace_cycle(
    filtered: NDArray[np.float64],
    knots: NDArray[np.float64],
    n_substeps: int,
    substep: float,
    dead_substeps: int,
    lag: float,
) -> NDArray[np.float64]:
    """Follow one cycle of the command path of one joint, sub-step by sub-step: the definition.

    Args:
        filtered: filter state at the start of the cycle (3,): q, qd, tau.
        knots: targets (n, 3), newest first; the newest is for the end of this cycle.
        n_substeps: sub-steps in a cycle.
        substep: [s].
        dead_substeps: dead time in sub-steps.
        lag: time constant of the filter [s].

    Returns:
        (n_substeps + 1, 3): the set-point at the start of each sub-step and at the end of the cycle.
    """
    period = n_substeps * substep
    # Backward Euler: the output lags a ramp by exactly the time constant.
    gain = substep / (lag + substep)
    rows = [filtered]
    for i in range(1, n_substeps + 1):
        cycles_back, offset = divmod(i - dead_substeps - n_substeps, n_substeps)
        newer = -cycles_back - 1 if offset else -cycles_back
        share = offset / n_substeps
        arrived = knots[newer]
        if offset:
            arrived = _interpolate(knots[newer + 1], knots[newer], share, period)
        rows.append(rows[-1] + gain * (arrived - rows[-1]))
    return np.array(rows)


def _interpolate(
    before: NDArray[np.float64], after: NDArray[np.float64], share: float, period: float
) -> NDArray[np.float64]:
    """Between two targets (q, qd, tau): Hermite cubic for q, linear for the others; share in [0, 1]."""
    between = before + share * (after - before)
    s2, s3 = share * share, share * share * share
    between[0] = (
        (2.0 * s3 - 3.0 * s2 + 1.0) * before[0]
        + (s3 - 2.0 * s2 + share) * period * before[1]
        + (3.0 * s2 - 2.0 * s3) * after[0]
        + (s3 - s2) * period * after[1]
    )
    return between
