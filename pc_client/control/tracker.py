"""One frame in, one command out: reference, controller and the phases of a run. No I/O, no clock."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from pc_client.control.controller import Controller
from pc_client.control.pi_feedforward import PiState, step_pi
from pc_client.control.reference import ReferencePoint, ReferenceTable
from pc_client.control.tool_guard import ToolGuard
from pc_client.kinematics.agreement import check_flange
from pc_client.kinematics.robot_model import RobotModel
from pc_client.recording.layout import Phase
from protocol.realtime.layout import RealtimeFrame

# After a gap in the frames the integral must not jump: no more than this many cycles count.
_MOST_CYCLES_PER_STEP = 3


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
    """

    __slots__ = (
        "_config",
        "_end",
        "_guard",
        "_last_stamp",
        "_model",
        "_qd_max",
        "_reference",
        "_start",
        "_state",
    )

    def __init__(self, reference: ReferenceTable, config: Controller, model: RobotModel) -> None:
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
        return self.step(frame.timestamp, frame.actual_q.tolist())

    def step(self, stamp: float, q: Sequence[float]) -> TrackerStep:
        """Answer new positions with a command.

        Args:
            stamp: their time [s], later than the last one.
            q: (6,) reported joint positions [rad].

        Raises:
            DriverError: the tool is further from its path than the controller's tolerances.
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
        command = step_pi(self._config, self._qd_max, self._state, point.q, point.qd_feedforward, q, dt)
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
