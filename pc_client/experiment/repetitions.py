"""What the repetitions of one movement hand on: the learned command, and when it may be used.

One memory belongs to one plan and is gone when the next movement begins; only the waves of the gears, which
are the arm's and not the movement's, go on to it. Nothing is learned from a run that was not clean, and what
was learned before such a run is forgotten with it. Before anything learned is used, the whole of what would
be sent is held against the limits that the plan itself was held against.
"""

from collections.abc import Callable
from dataclasses import replace
from math import inf

import numpy as np

from pc_client.control.gear import GearModel
from pc_client.control.learning import LearningFilter, RunSignals, learn, learnable_power
from pc_client.control.reference import LEAD, ReferenceTable, RunRecipe, TcpReference
from pc_client.control.tracker import TrackerStep
from pc_client.driver.velocity_stream import StreamLog, StreamReport
from pc_client.experiment.checks import broken_limit
from pc_client.kinematics.model import RobotModel
from pc_client.planning.plan import JointPlan

_WORSE = 1.5
"""Growth of the learnable error from one run to the next that ends learning: the arm does not answer small
motions as the model of the loop does. Noise changes it by up to a fifth."""


class Repetitions:
    """The memory of one movement.

    Args:
        recipe: of the movement, without anything learned.
        learning: Q; None for a controller that does not learn.

    Attributes:
        recipe: of the coming run: with what is known of the gears, and what the run before taught.
        learned_from: repetition that it was learned from; 0: none.
        remarks: one line for each time that nothing could be learned or used, with the reason.
    """

    def __init__(self, recipe: RunRecipe, learning: LearningFilter | None, model: RobotModel) -> None:
        self.recipe = recipe
        self._learning = learning
        self._model = model
        self._refused = False
        self._power = inf
        self.learned_from = 0
        self.remarks: list[str] = []

    def renew(self, gear: Callable[[], GearModel | None]) -> None:
        """Take what is known of the gears by now.

        Not while something is learned, which goes with the gears that it was learned with, and not after a
        limit has refused them.
        """
        if self.recipe.learned is None and not self._refused:
            self.recipe = replace(self.recipe, gear=gear())

    def forget(self, remark: str) -> None:
        """Begin the next run without anything learned from the one before."""
        self.recipe, self.learned_from = replace(self.recipe, learned=None), 0
        self.remarks.append(remark)

    def take(self, repetition: int, log: StreamLog[TrackerStep], stream: StreamReport) -> None:
        """Learn from a run that came to its end: nothing in its first moments of rest, nor in its last."""
        if self._learning is None:
            return
        if not is_clean(stream):
            self.forget(
                f"run {repetition} had {stream.late_frames} late and {stream.lost_frames} lost frames: "
                "nothing learned"
            )
            return
        signals = self._signals(log)
        power = learnable_power(signals, self._learning, self.recipe.period)
        if self.recipe.learned is not None and power > _WORSE * self._power:
            self.forget(f"run {repetition} was worse than the one before: nothing more is learned")
            self._learning = None
            return
        self._power = power
        learned = learn(signals, self.recipe, self._learning)
        self.recipe, self.learned_from = replace(self.recipe, learned=learned), repetition

    def _signals(self, log: StreamLog[TrackerStep]) -> RunSignals:
        """A run on the grid of cycles; its time stamps may jitter about it."""
        q, qd_cmd = log.columns("actual_q")
        t = np.array([step.t for step in log.steps])
        grid = np.arange(len(t)) * self.recipe.period - LEAD
        error, added = (
            np.stack([np.interp(grid, t, column) for column in signal.T], axis=1)
            for signal in (
                np.array([step.point.q for step in log.steps]) - q,
                qd_cmd - np.array([step.point.qd_feedforward for step in log.steps]),
            )
        )
        if (learned := self.recipe.learned) is not None:
            n = min(len(grid), len(learned))
            added[:n] += learned[:n]
        return RunSignals(error, added)

    def table(self, plan: JointPlan, tcp: TcpReference) -> ReferenceTable:
        """The reference of the coming run, along the plan in the turns where the arm is.

        The whole of what would be sent is held against the limits. Where one would be broken, what was
        learned is forgotten, and the gears are left out for the rest of this movement.
        """
        table, now = ReferenceTable(plan.spline, self.recipe, tcp), self.recipe
        if now.learned is None and now.gear is None:
            return table
        complaint = broken_limit(plan, table.commands(), now, self._model)
        if not complaint:
            return table
        self.forget(f"what was learned is not used: {complaint}")
        self.recipe, self._refused = replace(self.recipe, gear=None), True
        return ReferenceTable(plan.spline, self.recipe, tcp)


def is_clean(stream: StreamReport) -> bool:
    """True for a run in which every frame came and got its command: one that may be learned from."""
    return not (stream.late_frames or stream.lost_frames)
