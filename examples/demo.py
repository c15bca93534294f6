"""The paper's experiment on the emulated arm: `make demo` runs this.

Starts a box in lockstep pace as a process of its own, lets the client run the ten movements three times each
with the published controller and with `preview`, and once each with other numbers of the published one; ends
the box. The client is the same that drives a real arm; only the address differs. Results in out/demo:
report.html, and a folder with tables and recordings for each controller.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from pc_client.analysis.report import build_report, build_tables
from pc_client.analysis.side_by_side import build_side_by_side
from pc_client.control.controller import CONTROLLERS, Controller
from pc_client.driver.session import UrDriver
from pc_client.errors import ClientError
from pc_client.experiment.experiment import Experiment, load_movements, prepare_experiment
from pc_client.experiment.runner import ExperimentRunner
from pc_client.movements.files import library_names
from pc_client.studies.sweep.box import Box, simulated_box
from pc_client.studies.sweep.case import SimulatedArm

PAPER, PREVIEW = CONTROLLERS["paper"], CONTROLLERS["preview"]
# The paper gives neither gains nor acceleration: the page shows what other ordinary numbers would have given.
# P [1/s], I [1/s2] and the acceleration of `speedj` [rad/s2].
OTHER_NUMBERS = ((2.0, 0.5, 3.0), (10.0, 5.0, 3.0), (4.0, 2.0, 5.0), (4.0, 2.0, 20.0))


def main() -> int:
    parser = argparse.ArgumentParser(description="The paper's experiment on the emulated arm.")
    parser.add_argument("--out", type=Path, default=Path("out/demo"))
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--fidelity", choices=["ideal", "typical", "poor"], default="typical")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--movements", default=",".join(library_names()))
    options = parser.parse_args()
    out, console = options.out, Console(highlight=False)
    try:
        planned = prepare_experiment(
            load_movements(options.movements.split(",")), repeat=options.repeat, out=out
        )
        shown = [(PAPER, "paper"), (PREVIEW, "preview")]
        others = [
            (
                replace(PAPER, gain_p=p, gain_i=i, speedj_acceleration=a),
                f"sensitivity/p{p:g}-i{i:g}-a{a:g}",
            )
            for p, i, a in OTHER_NUMBERS
        ]
        with simulated_box(SimulatedArm("ur3", options.fidelity, options.seed)) as box:
            for config, folder in shown:
                run(replace(planned, out=out / folder, overwrite=True), config, box, console)
            for config, folder in others:
                run(replace(planned, out=out / folder, repeat=1, overwrite=True), config, box, console)
        reports = [build_report(out / folder, console) for _, folder in shown]
        reports += [build_tables(out / folder, console) for _, folder in others]
        table = build_side_by_side(reports, out / "report.html")
    except ClientError as error:
        sys.exit(f"demo: {error}")
    console.print(table.to_rich())
    console.print(f"report: {out / 'report.html'}", soft_wrap=True)
    return 0


def run(experiment: Experiment, config: Controller, box: Box, console: Console) -> None:
    """Run an experiment on a box, and say how fast that was."""
    with UrDriver(box.host, box.ports) as driver:
        streams = ExperimentRunner(driver, experiment, config).run().streams
    moved, wall_time = sum(s.robot_time for s in streams), sum(s.wall_time for s in streams)
    console.print(
        f"{config.title}: {experiment.n_runs} runs, {moved:.0f} s of movement in {wall_time:.1f} s",
        soft_wrap=True,
    )


if __name__ == "__main__":
    sys.exit(main())
