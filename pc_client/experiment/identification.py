"""The loop delay of this session: stream the small excitation, evaluate what came back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pc_client.control.controller_config import ControllerConfig
from pc_client.control.delay import DelayEstimate, estimate_delay
from pc_client.control.excitation import Excitation
from pc_client.control.reference import ReferenceTable
from pc_client.control.stability import gain_margin
from pc_client.control.tracker import Tracker, TrackerStep
from pc_client.driver.ur_driver import UrDriver
from pc_client.driver.velocity_stream import StreamReport
from pc_client.errors import DriverError, GainMarginError
from protocol.realtime_layout import RealtimeFrame

_LEAD, _SETTLE = 0.1, 0.3
_RETURN_TOLERANCE = 2e-3
"""How far from where it began the excitation may leave a joint [rad]."""

_LEAST_MARGIN = 2.0
"""A controller needs at least this gain margin with the identified delay: 6 dB, the usual one."""


def identify_delay(
    driver: UrDriver, config: ControllerConfig, qd_max: Sequence[float]
) -> tuple[DelayEstimate, StreamReport]:
    """Identify the loop delay where the arm stands; it moves less than one degree and comes back.

    Args:
        driver: a session; the arm rests.
        config: the controller that will be used: its acceleration is part of the loop, its gains are checked.
        qd_max: (6,) joint speed limits [rad/s].

    Returns:
        The delay, and what happened on the wire.

    Raises:
        DriverError: the stream broke, or the arm did not follow.
        GainMarginError: the controller would be unstable, or nearly.
    """
    q_start = driver.actual_q()
    # Feed-forward alone, its mean over each cycle: the integral of the commands ends exactly where it began.
    open_loop = replace(config, name="excitation", gain_p=0.0, gain_i=0.0)
    table = ReferenceTable(
        Excitation(q_start.tolist()), period=driver.info.period, lead=_LEAD, settle=_SETTLE, lookahead=0.0
    )
    stamps: list[float] = []
    commands: list[list[float]] = []
    positions: list[list[float]] = []

    def collect(frame: RealtimeFrame, step: TrackerStep) -> None:
        stamps.append(frame.timestamp)
        commands.append(step.qd_cmd)
        positions.append(frame.actual_q.tolist())

    report = driver.stream(
        Tracker(table, open_loop, qd_max), collect, acceleration=config.speedj_acceleration
    )
    estimate = estimate_delay(np.array(stamps), np.array(commands), np.array(positions), driver.info.period)
    drift = float(np.abs(driver.actual_q() - q_start).max())
    if not drift <= _RETURN_TOLERANCE:
        raise DriverError(
            f"the excitation left a joint {drift:.4f} rad from where it began, "
            f"allowed is {_RETURN_TOLERANCE} rad"
        )
    margin = gain_margin(config.gain_p, config.gain_i, max(estimate.delay, driver.info.period))
    if margin < _LEAST_MARGIN:
        raise GainMarginError(
            f"with a loop delay of {estimate.delay * 1e3:.0f} ms the controller {config.name!r} has a "
            f"gain margin of {margin:.1f}, needed is {_LEAST_MARGIN}: the loop is too slow for it",
            margin=margin,
            delay=estimate.delay,
        )
    return estimate, report
