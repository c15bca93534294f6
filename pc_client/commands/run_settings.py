"""How a command moves the arm: one record, and the options that all such commands share, declared once.

A command that moves an arm has a keyword parameter `settings: RunSettings` and stands under
`@takes_run_settings`; the options of `_read_settings` are then its own. A new option is a parameter of
`_read_settings` and, if it says how to move, a field of the record.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import Any

import typer

from pc_client.commands.options import (
    AccelerationOption,
    CellOption,
    ControllerOption,
    DryRunOption,
    GainIOption,
    GainPOption,
    OverwriteOption,
    PortBaseOption,
    ReversePortOption,
    YesOption,
    cell_of,
    ports_of,
)
from pc_client.control.controller import DEFAULT, Controller, load_controller
from pc_client.errors import ControllerError
from pc_client.kinematics.cell import Cell
from protocol.ur_types import Ports

_OPTIONS = {"gain_p": "--gain-p", "gain_i": "--gain-i", "speedj_acceleration": "--acceleration"}


@dataclass(frozen=True, slots=True)
class RunSettings:
    """How to move an arm, whatever the movements and whichever the robot.

    Attributes:
        controller: the same for all runs.
        cell: what stands around the arm and what it carries.
        ports: where the control box listens.
        reverse_port: where its programs dial back; see `ReverseServer`.
        overwrite: replace simulated recordings of the same names.
        yes: do not ask before a real arm moves.
        dry_run: end where the arm would begin to move.
    """

    controller: Controller
    cell: Cell
    ports: Ports
    reverse_port: int | None
    overwrite: bool
    yes: bool
    dry_run: bool


def _read_settings(
    controller: ControllerOption = DEFAULT,
    gain_p: GainPOption = None,
    gain_i: GainIOption = None,
    acceleration: AccelerationOption = None,
    cell: CellOption = None,
    port_base: PortBaseOption = 0,
    reverse_port: ReversePortOption = None,
    overwrite: OverwriteOption = False,
    yes: YesOption = False,
    dry_run: DryRunOption = False,
) -> RunSettings:
    """Make the record from what was given on the command line.

    Raises:
        ControllerError: there is no such controller, or its file makes no sense.
        CellError: the cell's file makes no sense.
        typer.BadParameter: an option makes no sense.
    """
    given = {"gain_p": gain_p, "gain_i": gain_i, "speedj_acceleration": acceleration}
    numbers = {name: value for name, value in given.items() if value is not None}
    base = load_controller(controller)
    try:
        config = base.changed(numbers, _OPTIONS.__getitem__)
    except ControllerError as error:
        raise typer.BadParameter(str(error)) from error
    return RunSettings(config, cell_of(cell), ports_of(port_base), reverse_port, overwrite, yes, dry_run)


def takes_run_settings(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of `_read_settings` in place of its keyword parameter `settings`.

    Typer reads a command's options from its signature: the two signatures are put together here.
    """
    shared = inspect.signature(_read_settings, eval_str=True).parameters
    own = dict(inspect.signature(command, eval_str=True).parameters)
    del own["settings"]
    together = [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in (*own.values(), *shared.values())]

    @wraps(command)
    def with_options(**given: Any) -> None:
        settings = _read_settings(**{name: given.pop(name) for name in shared})
        command(**given, settings=settings)

    vars(with_options)["__signature__"] = inspect.Signature(together)
    with_options.__annotations__ = {p.name: p.annotation for p in together}
    return with_options
