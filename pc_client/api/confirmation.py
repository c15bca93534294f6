"""The question before an arm moves that is not known to be simulated."""

from __future__ import annotations

import sys
from collections.abc import Callable

from pc_client.driver.report import RobotReport
from pc_client.driver.watchdog import conditions_text
from pc_client.errors import ClientError
from pc_client.experiment.experiment_text import experiment_text
from pc_client.experiment.preflight import preflight
from pc_client.experiment.prepare import Experiment
from pc_client.kinematics.robot_model import RobotModel
from pc_client.planning.approach import approach_text, plan_approach

__all__ = ["QUESTION", "Confirm", "ask_at_terminal", "experiment_description"]

Confirm = Callable[[str], bool]
"""Gets the text that describes the motion; returns whether the arm may move."""

QUESTION = "The arm is going to move. Is the space around it free, and the emergency stop at hand?"
_NO_TERMINAL = (
    "there is no terminal to ask at whether the arm may move: run this at one, or give "
    "connect(..., confirm=lambda text: True) after a person has checked the arm"
)


def ask_at_terminal(text: str) -> bool:
    """Show the description of a motion and ask at the terminal.

    Raises:
        ClientError: there is no terminal to ask at.
    """
    if sys.stdin is None or sys.stdin.closed:
        raise ClientError(_NO_TERMINAL)
    print(text)
    try:
        return input(f"{QUESTION} [y/N]: ").strip().lower() in ("y", "yes")
    except EOFError:
        raise ClientError(_NO_TERMINAL) from None


def experiment_description(host: str, report: RobotReport, model: RobotModel, wanted: Experiment) -> str:
    """Describe the motion of an experiment, for the people beside the arm.

    Raises:
        ClientError: there is no clear path to the start.
    """
    approach = plan_approach(wanted.planned[0].joints, report.frame.actual_q, model=model)
    return "\n".join(
        (
            f"robot at {host}: {report.info}",
            conditions_text(preflight(report, model)),
            experiment_text(wanted),
            approach_text(approach),
        )
    )
