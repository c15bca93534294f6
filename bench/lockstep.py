"""How fast the closed loop runs in lockstep: robot seconds per wall second while the client streams."""

from __future__ import annotations

import tempfile
from pathlib import Path

from bench.box_process import box_process
from pc_client.control.controller_config import CONTROLLERS
from pc_client.driver.ur_driver import UrDriver
from pc_client.experiment.prepare import load_movements, prepare_experiment
from pc_client.experiment.runner import ExperimentRunner
from pc_client.movements import library_names


def measure_lockstep() -> dict[str, float]:
    """Run the ten movements once; time the streaming alone, both processes, real sockets, recording on."""
    with box_process("--pace", "lockstep", "--seed", "7") as box, tempfile.TemporaryDirectory() as folder:
        experiment = prepare_experiment(load_movements(library_names()), repeat=1, out=Path(folder))
        with UrDriver("127.0.0.1", box.ports) as driver:
            report = ExperimentRunner(driver, experiment, CONTROLLERS["preview"]).run()
        robot_time = sum(stream.robot_time for stream in report.streams)
        wall_time = sum(stream.wall_time for stream in report.streams)
        cycles = robot_time / driver.info.period
    return {
        "lockstep_x_realtime": robot_time / wall_time,
        "lockstep_cycle_us": 1e6 * wall_time / cycles,
    }
