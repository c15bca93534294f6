"""One frame in, one command out: reference, controller and the phases of a run. No I/O, no clock."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from math import exp
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pc_client.control.controller import Controller
from pc_client.control.loop_model import NO_LAG, LoopModel
from pc_client.control.pi_feedforward import PiState, step_pi
from pc_client.control.reference import ReferencePoint, ReferenceTable
from pc_client.control.tool_guard import ToolGuard
from pc_client.errors import DriverError
from pc_client.kinematics.forward import check_flange
from pc_client.kinematics.robot_model import RobotModel
from pc_client.recording.rows import Phase
from protocol.realtime.layout import RealtimeFrame

# After a gap in the frames the integral must not jump: no more than this many cycles count.
_MOST_CYCLES_PER_STEP = 3

ControlLaw = Callable[[RealtimeFrame, ReferencePoint], Sequence[float] | NDArray[np.float64]]
"""A controller of a user: takes a frame of port 30003 and the reference at its time; returns (6,) joint
velocities [rad/s]."""


class TrackerStep(NamedTuple):
    """What the tracker made of one frame.

    Attributes:
        t: time since the movement began [s], negative before it.
        phase: settle before, movement or settle after.
        point: the reference at t.
        qd_cmd: (6,) velocities to send, or in force [rad/s].
        finished: True: the run is over, send the stop word instead of `qd_cmd`.
    """

    t: float
    phase: Phase
    point: ReferencePoint
    qd_cmd: list[float]
    finished: bool


class Tracker:
    """Follows one reference once.

    Time is the robot's own: the first time stamp is `reference.lead` seconds before the movement begins.

    Args:
        reference: what to follow.
        config: the controller.
        model: the nominal arm: what its tool does is guarded, and the controller uses its share of the joint
            speed limits.
        law: computes the commands in place of the built-in controller; None: that computes them.
    """

    __slots__ = (
        "_config",
        "_end",
        "_guard",
        "_last_stamp",
        "_law",
        "_model",
        "_qd_max",
        "_reference",
        "_start",
        "_state",
    )

    def __init__(
        self, reference: ReferenceTable, config: Controller, model: RobotModel, law: ControlLaw | None = None
    ) -> None:
        self._law = law
        self._reference = reference
        self._config = config
        self._model = model
        self._guard = ToolGuard(reference, model, config.path_tolerance, config.angle_tolerance)
        self._qd_max = tuple(limit * config.speed_share for limit in model.limits.qd_max)
        self._state = PiState()
        self._start: float | None = None
        self._last_stamp = 0.0
        # Half a microsecond: the same grid as the reference, whatever rounding the stamps carry.
        self._end = reference.duration + reference.settle - 0.5e-6

    @property
    def qd_max(self) -> tuple[float, ...]:
        """(6,) the largest speeds that a step can command [rad/s]."""
        return self._qd_max

    def check_report(self, q: Sequence[float], pose: Sequence[float]) -> None:
        """Refuse a report whose joint angles (6,) [rad] and TCP pose (6,) [m, rad] do not belong together.

        Raises:
            DriverError: they are further apart than `kinematics.agreement` allows.
        """
        check_flange(self._model, q, pose)

    def answer(self, frame: RealtimeFrame) -> TrackerStep:
        """Answer a new frame of the robot with a command; errors as `step`."""
        return self.step(frame.timestamp, frame.actual_q.tolist(), frame)

    def step(self, stamp: float, q: Sequence[float], frame: RealtimeFrame | None = None) -> TrackerStep:
        """Answer new positions with a command.

        Args:
            stamp: their time [s], later than the last one.
            q: (6,) reported joint positions [rad].
            frame: that reported them; a user's law needs it.

        Raises:
            DriverError: the tool is further from its path than the controller's tolerances, or a user's law
                gave no velocities.
        """
        reference = self._reference
        if self._start is None:
            self._start = stamp + reference.lead
            dt = reference.period
        else:
            dt = min(stamp - self._last_stamp, _MOST_CYCLES_PER_STEP * reference.period)
        self._last_stamp = stamp
        t = stamp - self._start
        point = reference.at(t)
        self._guard.check(t, q)
        if self._law is None or frame is None:
            command = step_pi(self._config, self._qd_max, self._state, point.q, point.qd_feedforward, q, dt)
        else:
            command = self._state.qd_cmd = six_velocities(self._law(frame, point))
        return TrackerStep(t, self._phase(t), point, command, t >= self._end)

    def observe(self, stamp: float) -> TrackerStep:
        """Describe a frame that gets no command of its own because a newer one is already here.

        Its `qd_cmd` is the command in force. Nothing in the controller changes.
        """
        t = stamp - self._start if self._start is not None else -self._reference.lead
        return TrackerStep(t, self._phase(t), self._reference.at(t), self._state.qd_cmd, False)

    def _phase(self, t: float) -> Phase:
        if t < -0.5e-6:
            return Phase.SETTLE_BEFORE
        return Phase.MOVEMENT if t <= self._reference.duration + 0.5e-6 else Phase.SETTLE_AFTER


def six_velocities(qd: Sequence[float] | NDArray[np.float64]) -> list[float]:
    """The velocities (6,) [rad/s] that a user's law gave.

    Raises:
        DriverError: they are no six finite numbers.
    """
    try:
        velocities = np.asarray(qd, dtype=np.float64)
    except (TypeError, ValueError):
        velocities = np.zeros(0)
    if velocities.shape != (6,) or not np.isfinite(velocities).all():
        raise DriverError(f"the velocity law gave {str(qd)[:100]}: give six finite velocities in rad/s")
    given: list[float] = velocities.tolist()
    return given


def predict_run(
    reference: ReferenceTable, config: Controller, model: RobotModel, loop: LoopModel
) -> NDArray[np.float64]:
    """Where the joints go when the controller follows a reference on an ideal arm with this loop.

    Beside the loop's dead time and lag the robot's `speedj` counts: all joints change their velocities
    together, the leading one with the acceleration of the controller.

    Returns:
        (n, 6) positions at the cycles from `reference.lead` before the movement to `settle` after it [rad].
    """
    period, lead = reference.period, reference.lead
    n = round((lead + reference.duration + reference.settle) / period) + 1
    qd_max = [limit * config.speed_share for limit in model.limits.qd_max]
    whole, part = divmod(loop.dead_time / period, 1.0)
    still = np.zeros(6)
    sent = deque([still] * (int(whole) + 2), maxlen=int(whole) + 2)
    most = config.speedj_acceleration * period
    left = exp(-period / loop.lag) if loop.lag > NO_LAG else 0.0
    state, ramp, qd = PiState(), still, still
    q = np.zeros((n, 6))
    q[0] = reference.at(-lead).q
    for k in range(n - 1):
        point = reference.at(k * period - lead)
        command = step_pi(config, qd_max, state, point.q, point.qd_feedforward, q[k].tolist(), period)
        sent.append(np.array(command))
        change = (1.0 - part) * sent[1] + part * sent[0] - ramp
        ramp = ramp + change * min(1.0, most / max(float(np.abs(change).max()), 1e-12))
        qd = ramp + left * (qd - ramp)
        q[k + 1] = q[k] + period * qd
    return q
