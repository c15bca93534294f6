"""What every command does before an arm moves: connect to it, show what is going to happen, ask."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from pc_client.commands.options import say
from pc_client.errors import ClientError

if TYPE_CHECKING:
    from pc_client.api.arm import Arm
    from pc_client.kinematics.cell import Cell
    from protocol.ur_types import Ports


def reach(robot: str, ports: Ports, cell: Cell, reverse_port: int | None = None, *, yes: bool = False) -> Arm:
    """Ask a robot what it is, and refuse it before anything is planned; it stays as it is.

    Args:
        robot: name or address of the control box.
        ports: its ports.
        cell: what stands around it and what it carries.
        reverse_port: where its programs dial back.
        yes: do not ask before a real arm moves.

    Raises:
        ClientError: it does not answer, does not report which arm it is, or is not as it must be.
    """
    from pc_client.api.arm import connect

    confirm = (lambda text: True) if yes else _ask
    return connect(robot, ports, cell=cell, reverse_port=reverse_port, confirm=confirm)


def _ask(text: str) -> bool:
    """Show what is going to happen, and ask.

    Raises:
        ClientError: there is no terminal to ask at.
        typer.Abort: the answer is no.
    """
    import sys

    from pc_client.api.confirmation import QUESTION

    say(text)
    if sys.stdin is None or sys.stdin.closed:
        raise ClientError(
            "there is no terminal to ask at whether the arm may move: run this at one, or give --yes"
        )
    return typer.confirm(QUESTION, abort=True)
