"""What the repetitions of one movement hand on: the learned command, and when it may be used.

One memory belongs to one plan and is gone when the next movement begins; only the waves of the gears, which
are the arm's and not the movement's, go on to it. Nothing is learned from a run that was not clean, and what
was learned before such a run is forgotten with it. Before anything learned is used, the whole of what would
be sent is held against the limits that the plan itself was held against.
"""

from collections.abc import Callable, Sequence
from math import inf

import numpy as np

from pc_client.arrays import Array
from pc_client.control.controller import Controller
from pc_client.control.gear import GearModel
from pc_client.control.learning import LearningBounds, LearningFilter, RunSignals, learn, learnable_power
from pc_client.control.loop import LoopModel
from pc_client.control.reference import ReferenceTable
from pc_client.control.tracker import TrackerStep
from pc_client.driver.velocity_stream import StreamReport
from pc_client.experiment.checks import broken_limit
from pc_client.kinematics.model import RobotModel
from pc_client.planning.plan import JointPlan
from protocol.realtime.layout import RealtimeFrame

_WORSE = 1.5
"""Growth of the learnable error from one run to the next that ends learning: the arm does not answer small
motions as the model of the loop does. Noise changes it by up to a fifth."""


class RunLog:
    """The frames of one run, kept while it goes on, for learning."""

    def __init__(self) -> None:
        self._rows: list[tuple[float, Sequence[float], Sequence[float], Sequence[float], list[float]]] = []

    def append(self, frame: RealtimeFrame, step: TrackerStep) -> None:
        """Take one frame and what was made of it."""
        q, point = frame.actual_q.tolist(), step.point
        self._rows.append((step.t, point.q, q, point.qd_feedforward, step.qd_cmd))

    @property
    def q(self) -> Array:
        """(n, 6) reported positions [rad]."""
        return np.array([row[2] for row in self._rows])

    @property
    def qd_cmd(self) -> Array:
        """(n, 6) commands [rad/s]."""
        return np.array([row[4] for row in self._rows])

    def signals(self, learned: Array | None, lead: float, period: float) -> RunSignals:
        """Return the run on the grid of cycles [s]; its time stamps may jitter about it.

        Args:
            learned: (n, 6) what the run's feed-forward held beside the reference's own, or None.
            lead: time of the first frame before the movement [s].
            period: control cycle [s].
        """
        t, q_ref, q, feedforward, qd_cmd = map(np.array, zip(*self._rows, strict=True))
        grid = np.arange(len(t)) * period - lead
        error, added = (
            np.stack([np.interp(grid, t, column) for column in signal.T], axis=1)
            for signal in (q_ref - q, qd_cmd - feedforward)
        )
        if learned is not None:
            n = min(len(grid), len(learned))
            added[:n] += learned[:n]
        return RunSignals(error, added)


class Repetitions:
    """The memory of one movement.

    Args:
        learning: Q; None for a controller that does not learn.
        period: control cycle [s].

    Attributes:
        learned: (n, 6) what the next run adds to its feed-forward [rad/s]; None: nothing.
        gear: what is known of the gears; None: nothing, or not to be used.
        learned_from: repetition that it was learned from; 0: none.
        remarks: one line for each time that nothing could be learned or used, with the reason.
    """

    def __init__(
        self,
        config: Controller,
        loop: LoopModel,
        learning: LearningFilter | None,
        model: RobotModel,
        period: float,
    ) -> None:
        self._config = config
        self._loop = loop
        self._learning = learning
        self.gear: GearModel | None = None
        self._model = model
        self._period = period
        self._refused = False
        self._power = inf
        self.learned: Array | None = None
        self.learned_from = 0
        self.remarks: list[str] = []

    def renew(self, gear: Callable[[], GearModel | None]) -> None:
        """Take what is known of the gears by now.

        Not while something is learned, which goes with the gears that it was learned with, and not after a
        limit has refused them.
        """
        if self.learned is None and not self._refused:
            self.gear = gear()

    def forget(self, remark: str) -> None:
        """Begin the next run without anything learned from the one before."""
        self.learned, self.learned_from = None, 0
        self.remarks.append(remark)

    def take(self, repetition: int, log: RunLog, stream: StreamReport, lead: float, settle: float) -> None:
        """Learn from a run that came to its end.

        Args:
            lead: time of the run before the movement [s]; in its first half nothing is learned.
            settle: time of the run after it [s]; in its second half nothing is learned.
        """
        if self._learning is None:
            return
        if not is_clean(stream):
            self.forget(
                f"run {repetition} had {stream.late_frames} late and {stream.lost_frames} lost frames: "
                "nothing learned"
            )
            return
        config = self._config
        signals = log.signals(self.learned, lead, self._period)
        power = learnable_power(signals, self._learning, self._period)
        if self.learned is not None and power > _WORSE * self._power:
            self.forget(f"run {repetition} was worse than the one before: nothing more is learned")
            self._learning = None
            return
        self._power = power
        self.learned = learn(
            signals,
            self._loop,
            self._learning,
            config.learning_gain,
            LearningBounds(config.learning_speed, config.learning_acceleration),
            (0.5 * lead, 0.5 * settle),
            self._period,
        )
        self.learned_from = repetition

    def may_use(self, plan: JointPlan, table: ReferenceTable) -> bool:
        """Hold the whole of what would be sent against the limits, before anything is sent.

        The plan is in the turns where the arm is; the table is that of the coming run, with what was learned.
        It is False when a limit would be broken. Then what was learned is forgotten, the gears are left out
        for the rest of this movement, and the table must be made again without both.
        """
        if self.learned is None and self.gear is None:
            return True
        complaint = broken_limit(
            plan, table.commands(), self.learned, self._model, self._config, self._period
        )
        if complaint:
            self.forget(f"what was learned is not used: {complaint}")
            self.gear, self._refused = None, True
        return not complaint


def is_clean(stream: StreamReport) -> bool:
    """True for a run in which every frame came and got its command: one that may be learned from."""
    return not (stream.late_frames or stream.lost_frames)
