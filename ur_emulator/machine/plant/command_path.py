"""CommandPath: from the controller's target, once a cycle, to the control of the servos, every sub-step.

The path has three stages. The drives interpolate between the targets of successive cycles (cubic in
position, so that it agrees with the target speeds; linear in speed and torque). Their set-point filter is a
first-order lag. The slow outer loop trims the remaining error.

All of it is linear in the targets, and so is the law of the servos. One matrix, built once from the plain
definition below, does a whole cycle of all joints in one product:

| rows of the inputs         | what they are                                                         |
|----------------------------|-----------------------------------------------------------------------|
| q, qd, deflection          | the filter, at the end of the last cycle                              |
| their changes              | those of a filter of second order; else these rows are missing [1/s]  |
| trim                       | shift of the servos in the last cycle                                 |
| error                      | of the joints at the end of the last cycle, trimmed from now on       |
| q, qd, deflection, twice   | targets, the newest first                                             |

| rows of the outputs        | what they are                                                         |
|----------------------------|-----------------------------------------------------------------------|
| set-point speed            | at the start of the last sub-step                                     |
| control, n times           | q + lead qd + deflection + trim at the start of each sub-step         |
| q, qd, ... trim, 0         | the first rows of the inputs of the next cycle                        |

A torque passes the path as the deflection of the servo that gives it: torque / kp. This module does not
know the arm.
"""

from struct import Struct

import numpy as np
from numpy.typing import NDArray

from ur_emulator.machine.motion.generators import JointTarget

N_SIGNALS = 3  # position, speed, deflection
_N_KNOTS = 2  # targets between which a cycle lies
_TRIM, _ERROR = -2, -1  # of the rows that go from a cycle to the next


class CommandPath:
    """The filtered set-point of all joints.

    A cycle is `take`, `advance`, `keep`.

    Args:
        substep: length of a sub-step [s].
        lag: of the set-point filter: by how much a ramp trails [s].
        damping: damping ratio of a filter of second order; None: of first order.
        lead: gain in speed over gain in position of the servos, the same for all joints [s].
        trim_gain: part of the error that is trimmed away in a cycle.

    Attributes:
        newest: the target of this cycle (3, 6): q [rad], qd [rad/s], deflection [rad]; see `take`.
        speeds: (3, 6) [rad/s]: the caller's row for the actual speeds; the speed of the newest target; that
            of the set-point at the start of the last sub-step.
        control: of the servos at the start of each sub-step (n_substeps, 6) [rad].
        q_final: set-point position at the end of the cycle (6,) [rad].
        trim: shift of the servos in this cycle (6,) [rad].
    """

    def __init__(
        self,
        n_substeps: int,
        substep: float,
        lag: float,
        damping: float | None = None,
        lead: float = 0.0,
        trim_gain: float = 0.0,
    ) -> None:
        self._period = n_substeps * substep
        self._lag = lag
        n_filter = N_SIGNALS if damping is None else 2 * N_SIGNALS
        n_kept = n_filter + 2
        self._matrix = _cycle_matrix(n_substeps, substep, lag, damping, lead, trim_gain)
        n_outputs, n_inputs = self._matrix.shape
        self._inputs = np.zeros((n_inputs, 6))
        self._kept = self._inputs[:n_kept]
        self._error: NDArray[np.float64] = self._kept[_ERROR]
        self._targets = self._inputs[n_kept:]
        self.newest: NDArray[np.float64] = self._targets[:N_SIGNALS]
        self._newest_speed = self.newest[1]
        self._newest_memory = self.newest.data.cast("B")
        self._younger = self._targets[:-N_SIGNALS]
        self._older = self._targets[N_SIGNALS:]
        # Two speeds stand before the outputs, so that all speeds are one array.
        memory = np.zeros((2 + n_outputs, 6))
        self._outputs = memory[2:]
        self.speeds: NDArray[np.float64] = memory[:3]
        self._target_speed = self.speeds[1]
        self.control: NDArray[np.float64] = memory[3 : 3 + n_substeps]
        self._final = memory[-n_kept:]
        self._changes = self._final[N_SIGNALS:_TRIM]
        self.q_final: NDArray[np.float64] = self._final[0]
        self.trim: NDArray[np.float64] = self._final[_TRIM]

    def reset(
        self,
        q: NDArray[np.float64],
        deflection: NDArray[np.float64],
        q_motor: NDArray[np.float64],
        qd: NDArray[np.float64] | None = None,
    ) -> None:
        """Restart, as if the present motion had lasted for ever.

        Args:
            q: newest target (6,) [rad].
            deflection: of the servos (6,) [rad].
            q_motor: motor positions (6,) [rad]; their difference from the set-point is trimmed.
            qd: speed of the target (6,) [rad/s]; None for rest.
        """
        speed = np.zeros(6) if qd is None else qd
        self._targets[:] = np.concatenate(
            [[q - k * self._period * speed, speed, deflection] for k in range(_N_KNOTS)]
        )
        set_point = q - self._lag * speed
        self._final[:N_SIGNALS] = set_point, speed, deflection
        self._changes[:] = 0.0
        self._changes[:1] = speed
        self._final[_TRIM:] = q_motor - set_point, np.zeros(6)
        self.keep()

    def take(self, target: JointTarget) -> None:
        """Fill `newest`; its third row with qdd, for the caller to replace by the deflection."""
        # One call for three assignments of tuples.
        _PACK(self._newest_memory, 0, *target.q, *target.qd, *target.qdd)
        self._target_speed[:] = self._newest_speed

    def advance(self) -> None:
        """Fill the outputs of this cycle."""
        self._matrix.dot(self._inputs, self._outputs)

    def keep(self, error: NDArray[np.float64] | None = None) -> None:
        """End the cycle: make room for the next target.

        Args:
            error: of the joints (6,) [rad], to be trimmed from the next cycle on; None: the trim is held.
        """
        self._kept[:] = self._final
        self._older[:] = self._younger
        if error is not None:
            self._error[:] = error


