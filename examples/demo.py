"""The paper's experiment on the emulated arm: `make demo` runs this.

Starts a box in lockstep pace as a process of its own, lets the client run the ten movements three times each
with the published controller and with `preview`, once each with other numbers of the published one, and once
each with both in .8 of the time; ends the box. The client is the same that drives a real arm; only the
address differs. Results in out/demo: report.html, and a folder with tables and recordings for each
controller.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console

import pc_client as ur
from pc_client.analysis.report import build_report, build_side_by_side, build_tables
from pc_client.movements.library_sets import library_names
from ur_emulator import ControlBox

PAPER, PREVIEW = ur.Controller.paper(), ur.Controller.preview()
# The paper gives neither gains nor acceleration: the page shows what other ordinary numbers would have given.
# P [1/s], I [1/s2] and the acceleration of `speedj` [rad/s2].
OTHER_NUMBERS = ((2.0, 0.5, 3.0), (10.0, 5.0, 3.0), (4.0, 2.0, 5.0), (4.0, 2.0, 20.0))
FASTER = 0.8
"""Of the duration of each movement: pace weighs more than any of these numbers. At .7 the client refuses two
movements with the published controller, which would leave their paths too far."""


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
        shown = [(PAPER, "paper"), (PREVIEW, "preview")]
        others = [
            (
                replace(PAPER, gain_p=p, gain_i=i, speedj_acceleration=a),
                f"sensitivity/p{p:g}-i{i:g}-a{a:g}",
            )
            for p, i, a in OTHER_NUMBERS
        ]
        with ControlBox(port_base=None, pace="lockstep", fidelity=options.fidelity, seed=options.seed) as box:
            arm = ur.connect(box.host, box.ports)
            movements = [ur.Movement.library(name) for name in options.movements.split(",")]
            plans = [ur.plan(movement, arm) for movement in movements]
            fast = [ur.plan(m.stretched(FASTER).renamed(f"{m.name}_fast"), arm) for m in movements]
            for controller, folder in shown:
                run(arm, plans, options.repeat, controller, out / folder, console)
            for controller, folder in others:
                run(arm, plans, 1, controller, out / folder, console)
            for controller, folder in shown:
                run(arm, fast, 1, controller, out / "faster" / f"{folder}-{FASTER:g}", console)
        reports = [build_report(out / folder, console) for _, folder in shown]
        reports += [build_tables(out / folder, console) for _, folder in others]
        reports += [build_tables(out / "faster" / f"{folder}-{FASTER:g}", console) for _, folder in shown]
        table = build_side_by_side(reports, out / "report.html")
    except ur.ClientError as error:
        sys.exit(f"demo: {error}")
    console.print(table.to_rich())
    console.print(f"report: {out / 'report.html'}", soft_wrap=True)
    return 0


def run(
    arm: ur.Arm,
    plans: Sequence[ur.Plan],
    times: int,
    controller: ur.Controller,
    out: Path,
    console: Console,
) -> None:
    """Run all plans with one controller, and say how fast that was."""
    streams = arm.experiment(plans, times, controller, out, overwrite=True).streams
    moved, wall_time = sum(s.robot_time for s in streams), sum(s.wall_time for s in streams)
    console.print(
        f"{controller.title}: {len(streams)} runs, {moved:.0f} s of movement in {wall_time:.1f} s",
        soft_wrap=True,
    )


if __name__ == "__main__":
    sys.exit(main())
