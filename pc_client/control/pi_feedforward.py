"""PI controller with velocity feed-forward for six joints (the paper's Fig. 3): a function on explicit state.

Plain floats: on six numbers a Python loop is faster than numpy. No clock, no robot, no reference generator.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from pc_client.control.controller import Controller

_N_JOINTS = 6


@dataclass(slots=True)
class PiState:
    """What the controller remembers.

    Attributes:
        integral: (6,) integral part of the command [rad/s].
        qd_cmd: (6,) last command [rad/s].
    """

    integral: list[float] = field(default_factory=lambda: [0.0] * _N_JOINTS)
    qd_cmd: list[float] = field(default_factory=lambda: [0.0] * _N_JOINTS)


def step_pi(
    config: Controller,
    qd_max: Sequence[float],
    state: PiState,
    q_ref: Sequence[float],
    qd_feedforward: Sequence[float],
    q: Sequence[float],
    dt: float,
) -> list[float]:
    """Advance the controller by one cycle: feed-forward + gain_p e + integral, within the limits.

    Anti-windup: while a limit cuts the command, a joint's integral takes no error that would push
    further into the limit (conditional integration); besides, the integral itself is bounded.

    Args:
        config: gains and limits.
        qd_max: (6,) largest commanded speeds [rad/s].
        state: memory of the controller; changed in place.
        q_ref: (6,) desired positions [rad].
        qd_feedforward: (6,) desired velocities [rad/s].
        q: (6,) reported positions [rad].
        dt: time since the last step [s].

    Returns:
        (6,) velocities to command [rad/s]; the same list stands in `state.qd_cmd`.

    Source: paper Fig. 3 (PI and feed-forward); limits and anti-windup are ours.
    """
    gain_p = config.gain_p
    step_i = config.gain_i * dt
    bound_i = config.integral_limit
    slew = config.slew_limit * dt
    integral = state.integral
    command: list[float] = []
    rows = zip(q_ref, qd_feedforward, q, state.qd_cmd, qd_max, strict=True)
    for j, (reference, feedforward, actual, last, limit) in enumerate(rows):
        error = reference - actual
        part_i = integral[j]
        wanted = feedforward + gain_p * error + part_i
        high = last + slew
        if high > limit:
            high = limit
        low = last - slew
        if low < -limit:
            low = -limit
        if wanted > high:
            value = high
            may_integrate = error < 0.0
        elif wanted < low:
            value = low
            may_integrate = error > 0.0
        else:
            value = wanted
            may_integrate = True
        if may_integrate:
            part_i += step_i * error
            integral[j] = bound_i if part_i > bound_i else -bound_i if part_i < -bound_i else part_i
        command.append(value)
    state.qd_cmd = command
    return command