_PACK = Struct("18d").pack_into


def _cycle_matrix(
    n_substeps: int, substep: float, lag: float, damping: float | None, lead: float, trim_gain: float
) -> NDArray[np.float64]:
    """Return the matrix of the tables above; arguments as of `CommandPath`."""
    n_filter = N_SIGNALS if damping is None else 2 * N_SIGNALS
    # The response to a unit in each input while all others are zero, one column each.
    units = np.eye(n_filter + N_SIGNALS * _N_KNOTS)
    knots = units[n_filter:].reshape(_N_KNOTS, N_SIGNALS, -1)
    responses = trace_cycle(units[:n_filter], knots, n_substeps, substep, lag, damping)
    rows = np.insert(responses.swapaxes(0, 1), [n_filter, n_filter], 0.0, axis=2)
    q, qd, deflection = rows[:N_SIGNALS]
    trim = np.zeros(q.shape[1])
    trim[[n_filter, n_filter + 1]] = 1.0, trim_gain
    control = q[:-1] + lead * qd[:-1] + deflection[:-1] + trim
    return np.array([qd[-2], *control, *rows[:, -1], trim, 0.0 * trim])


def trace_cycle(
    filtered: NDArray[np.float64],
    knots: NDArray[np.float64],
    n_substeps: int,
    substep: float,
    lag: float,
    damping: float | None = None,
) -> NDArray[np.float64]:
    """Follow one cycle of the command path of one joint, sub-step by sub-step: the definition.

    Several joints have a further axis, the last.

    Args:
        filtered: filter state at the start of the cycle: q, qd, deflection, then of a filter of second order
            their changes [1/s].
        knots: targets (2, 3), newest first; the newest is for the end of this cycle.
        substep: [s].
        lag: of the filter [s].
        damping: of a filter of second order; None: of first order.

    Returns:
        (n_substeps + 1, m): the filter state at the start of each sub-step and at the end of the cycle.
    """
    period = n_substeps * substep
    rows = [filtered]
    for i in range(1, n_substeps + 1):
        arrived = _interpolate(knots[1], knots[0], i / n_substeps, period)
        rows.append(_filter(rows[-1], arrived, substep, lag, damping))
    return np.array(rows)


def _filter(
    state: NDArray[np.float64],
    arrived: NDArray[np.float64],
    substep: float,
    lag: float,
    damping: float | None,
) -> NDArray[np.float64]:
    """Advance the set-point filter by a sub-step; by backward Euler, so a ramp comes late by just the lag."""
    if damping is None:
        return state + substep / (lag + substep) * (arrived - state)
    value, change = state[:N_SIGNALS], state[N_SIGNALS:]
    # y'' + 2 damping omega y' + omega² (y - u) = 0 trails a ramp by 2 damping / omega.
    omega = 2.0 * damping / lag
    step = omega * substep
    change = (change + omega * step * (arrived - value)) / (1.0 + 2.0 * damping * step + step**2)
    return np.concatenate([value + substep * change, change])


def _interpolate(
    before: NDArray[np.float64], after: NDArray[np.float64], share: float, period: float
) -> NDArray[np.float64]:
    """Between two targets: Hermite cubic for q, linear for qd and deflection; share in [0, 1]."""
    between = before + share * (after - before)
    s2, s3 = share * share, share * share * share
    between[0] = (
        (2.0 * s3 - 3.0 * s2 + 1.0) * before[0]
        + (s3 - 2.0 * s2 + share) * period * before[1]
        + (3.0 * s2 - 2.0 * s3) * after[0]
        + (s3 - s2) * period * after[1]
    )
    return between
