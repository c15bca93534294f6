"""One frame in, one command out: controller, guard of the tool and the phases of a run. No I/O, no clock.

`step_pi` is the controller of the paper's Fig. 3, PI with velocity feed-forward for six joints: a function on
explicit state, in plain floats, since on six numbers a Python loop is faster than numpy.

`ToolGuard` ends a run when the tool leaves its path, whatever the errors of single joints are. The path is
what the nominal arm makes of the joint reference. The tool is compared with the part of it around the present
time, not with the one point of the present time: an arm that trails along its path by the loop's delay is
where it should be, one that was pushed aside is not. Both come from the same nominal arm, so its difference
from the real one (a few millimetres, factory calibration) counts in neither direction.

`Tracker` joins them for one run; `predict_run` computes what the controller would make of an ideal arm.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import asin, ceil, degrees, exp, floor, sqrt
from typing import NamedTuple

import numpy as np

from pc_client.arrays import Array
from pc_client.control.controller import Controller
from pc_client.control.loop import NO_LAG
from pc_client.control.reference import ReferencePoint, ReferenceTable, RunRecipe
from pc_client.errors import DriverError
from pc_client.kinematics.model import RobotModel, check_flange, tcp_pose
from pc_client.recording.rows import Phase
from protocol.realtime.layout import RealtimeFrame

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


BEHIND = 0.3
"""The arm may trail by this time [s]: the longest loop delay that is accepted, and the robot's ramp."""

AHEAD = 0.05
"""It may be ahead by this time [s]: what a feed-forward by a wrong delay does."""

_SURE = 0.25
"""Below this share of the squared tolerance the nearest point of the frame before is near enough."""


class ToolGuard:
    """Watches one run of one reference.

    A pose is a point of twelve numbers: the position [m] and the rotation matrix, this times a length that
    makes the tolerances of both equal; the path is straight between two cycles. Two orientations that differ
    by the angle a have matrices that differ by 2 sqrt(2) sin(a / 2).

    Args:
        model: the nominal arm; the tool is its TCP.
        path_tolerance: largest distance of the tool from its path [m].
        angle_tolerance: largest angle of the tool to its orientation there [rad].
    """

    def __init__(
        self, reference: ReferenceTable, model: RobotModel, path_tolerance: float, angle_tolerance: float
    ) -> None:
        self._model = model
        self._distance, self._angle = path_tolerance, angle_tolerance
        self._scale = np.ones((3, 4))
        self._scale[:, :3] = path_tolerance / (sqrt(2.0) * angle_tolerance)
        self._period, self._lead = reference.period, reference.lead
        n = round((reference.lead + reference.duration + reference.settle) / reference.period) + 2
        path = [reference.at(k * reference.period - reference.lead).q for k in range(n)]
        points = np.array([self._point(q) for q in path])
        self._points = points[:-1]
        self._steps = np.diff(points, axis=0)
        squared = np.einsum("ij,ij->i", self._steps, self._steps)
        self._inverse = np.divide(1.0, squared, out=np.zeros(n - 1), where=squared > 0.0)
        self._trail = 0

    def check(self, t: float, q: Sequence[float]) -> None:
        """Compare the tool, at the reported joint positions (6,) [rad], with its path around the time t [s].

        Raises:
            DriverError: it is further away than allowed, or nowhere (NaN).
        """
        point = self._point(q)
        now = (t + self._lead) / self._period
        # Most frames are as far behind as the one before.
        k = min(max(floor(now) - self._trail, 0), len(self._points) - 1)
        rest = point - self._points[k]
        share = min(max(float(rest @ self._steps[k]) * self._inverse[k], 0.0), 1.0)
        rest -= share * self._steps[k]
        if not float(rest @ rest) < _SURE * self._distance**2:
            self._search(t, point, now)

    def deviation(self, t: float, q: Sequence[float]) -> tuple[float, float]:
        """Distance [m] of the tool from its path around the time t [s], and the angle [rad] to it."""
        rest, _ = self._nearest(self._point(q), (t + self._lead) / self._period)
        return self._measure(rest)

    def _search(self, t: float, point: Array, now: float) -> None:
        rest, k = self._nearest(point, now)
        self._trail = floor(now) - k
        distance, angle = self._measure(rest)
        if not (distance <= self._distance and angle <= self._angle):  # NaN is not
            x, y, z = point[3::4]
            raise DriverError(
                f"the tool is {1e3 * distance:.2f} mm and {degrees(angle):.2f} deg off its path at "
                f"t = {t:.3f} s, near ({x:.3f}, {y:.3f}, {z:.3f}) m; allowed is "
                f"{1e3 * self._distance:g} mm (path_tolerance) and {degrees(self._angle):.1f} deg "
                "(angle_tolerance): the run was ended"
            )

    def _nearest(self, point: Array, now: float) -> tuple[Array, int]:
        """A point less the nearest path point around a time [cycles], (12,), and the cycle of the latter."""
        last = len(self._points) - 1
        first = min(max(floor(now - BEHIND / self._period), 0), last)
        window = slice(first, min(max(ceil(now + AHEAD / self._period), 0), last) + 1)
        rest, steps = point - self._points[window], self._steps[window]
        share = np.clip(np.einsum("ij,ij->i", rest, steps) * self._inverse[window], 0.0, 1.0)
        rest -= share[:, None] * steps
        k = int(np.argmin(np.einsum("ij,ij->i", rest, rest)))
        nearest: Array = rest[k]
        return nearest, first + k

    def _measure(self, rest: Array) -> tuple[float, float]:
        """Distance [m] and angle [rad] of a difference of two poses."""
        parts = rest.reshape(3, 4)
        chord = float(np.linalg.norm(parts[:, :3])) / (float(self._scale[0, 0]) * 2.0 * sqrt(2.0))
        return float(np.linalg.norm(parts[:, 3])), 2.0 * asin(min(chord, 1.0)) if chord == chord else chord

    def _point(self, q: Sequence[float]) -> Array:
        return (tcp_pose(self._model, q)[:3] * self._scale).ravel()


