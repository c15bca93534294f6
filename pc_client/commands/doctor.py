"""`ur-client doctor`: what answers at an address, and whether the robot is as it must be. Only reads."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from pc_client.commands.options import CellOption, PortBaseOption, RobotOption, ToolOption, ports_of, say
from pc_client.kinematics.tool import surroundings
from ur_hil.command_line import ExitCode

if TYPE_CHECKING:
    from pc_client.driver.report import FrameRhythm


def doctor(
    robot: RobotOption,
    cell: CellOption = None,
    tool: ToolOption = None,
    port_base: PortBaseOption = 0,
    seconds: Annotated[
        float, typer.Option("--seconds", min=0.1, max=600.0, help="How long to listen.")
    ] = 2.0,
) -> None:
    """Say what answers on which port, how even frames come, and whether the robot is as it must be."""
    from pc_client.driver.report import probe
    from pc_client.driver.transport import TcpNetwork
    from pc_client.driver.watchdog import conditions_text, refusal
    from pc_client.experiment.preflight import model_of, preflight

    around = surroundings(cell, tool)
    found = probe(TcpNetwork(), robot, ports_of(port_base), seconds)
    for name, number, state in found.ports:
        say(f"port {number:5}  {name:13} {state}")
    if found.info is not None:
        say(f"robot       {found.info}")
    if found.rhythm is not None:
        _show_rhythm(found.rhythm)
    obstacle, unreported = found.obstacle, []
    if found.report is not None:
        if found.report.calibration is not None:
            say(f"calibration {found.report.calibration}")
        conditions = preflight(found.report, model_of(found.report, around))
        say(conditions_text(conditions))
        obstacle = refusal(conditions) or obstacle
        unreported = [condition.name for condition in conditions if condition.holds is None]
    if obstacle:
        say(f"streaming   NOT NOW: {obstacle}")
        raise typer.Exit(ExitCode.FAILED)
    say(
        "streaming   ready"
        + (f"; not reported by this software: {', '.join(unreported)}" if unreported else "")
    )


def _show_rhythm(rhythm: FrameRhythm) -> None:
    say(f"frames      {rhythm.frame_size} bytes, {rhythm.n_new} new, {rhythm.n_heartbeats} heartbeats")
    if rhythm.cycle is None:
        say("cycle       the robot's time stands still until a program runs (lockstep)")
    else:
        say(f"cycle       {rhythm.cycle * 1e3:.3f} ms, {rhythm.lost} cycles lost")
    say(
        f"arrival     jitter {rhythm.arrival_sd * 1e3:.2f} ms (standard deviation), "
        f"longest pause {rhythm.arrival_worst * 1e3:.1f} ms"
    )
