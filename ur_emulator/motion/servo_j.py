"""servoj: the joints follow a position that is commanded anew in every cycle.

Source: URScript manual CB3 3.15, servoj: `gain` is "the proportional gain for following the target position",
and `lookahead_time` "projects the current position forward in time with the current velocity"; a long one
"prevents overshoot". As an equation: qdd = gain (q_goal - (q + lookahead qd)). Its lag behind a moving goal
is the lookahead time, which users measure (plus the delay of the arm). Where a goal moves faster than a joint
can, the joint follows at its rated speed: the maker's tests stream such goals and expect the arm to arrive.
"""

from __future__ import annotations

from ur_emulator.models.robot_model import Vector6, six
from ur_emulator.motion.generators import Generator, StopJ, Streamed
from ur_emulator.motion.target import JointTarget

# Ranges of the manual; values outside are limited to them.
LOOKAHEAD = (0.03, 0.2)  # s
GAIN = (100.0, 2000.0)  # 1/s^2
# Deceleration when no further servoj comes [rad/s^2]. Chosen: that of a program's end.
LOST_DECELERATION = 20.0


class ServoJ(Streamed):
    """Move the joints towards `q`; it never ends by itself."""

    def __init__(self, q: Vector6, lookahead: float, gain: float, qd_max: Vector6) -> None:
        """Take the goal [rad], the lookahead time [s], the gain [1/s^2] and the rated speeds [rad/s]."""
        self._q = q
        self._qd_max = qd_max
        self._lookahead = min(max(lookahead, LOOKAHEAD[0]), LOOKAHEAD[1])
        self._gain = min(max(gain, GAIN[0]), GAIN[1])
        self.done = False

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Advance by `scale * dt`; the integration is implicit, so that all gains are stable."""
        if scale <= 0.0:
            return JointTarget(target.q)
        h = scale * dt
        k = h * self._gain
        denominator = 1.0 + k * (self._lookahead + 0.5 * h)
        # Speeds before speed scaling.
        before = [v / scale for v in target.qd]
        after = [
            min(max((v + k * (goal - q - 0.5 * h * v)) / denominator, -most), most)
            for q, v, goal, most in zip(target.q, before, self._q, self._qd_max, strict=True)
        ]
        return JointTarget(
            six([q + 0.5 * h * (v + w) for q, v, w in zip(target.q, before, after, strict=True)]),
            six([scale * w for w in after]),
            six([(scale * w - v) / dt for v, w in zip(target.qd, after, strict=True)]),
        )

    def when_lost(self) -> Generator:
        """Stop."""
        return StopJ(LOST_DECELERATION)
