"""How fast the closed loop runs in lockstep: robot seconds per wall second while the client streams."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pc_client as ur
from bench.box_process import box_process
from bench.length import FULL, Length
from bench.limit import measure_limit
from bench.paper_set import movements


def measure_lockstep(length: Length = FULL, robot: str = "ur3") -> dict[str, float]:
    """Run the ten movements once; time the streaming alone, both processes, real sockets, recording on.

    The limit is measured before and after; the smaller one counts.
    """
    before = measure_limit(robot, length)
    cycle_us, period = _measure(robot, "typical", length)
    exact_us, _ = _measure(robot, "exact", length)
    after = measure_limit(robot, length)
    limit_us = min(before.cycle_us, after.cycle_us)
    return {
        "lockstep_x_realtime": 1e6 * period / cycle_us,
        "lockstep_cycle_us": cycle_us,
        "lockstep_limit_us": limit_us,
        "lockstep_cycle_x_limit": cycle_us / limit_us,
        "lockstep_limit_steps_us": min(before.steps_us, after.steps_us),
        "lockstep_limit_round_trip_us": min(before.round_trip_us, after.round_trip_us),
        "lockstep_exact_x_realtime": 1e6 * period / exact_us,
        "lockstep_exact_cycle_us": exact_us,
    }


def _measure(robot: str, fidelity: str, length: Length) -> tuple[float, float]:
    """Wall time of a cycle [us] with an arm of this fidelity, and the cycle of the robot [s]."""
    options = ("--robot", robot, "--pace", "lockstep", "--seed", "7", "--fidelity", fidelity)
    with box_process(*options) as box, tempfile.TemporaryDirectory() as folder:
        arm = ur.connect(box.host, box.ports)
        chosen = movements(length)[: length.part_of(10)]
        plans = [ur.plan(movement, arm) for movement in chosen]
        report = arm.experiment(plans, 1, ur.Controller.preview(), Path(folder))
        period = arm.report.info.period
    cycles = sum(stream.robot_time for stream in report.streams) / period
    return 1e6 * sum(stream.wall_time for stream in report.streams) / cycles, period