# After a gap in the frames the integral must not jump: no more than this many cycles count.
_MOST_CYCLES_PER_STEP = 3

ControlLaw = Callable[[RealtimeFrame, ReferencePoint], Sequence[float] | Array]
"""A controller of a user: takes a frame of port 30003 and the reference at its time; returns (6,) joint
velocities [rad/s]."""


class TrackerStep(NamedTuple):
    """What the tracker made of one frame.

    Attributes:
        t: time since the movement began [s], negative before it.
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
        model: the nominal arm: what its tool does is guarded, and the controller uses its share of the joint
            speed limits.
        law: computes the commands in place of the built-in controller; None: that computes them.

    Attributes:
        qd_max: (6,) the largest speeds that a step can command [rad/s].
    """

    def __init__(
        self, reference: ReferenceTable, config: Controller, model: RobotModel, law: ControlLaw | None = None
    ) -> None:
        self._law = law
        self._reference = reference
        self._config = config
        self._model = model
        self._guard = ToolGuard(reference, model, config.path_tolerance, config.angle_tolerance)
        self.qd_max = tuple(limit * config.speed_share for limit in model.limits.qd_max)
        self._state = PiState()
        self._start: float | None = None
        self._last_stamp = 0.0
        # Half a microsecond: the same grid as the reference, whatever rounding the stamps carry.
        self._end = reference.duration + reference.settle - 0.5e-6

    def check_report(self, q: Sequence[float], pose: Sequence[float]) -> None:
        """See `kinematics.model.check_flange`."""
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
            feedforward = point.qd_feedforward.tolist()
            command = step_pi(self._config, self.qd_max, self._state, point.q, feedforward, q, dt)
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


def six_velocities(qd: Sequence[float] | Array) -> list[float]:
    """The six velocities [rad/s] that a user's law gave; DriverError if they are not six finite numbers."""
    try:
        velocities = np.asarray(qd, dtype=np.float64)
    except (TypeError, ValueError):
        velocities = np.zeros(0)
    if velocities.shape != (6,) or not np.isfinite(velocities).all():
        raise DriverError(f"the velocity law gave {str(qd)[:100]}: give six finite velocities in rad/s")
    given: list[float] = velocities.tolist()
    return given


def predict_run(recipe: RunRecipe, reference: ReferenceTable, model: RobotModel) -> Array:
    """Where the joints go, (n, 6) [rad], when the controller follows its reference on an ideal arm.

    Beside the loop's dead time and lag the robot's `speedj` counts: all joints change their velocities
    together, the leading one with the acceleration of the controller. The cycles are those from
    `reference.lead` before the movement to `settle` after it.
    """
    own, loop, period, lead = recipe.controller, recipe.loop, recipe.period, reference.lead
    n = round((lead + reference.duration + reference.settle) / period) + 1
    qd_max = [limit * own.speed_share for limit in model.limits.qd_max]
    whole, part = divmod(loop.dead_time / period, 1.0)
    still = np.zeros(6)
    sent = deque([still] * (int(whole) + 2), maxlen=int(whole) + 2)
    most = own.speedj_acceleration * period
    left = exp(-period / loop.lag) if loop.lag > NO_LAG else 0.0
    state, ramp, qd = PiState(), still, still
    q = np.zeros((n, 6))
    q[0] = reference.at(-lead).q_array
    for k in range(n - 1):
        point = reference.at(k * period - lead)
        feedforward, actual = point.qd_feedforward.tolist(), q[k].tolist()
        command = step_pi(own, qd_max, state, point.q, feedforward, actual, period)
        sent.append(np.array(command))
        change = (1.0 - part) * sent[1] + part * sent[0] - ramp
        ramp = ramp + change * min(1.0, most / max(float(np.abs(change).max()), 1e-12))
        qd = ramp + left * (qd - ramp)
        q[k + 1] = q[k] + period * qd
    return q
