"""The approach to a start: streamed like a run, so the arm stops when commands stop; checked at its end."""

from __future__ import annotations

import numpy as np

from pc_client.control.controller import APPROACH
from pc_client.control.reference import ReferenceTable
from pc_client.control.tracker import Tracker, TrackerStep
from pc_client.driver.session import UrDriver
from pc_client.errors import DriverError
from pc_client.kinematics.robot_model import RobotModel
from pc_client.planning.approach import Approach
from protocol.realtime.layout import RealtimeFrame

_SETTLE = 0.8
"""Time at the end, position loop closed [s]: four time constants of the feedback."""

_ARRIVAL_TOLERANCE = 5e-3
"""Largest distance of a joint from the posture after an approach [rad]; a blocked arm is far off."""

_NO_MOVE = 1e-4
"""An approach shorter than this [rad] is not run."""


def run_approach(driver: UrDriver, approach: Approach, model: RobotModel) -> None:
    """Move the arm along a checked path and wait until it rests at its end.

    Args:
        driver: a session; the arm rests where the approach begins.
        approach: the checked path.
        model: the nominal arm.

    Raises:
        RobotStoppedError: the robot stopped.
        DriverError: the arm did not follow or arrive, or the connection broke; it has been stopped.
    """
    goal = approach.waypoints[-1]
    if np.abs(approach.waypoints - approach.q_from).max() < _NO_MOVE:
        return
    table = ReferenceTable(approach.motion, period=driver.info.period, lead=0.0, settle=_SETTLE)
    tracker = Tracker(table, APPROACH, model)
    driver.stream(tracker, _ignore, acceleration=APPROACH.speedj_acceleration)
    error = float(np.abs(driver.actual_q() - goal).max())
    if not error <= _ARRIVAL_TOLERANCE:
        raise DriverError(
            f"the arm is {error:.4f} rad away from the posture it was sent to, allowed is "
            f"{_ARRIVAL_TOLERANCE} rad: is it blocked?"
        )


def _ignore(frame: RealtimeFrame, step: TrackerStep) -> None:
    """Nothing of an approach is kept."""
