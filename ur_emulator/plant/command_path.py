"""CommandPath: from the controller's target, once a cycle, to the set-point of the servos, every sub-step.

Three things happen on the way. The drives interpolate between the targets of successive cycles (cubic in
position, so that it agrees with the target speeds; linear in speed and torque). They do so some dead time
later. And their set-point filter, a first-order lag, rounds what arrives.

All of it is linear in the targets, and so is what the law of the servos makes of position and speed. One
matrix, built once from the plain definition below, does a whole cycle of all joints in one product. This
module does not know the arm.
"""

from __future__ import annotations

from struct import Struct

import numpy as np
from numpy.typing import NDArray

from ur_emulator.plant.plant_state import Target

N_SIGNALS = 3  # position, speed, torque
_TRIM = N_SIGNALS  # the row of the trim among the inputs


class CommandPath:
    """The delayed and filtered set-point of all joints.

    Args:
        n_substeps: sub-steps in a control cycle.
        substep: length of a sub-step [s].
        dead_substeps: dead time in sub-steps.
        lag: time constant of the set-point filter [s].
        lead: gain in speed over gain in position of the servos, the same for all joints [s].

    Attributes:
        newest: the target of this cycle (3, 6): q [rad], qd [rad/s], tau [Nm]; see `take`.
        trim: shift of the servos (6,) [rad].
        speeds: (3, 6) [rad/s]: the first row is the caller's, for the actual speeds; then the speed of the
            newest target, and that of the set-point at the start of the last sub-step.
        position: (n_substeps, 6), q_set + lead qd_set + trim at the start of each sub-step [rad].
        tau: (n_substeps, 6), likewise the torque [Nm].
        q_final: set-point position at the end of the cycle (6,) [rad].
    """

    def __init__(
        self, n_substeps: int, substep: float, dead_substeps: int, lag: float, lead: float = 0.0
    ) -> None:
        self._period = n_substeps * substep
        self._delay = dead_substeps * substep + lag
        self._matrix = _cycle_matrix(path_responses(n_substeps, substep, dead_substeps, lag), lead)
        n_outputs, n_inputs = self._matrix.shape
        # Rows of six, one a joint: filter (q, qd, tau), trim, then targets (q, qd, tau), newest first.
        self._inputs = np.zeros((n_inputs, 6))
        self._filtered = self._inputs[:N_SIGNALS]
        self.trim: NDArray[np.float64] = self._inputs[_TRIM]
        self._targets = self._inputs[_TRIM + 1 :]
        self.newest: NDArray[np.float64] = self._targets[:N_SIGNALS]
        self._newest_memory = self.newest.data.cast("B")
        self._younger = self._targets[:-N_SIGNALS]
        self._older = self._targets[N_SIGNALS:]
        # The actual speeds stand before the outputs, so that all speeds are one array.
        memory = np.zeros((1 + n_outputs, 6))
        self._outputs = memory[1:]
        self.speeds: NDArray[np.float64] = memory[:3]
        self.position: NDArray[np.float64] = memory[3 : 3 + n_substeps]
        self.tau: NDArray[np.float64] = memory[3 + n_substeps : -N_SIGNALS]
        self._final = memory[-N_SIGNALS:]
        self.q_final: NDArray[np.float64] = self._final[0]

    def reset(
        self, q: NDArray[np.float64], tau: NDArray[np.float64], qd: NDArray[np.float64] | None = None
    ) -> None:
        """Start anew, as if the present motion had always been so; the trim stays.

        Args:
            q: newest target (6,) [rad].
            tau: torque (6,) [Nm].
            qd: speed of the target (6,) [rad/s]; None for rest.
        """
        speed = np.zeros(6) if qd is None else qd
        n_knots = len(self._targets) // N_SIGNALS
        self._filtered[:] = q - self._delay * speed, speed, tau
        self._targets[:] = np.concatenate(
            [[q - k * self._period * speed, speed, tau] for k in range(n_knots)]
        )
        self._final[:] = self._filtered

    def take(self, target: Target) -> None:
        """Make room and fill `newest`; its third row with qdd, for the caller to replace by the torque."""
        self._older[:] = self._younger
        # One call for three assignments of tuples.
        _PACK(self._newest_memory, 0, *target.q, *target.qd, *target.qdd)

    def advance(self) -> None:
        """Fill the outputs of this cycle for `newest` and `trim`."""
        self._matrix.dot(self._inputs, self._outputs)
        self._filtered[:] = self._final


_PACK = Struct("18d").pack_into


def path_responses(n_substeps: int, substep: float, dead_substeps: int, lag: float) -> NDArray[np.float64]:
    """Return what each input of the path of one joint does to its set-point; arguments as `trace_cycle`.

    Returns:
        (3, n_substeps + 1, n): q, qd, tau at the start of each sub-step and at the end of the cycle by input:
        the filter's q, qd, tau, then those of each target, newest first.
    """
    # A delayed cycle lies between targets that are up to this many cycles old.
    n_knots = 2 + -(-dead_substeps // n_substeps)
    n_inputs = N_SIGNALS * (1 + n_knots)
    responses = np.empty((N_SIGNALS, n_substeps + 1, n_inputs))
    # Column by column: the response to a unit in one input while all others are zero.
    for column in range(n_inputs):
        unit = np.zeros(n_inputs)
        unit[column] = 1.0
        filtered, knots = unit[:N_SIGNALS], unit[N_SIGNALS:].reshape(n_knots, N_SIGNALS)
        responses[:, :, column] = trace_cycle(filtered, knots, n_substeps, substep, dead_substeps, lag).T
    return responses


def _cycle_matrix(responses: NDArray[np.float64], lead: float) -> NDArray[np.float64]:
    """Return the outputs of `CommandPath`, in the order of its memory, by its inputs."""
    q, qd, tau = np.insert(responses, _TRIM, 0.0, axis=2)
    trim, newest_qd = np.eye(q.shape[1])[[_TRIM, _TRIM + 2]]
    position = q[:-1] + lead * qd[:-1] + trim
    return np.array([newest_qd, qd[-2], *position, *tau[:-1], q[-1], qd[-1], tau[-1]])


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
