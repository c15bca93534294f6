"""The file of a sweep: TOML, read strictly. `docs/sweeps.md` explains every key.

A key that does not exist, a value of the wrong type, a movement that is not there: one line that names the
file, the key and what is allowed. Nothing has been started then.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Annotated, Any

import polars as pl

from pc_client.control.controller import CONTROLLERS, DEFAULT, FIELDS, Controller
from pc_client.errors import MovementError, SweepError
from pc_client.files import FILE_KINDS
from pc_client.kinematics.arms import ROBOTS
from pc_client.kinematics.cell import NO_CELL, Cell, load_cell
from pc_client.movements.library_sets import library_names, library_path
from pc_client.movements.movement import load_movement
from pc_client.studies.sweep.case import MovementFile, SimulatedArm
from pc_client.studies.sweep.settings import Axis, Range, Search, grid, read_axes, repeated, searched
from ur_hil.records import Flag, Items, checked, nearest, record, text, whole, word

FIDELITIES = ("exact", "ideal", "typical", "poor")
"""What `ur-emulator serve --fidelity` knows."""

_MOST_CASES = 100_000
"""More than this is a slip of the pen: weeks on a large cluster."""

Text = Annotated[str, text()]


@record
class SweepFile:
    """The keys of the file.

    Attributes:
        movements: names of the library, or movement files beside the configuration.
        controllers: named controllers, the settings that [controller] starts from.
        robots: types of simulated arms.
        fidelities: how imperfect they are.
        seeds: which arms of their kind.
        robot: host of a control box that is there already, instead of robots, fidelities and seeds.
        port_base: offset of the ports of `robot`.
        reverse_port: port of this computer that `robot` calls; 0: any free one.
        cell: cell file of `robot`, beside the configuration: what stands around it and what it carries.
        repeat: runs of each case in one session.
        search: let optuna choose settings from [controller] instead of taking every combination.
        keep_recordings: whether the recordings (MCAP) stay in the folder.
        output: folder of the results, as seen from where the command is given; --out goes before it.
        controller: fields of the controller, each with a value, a list of values or a range.
    """

    movements: Annotated[tuple[Text, ...], Items()]
    controllers: Annotated[tuple[Annotated[str, word(CONTROLLERS)], ...], Items()] = (DEFAULT,)
    robots: Annotated[tuple[Annotated[str, word(ROBOTS)], ...], Items()] | None = None
    fidelities: Annotated[tuple[Annotated[str, word(FIDELITIES)], ...], Items()] | None = None
    seeds: Annotated[tuple[Annotated[int, whole(0)], ...], Items()] | None = None
    robot: Text | None = None
    port_base: Annotated[int, whole(-65535, 65535)] | None = None
    reverse_port: Annotated[int, whole(0, 65535)] | None = None
    cell: Text | None = None
    repeat: Annotated[int, whole(1, 99)] = 1
    search: Search | None = None
    keep_recordings: Flag = False
    output: Text | None = None
    controller: dict[str, Any] | None = None

    def __post_init__(self) -> None:
        for key in ("movements", "controllers", "robots", "fidelities", "seeds"):
            if problem := repeated(getattr(self, key) or ()):
                raise ValueError(f"{key}: {problem}")
        for key in ("port_base", "reverse_port", "cell") if self.robot is None else ():
            if getattr(self, key) is not None:
                raise ValueError(
                    f"{key}: goes with robot = HOST; simulated arms have ports of their own, and nothing "
                    "around them"
                )
        for key in () if self.robot is None else ("robots", "fidelities", "seeds"):
            if getattr(self, key) is not None:
                raise ValueError(f"{key}: is for simulated arms, but robot = {self.robot!r} is there already")


@dataclass(frozen=True, slots=True)
class SweepConfig:
    """What a sweep's file asks for.

    Attributes:
        file: its keys.
        movements: what to do.
        arms: simulated arms; empty when the file names a robot.
        cell: what stands around that robot and what it carries.
        axes: the values of the controller's fields.
    """

    file: SweepFile
    movements: tuple[MovementFile, ...]
    arms: tuple[SimulatedArm, ...]
    cell: Cell
    axes: dict[str, Axis]

    @property
    def n_cases(self) -> int:
        """Cases in all; a search that proposes a setting twice has fewer."""
        search = self.file.search
        spanned = prod(0 if isinstance(axis, Range) else len(axis) for axis in self.axes.values())
        n_settings = search.trials if search else len(self.file.controllers) * spanned
        return len(self.movements) * max(1, len(self.arms)) * n_settings

    def batches(self, results: Callable[[], pl.DataFrame]) -> Iterator[list[Controller]]:
        """The settings to try: a grid in one batch, those of a search in several.

        Args:
            results: gives the table of the batch before, when its cases are settled.

        Raises:
            ModuleNotFoundError: a search without optuna (extra `search`).
        """
        bases = [CONTROLLERS[name] for name in self.file.controllers]
        if self.file.search is not None:
            yield from searched(bases, self.axes, self.file.search, results)
        else:
            yield grid(bases, {k: axis for k, axis in self.axes.items() if not isinstance(axis, Range)})


def read_config(path: Path) -> SweepConfig:
    """Read the file of a sweep.

    Raises:
        SweepError: the file cannot be read, or what it says makes no sense.
        ControllerError: a field of the controller cannot hold a value.
        MovementError: a movement file makes no sense.
    """
    values = FILE_KINDS["sweep"].read_toml(path)
    for key in values:
        if key in FIELDS:
            raise SweepError(f"{path}: {key}: is a field of the controller; put it under [controller]")
    file = checked(SweepFile, values, str(path), SweepError)
    axes = read_axes(file.controller or {}, str(path))
    if file.search is None:
        for name, axis in axes.items():
            if isinstance(axis, Range):
                raise SweepError(
                    f"{path}: controller.{name}: a range is searched; give a table [search], or a list"
                )
    elif not axes and len(file.controllers) == 1:
        raise SweepError(f"{path}: search: there is nothing to choose; give fields in a table [controller]")
    config = SweepConfig(
        file,
        tuple(_movement(name, path) for name in file.movements),
        () if file.robot is not None else _arms(file),
        NO_CELL if file.cell is None else load_cell(path.parent / file.cell),
        axes,
    )
    if problem := repeated([movement.name for movement in config.movements]):
        raise SweepError(f"{path}: movements: {problem}")
    if config.n_cases > _MOST_CASES:
        raise SweepError(
            f"{path}: {config.n_cases} cases, at most {_MOST_CASES} are allowed; make the lists shorter"
        )
    return config


def _arms(file: SweepFile) -> tuple[SimulatedArm, ...]:
    return tuple(
        SimulatedArm(robot, fidelity, seed)
        for robot in file.robots or ("ur3",)
        for fidelity in file.fidelities or ("typical",)
        for seed in file.seeds or (0,)
    )


def _movement(word: str, config: Path) -> MovementFile:
    """A movement, read and checked; files lie beside the configuration."""
    path = library_path(word) or config.parent / word
    if not path.suffix:
        raise SweepError(
            f"{config}: movements: no movement is called {word!r}; {nearest(word, library_names())}"
        )
    try:
        return MovementFile(load_movement(path).name, path.name, FILE_KINDS["samples"].read_text(path))
    except MovementError as error:
        raise MovementError(f"{config}: movements: {error}") from error
