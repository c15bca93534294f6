"""PastCycles: the results of the last cycles, as scripts and ports read them.

Ports show less recent values than the controller works with: see `Plant.report`.
"""

from collections import deque
from itertools import islice
from operator import mul

from ur_emulator.machine.controller.snapshot import Snapshot
from ur_emulator.machine.models.robot_generation import RobotGeneration
from ur_emulator.machine.models.robot_model import ZERO6, Vector6, six
from ur_emulator.machine.motion.generators import JointTarget
from ur_emulator.machine.plant.arm_plant import PlantState
from ur_hil.arithmetic import add_up

# How far back a script may ask for joint positions [s]; the real buffer's length is not known.
HISTORY_TIME = 1.0
# Measured accelerations are those of a parabola through the positions of this time [s]. Chosen: encoder noise
# of 22 urad leaves 0.4 rad/s^2, and the value is 10 ms old.
PARABOLA_TIME = 0.02


class PastCycles:
    """The end of the last cycle and counts over the last cycles. The controller writes it, once a cycle.

    Attributes:
        snapshot: what ports publish of the last cycle.
        target: set-point at the end of the last cycle.
        sensed: state of the arm after it; what scripts see as "actual" during the present one.
        q_history: measured joint positions of the last cycles [rad], the newest first.
        steady_cycles: number of cycles for which the target has not moved.
    """

    __slots__ = ("_generation", "q_history", "sensed", "snapshot", "steady_cycles", "target")

    snapshot: Snapshot
    target: JointTarget
    sensed: PlantState

    def __init__(self, generation: RobotGeneration) -> None:
        self._generation = generation
        self.q_history: deque[Vector6] = deque(maxlen=generation.cycles(HISTORY_TIME))
        self.steady_cycles = 0

    def place(self, target: JointTarget, sensed: PlantState) -> None:
        """Let a resting arm have been at a target all the time."""
        self.target = target
        self.sensed = sensed

    def add(self, snapshot: Snapshot, target: JointTarget, sensed: PlantState, *, is_still: bool) -> None:
        """Take the results of a cycle that has ended.

        `is_still`: the target stands still, and no compliant mode is on.
        """
        self.steady_cycles = self.steady_cycles + 1 if is_still else 0
        self.snapshot = snapshot
        self.target = target
        self.sensed = sensed
        self.q_history.appendleft(sensed.actual_q)

    def measured(self) -> JointTarget:
        """Return the measured arm as a set-point."""
        return JointTarget(self.sensed.actual_q, self.sensed.actual_qd)

    def joint_accelerations(self) -> Vector6:
        """Return measured joint accelerations [rad/s^2], in the middle of PARABOLA_TIME."""
        n = min(len(self.q_history), 1 + max(2, self._generation.cycles(PARABOLA_TIME)))
        if n < 3:
            return ZERO6
        # The polynomial of second order that is orthogonal to a constant and to a line.
        squares = [(i - 0.5 * (n - 1)) ** 2 for i in range(n)]
        weights = [square - add_up(squares) / n for square in squares]
        scale = 2.0 / (add_up(w * w for w in weights) * self._generation.period_s**2)
        latest = islice(self.q_history, n)
        return six([scale * add_up(map(mul, weights, joint)) for joint in zip(*latest, strict=True)])
