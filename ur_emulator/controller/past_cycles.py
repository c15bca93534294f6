"""PastCycles: the results of the last cycles, as scripts and ports read them."""

from __future__ import annotations

from collections import deque

from ur_emulator.controller.snapshot import Snapshot
from ur_emulator.models.robot_generation import RobotGeneration
from ur_emulator.models.robot_model import Vector6

# How far back a script may ask for joint positions [s]; the real buffer's length is not known.
HISTORY_TIME = 1.0


class PastCycles:
    """The last snapshot and counts over the last cycles. The controller writes it, once a cycle.

    Attributes:
        snapshot: state at the end of the last cycle; what scripts see as "actual" during the present one.
        q_history: measured joint positions of the last cycles [rad], the newest first.
        steady_cycles: number of cycles for which the target has not moved.
    """

    __slots__ = ("q_history", "snapshot", "steady_cycles")

    snapshot: Snapshot

    def __init__(self, generation: RobotGeneration) -> None:
        self.q_history: deque[Vector6] = deque(maxlen=generation.cycles(HISTORY_TIME))
        self.steady_cycles = 0

    def add(self, snapshot: Snapshot, *, is_still: bool) -> None:
        """Take the snapshot of a cycle that has ended.

        Args:
            snapshot: of it.
            is_still: the target stands still, and no compliant mode is on.
        """
        self.steady_cycles = self.steady_cycles + 1 if is_still else 0
        self.snapshot = snapshot
        self.q_history.appendleft(snapshot.actual_q)
