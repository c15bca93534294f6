"""Laws of users. Each is checked before the arm moves; one without a plan is checked while it moves, too.

A motion by a velocity law has no plan. So before a velocity is sent, the way on which the arm would come to
rest if it were stopped now is held against joint ranges and clearances, as a plan's postures are.
"""

import reprlib
import time
from collections.abc import Callable, Sequence
from inspect import signature
from typing import NamedTuple

import numpy as np

from pc_client.arrays import Array
from pc_client.control.reference import ReferenceTable, RunRecipe
from pc_client.control.tracker import ControlLaw, Tracker, six_velocities
from pc_client.driver.velocity_stream import check_command
from pc_client.errors import LOG, ClientError, ControllerError, DriverError, one_line
from pc_client.experiment.prediction import posture_complaint, way_to_rest
from pc_client.kinematics.clearance import clearance_model
from pc_client.kinematics.model import RobotModel, check_flange, tcp_pose
from pc_client.planning.limits import limits_of
from pc_client.planning.plan import Plan
from protocol.pose import T_to_pose
from protocol.realtime.layout import RealtimeFrame

VelocityLaw = Callable[[RealtimeFrame], Sequence[float] | Array | None]
"""Takes a frame of port 30003; returns (6,) joint velocities [rad/s], or None to end."""

ACCELERATION = 5.0
"""Of the robot's `speedj` [rad/s2], of the leading joint, where a user names no other."""

_SPEED_SHARE = 0.95
"""Of the joint speed limits that a law may use, as the controllers do."""

_REST = [0.0] * 6


def check_law(law: object, what: str, allowed: str, n_arguments: int) -> None:
    """Raise ControllerError for what is no function of so many arguments; it is not called."""
    try:
        signature(law).bind(*range(n_arguments))  # type: ignore[arg-type]  # it says what cannot be called
    except (TypeError, ValueError) as error:
        raise ControllerError(f"{what}: {reprlib.repr(law)}, {error}; give {allowed}") from error


def rehearse(law: ControlLaw, recipe: RunRecipe, plan: Plan, frame: RealtimeFrame, model: RobotModel) -> None:
    """Ask a law for the first command of a plan, before anything moves, and warn if it is slow.

    Args:
        recipe: of the run.
        frame: of the robot, wherever it stands; the law gets one of the arm at rest at the start.

    Raises:
        ClientError: it fails, or gives no six velocities within the limits.
    """
    own, q, values = recipe.controller, plan.joints.start_q, frame.values.copy()
    still = {"q": q, "qd": 0.0 * q, "tcp_pose": np.array(T_to_pose(tcp_pose(model, q)))}
    for name, six in still.items():
        for whose in ("target", "actual"):
            values[frame.layout.slices[f"{whose}_{name}"]] = six
    values.setflags(write=False)
    tracker = Tracker(ReferenceTable(plan.joints.spline, recipe, plan.movement), own, model, law)
    began = time.perf_counter()
    try:
        step = tracker.answer(type(frame)(values))
    except ClientError:
        raise
    except Exception as error:
        what = f"{type(error).__name__}: {one_line(error)}"
        raise ControllerError(f"{own.title} fails before anything has moved: {what}") from error
    spent = time.perf_counter() - began
    check_command(step.qd_cmd, tracker.qd_max)
    if spent > recipe.period:
        slow = "%s took %.1f ms for its first command, a cycle is %g ms: frames may come late"
        LOG.warning(slow, own.title, 1e3 * spent, 1e3 * recipe.period)


class LawStep(NamedTuple):
    """What a law returns for one frame.

    Attributes:
        qd_cmd: (6,) velocities to send, or in force [rad/s].
        finished: True: the law has ended.
    """

    qd_cmd: list[float]
    finished: bool


class LawStream:
    """Asks the law of a user for every command, and refuses what leads out of the limits of an arm.

    Attributes:
        qd_max: (6,) the largest speeds that a step can command [rad/s].
    """

    def __init__(self, law: VelocityLaw, model: RobotModel) -> None:
        self._law = law
        self._model = model
        self._limits = limits_of(model)
        self._clearance = clearance_model(model)
        self._last = _REST
        self.qd_max = tuple(_SPEED_SHARE * limit for limit in model.limits.qd_max)

    def answer(self, frame: RealtimeFrame) -> LawStep:
        """Ask the law.

        Raises:
            DriverError: it gives no six finite velocities, one that is too large, or leads out of the limits.
        """
        qd = self._law(frame)
        if qd is None:
            return LawStep(_REST, True)
        self._last = six_velocities(qd)
        # From the faster of the two velocities, that of now and the new one, the arm must be able to stop.
        measured = frame.actual_qd
        fastest = np.where(np.abs(measured) > np.abs(self._last), measured, self._last)
        way = way_to_rest(self._model, frame.actual_q, fastest)
        if complaint := posture_complaint(self._clearance, self._limits, way):
            raise DriverError(f"the velocity law leads out of the limits: {complaint}: the arm was stopped")
        return LawStep(self._last, False)

    def observe(self, stamp: float) -> LawStep:
        """The command in force at a frame [s] that gets none of its own."""
        return LawStep(self._last, False)

    def check_report(self, q: Sequence[float], pose: Sequence[float]) -> None:
        """See `kinematics.model.check_flange`."""
        check_flange(self._model, q, pose)
