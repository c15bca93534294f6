"""What every command does before an arm moves: compare the robot with the model, show the plan, ask."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import typer

from pc_client.commands.options import say
from pc_client.errors import ClientError

if TYPE_CHECKING:
    from pc_client.driver.robot_report import RobotReport
    from pc_client.experiment.prepare import Experiment
    from pc_client.kinematics.cell import Cell
    from pc_client.kinematics.robot_model import RobotModel
    from protocol.ur_types import Ports


def ask_robot(robot: str, ports: Ports, cell: Cell) -> tuple[RobotReport, RobotModel]:
    """Ask a robot what it reports, and refuse it before anything is planned; it stays as it is.

    Args:
        robot: name or address of the control box.
        ports: its ports.
        cell: what stands around it and what it carries.

    Returns:
        What it reports, and the nominal model of its arm in the cell.

    Raises:
        ClientError: it does not answer, does not tell which arm it is, or is not as it must be.
    """
    from pc_client.driver.robot_report import read_report
    from pc_client.driver.transport import TcpNetwork
    from pc_client.experiment.preflight import model_of, preflight, require

    report = read_report(TcpNetwork(), robot, ports)
    model = model_of(report, cell)
    require(preflight(report, model))
    if model is None:
        raise ClientError(f"{robot} does not tell which arm it is: there is no plan for it")
    return report, model


def ask_before_motion(planned: Experiment, robot: str, report: RobotReport) -> None:
    """Show what is going to happen and ask, unless the robot says itself that it is simulated.

    Nothing has moved and no connection stays open meanwhile.

    Args:
        planned: what the arm is going to do.
        robot: name or address of the control box.
        report: what it reports.

    Raises:
        ClientError: nobody can be asked.
        typer.Abort: the answer is no.
    """
    if report.info.simulated is True:
        return
    from pc_client.driver.condition import conditions_text
    from pc_client.experiment.experiment_text import experiment_text
    from pc_client.experiment.preflight import preflight
    from pc_client.planning.approach import plan_approach
    from pc_client.planning.plan_text import approach_text

    approach = plan_approach(planned.planned[0].plan, report.frame.actual_q, model=planned.model)
    say(f"robot at {robot}: {report.info}")
    say(conditions_text(preflight(report, planned.model)))
    say(experiment_text(planned))
    say(approach_text(approach))
    if sys.stdin is None or sys.stdin.closed:
        raise ClientError(
            "nobody can be asked whether the arm may move: run this at a terminal, or give --yes"
        )
    typer.confirm(
        "The arm is going to move. Is the space around it free, and the emergency stop at hand?", abort=True
    )
