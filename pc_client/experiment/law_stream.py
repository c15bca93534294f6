"""A velocity law of a user on the arm: six velocities for each frame, under the watchdog of every motion.

Such a motion has no plan. So before a velocity is sent, the posture in which the arm would
come to rest if it were stopped now is held against joint ranges and clearances, as a plan's postures are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pc_client.driver.receiver_script import STOP_DECELERATION
from pc_client.errors import DriverError
from pc_client.kinematics.agreement import check_flange
from pc_client.kinematics.clearance import clearance_model
from pc_client.kinematics.robot_model import RobotModel
from pc_client.planning.limits import limits_of
from protocol.realtime.layout import RealtimeFrame
from protocol.ur_types import JOINT_NAMES

Array = NDArray[np.float64]

VelocityLaw = Callable[[RealtimeFrame], Sequence[float] | Array | None]
"""Takes a frame of port 30003; returns (6,) joint velocities [rad/s], or None to end."""

ACCELERATION = 5.0
"""Of the robot's `speedj` [rad/s2], of the leading joint, where a user names no other."""

_REACTION = 0.1
"""From a frame to the start of the robot's ramp [s]: the loop's delay, and the robot's patience with us."""

_SPEED_SHARE = 0.95
"""Of the joint speed limits that a law may use, as the controllers do."""

_REST = [0.0] * 6


class LawStep(NamedTuple):
    """What a law returns for one frame.

    Attributes:
        qd_cmd: (6,) velocities to send, or in force [rad/s].
        finished: True: the law has ended.
    """

    qd_cmd: list[float]
    finished: bool


class LawStream:
    """Asks a law for every command, and refuses what leads out of the arm's limits.

    Args:
        law: of the user.
        model: the nominal arm in its cell.
    """

    def __init__(self, law: VelocityLaw, model: RobotModel) -> None:
        self._law = law
        self._model = model
        self._limits = limits_of(model)
        self._clearance = clearance_model(model)
        self._last = _REST

    @property
    def qd_max(self) -> tuple[float, ...]:
        """(6,) the largest speeds that a step can command [rad/s]."""
        return tuple(_SPEED_SHARE * limit for limit in self._model.limits.qd_max)

    def answer(self, frame: RealtimeFrame) -> LawStep:
        """Ask the law.

        Raises:
            DriverError: it gives no six finite velocities, one that is too large, or leads out of the limits.
        """
        qd = self._law(frame)
        if qd is None:
            return LawStep(_REST, True)
        velocities = _six(qd)
        self._check_path(frame.actual_q, velocities)
        self._last = velocities.tolist()
        return LawStep(self._last, False)

    def observe(self, stamp: float) -> LawStep:
        """The command in force at a frame [s] that gets none of its own."""
        return LawStep(self._last, False)

    def check_report(self, q: Sequence[float], pose: Sequence[float]) -> None:
        """Refuse a report whose joint angles (6,) [rad] and TCP pose (6,) [m, rad] do not belong together.

        Raises:
            DriverError: they are further apart than `kinematics.agreement` allows.
        """
        check_flange(self._model, q, pose)

    def _check_path(self, q: Array, qd: Array) -> None:
        """Refuse velocities from which the arm could not stop inside its limits."""
        braking = _REACTION + float(np.abs(qd).max()) / (2.0 * STOP_DECELERATION)
        at_rest = q + braking * qd
        arm, margin = self._model.limits, self._limits.position_margin
        left = np.minimum(at_rest - np.array(arm.q_min), np.array(arm.q_max) - at_rest)
        joint = int(left.argmin())
        if not left[joint] >= margin:
            raise DriverError(
                f"the velocity law drives {JOINT_NAMES[joint]} to {math.degrees(at_rest[joint]):.0f} deg, "
                f"within {math.degrees(margin):.1f} deg of the end of its range: the arm was stopped"
            )
        clearance = self._clearance.along(at_rest)
        for distances, least in (
            (clearance.floor, self._limits.floor_clearance_min),
            (clearance.own, self._limits.own_clearance_min),
            (clearance.cell, self._limits.cell_clearance_min),
        ):
            if not (distance := float(distances.least[0])) >= least:
                raise DriverError(
                    f"the velocity law leads too near: {distances.nearest[0].says(distance, least)}: "
                    "the arm was stopped"
                )


def _six(qd: Sequence[float] | Array) -> Array:
    """The velocities (6,) [rad/s] that a law gave.

    Raises:
        DriverError: they are no six finite numbers.
    """
    try:
        velocities = np.asarray(qd, dtype=np.float64)
    except (TypeError, ValueError):
        velocities = np.zeros(0)
    if velocities.shape != (6,) or not np.isfinite(velocities).all():
        raise DriverError(
            f"the velocity law gave {str(qd)[:100]}: give six finite velocities in rad/s, or None to end"
        )
    return velocities
