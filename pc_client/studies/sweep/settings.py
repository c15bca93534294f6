"""The settings of a sweep: its file, what a search chooses from it, and which setting is the best.

The file is TOML, read strictly; `docs/sweeps.md` explains every key. What is wrong in it is one line that
names the file, the key and what is allowed; nothing has been started then.

The table [controller] has for each field of the controller a value, a list of values, or a range. Lists span
a grid. From lists and ranges optuna chooses, in batches, from the results so far (the table [search]).

Settings are ranked by the mean SNR over everything that they were tried on, on equal terms: one counts only
when all its cases are done. A setting that was refused for one of the arms, or failed on one movement, has a
mean over something else.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import polars as pl

from pc_client.control.controller import CONTROLLERS, DEFAULT, FIELDS, Controller, Value
from pc_client.errors import ControllerError, MovementError, SweepError
from pc_client.files import FILE_KINDS
from pc_client.kinematics.arms import ROBOTS
from pc_client.movements.library_sets import library_names, library_path
from pc_client.movements.movement import load_movement
from pc_client.results.tables import Column
from pc_client.studies.sweep.case import FACTORS, MovementFile, SimulatedArm
from ur_hil.cell import NO_CELL, Cell, load_cell
from ur_hil.records import Finite, Flag, Items, checked, nearest, record, text, whole, word

if TYPE_CHECKING:
    from optuna.distributions import BaseDistribution
    from optuna.samplers import BaseSampler

FIDELITIES = ("exact", "ideal", "typical", "poor")
"""What `ur-emulator serve --fidelity` knows."""

_MOST_CASES = 100_000
"""More than this is a slip of the pen: weeks on a large cluster."""

_Text = Annotated[str, text()]


@record
class Range:
    """Values between two ends.

    Attributes:
        low: smallest value.
        high: largest value.
        log: whether they are equally likely on a logarithmic scale.
    """

    low: Finite
    high: Finite
    log: Flag = False

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise ValueError(f"high: {self.high:g}; give a number above low, which is {self.low:g}")
        if self.log and self.low <= 0.0:
            raise ValueError(f"low: {self.low:g}; with log = true, give a number above 0")


_Axis = tuple[Value, ...] | Range

_MOST_TRIALS = 100_000


@record
class Search:
    """How the best setting is searched.

    The settings depend on these fields, on the results and on the version of optuna, not on how many workers
    there are.

    Attributes:
        trials: settings to try.
        batch: settings that are chosen together, before any of them has a result.
        sampler: "tpe": optuna's tree-structured Parzen estimator; "random": without regard to the results.
        seed: of the sampler.
    """

    trials: Annotated[int, whole(1, _MOST_TRIALS)]
    batch: Annotated[int, whole(1, 1000)] = 8
    sampler: Annotated[str, word(("tpe", "random"))] = "tpe"
    seed: Annotated[int, whole(0, 2**32 - 1)] = 0


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

    movements: Annotated[tuple[_Text, ...], Items()]
    controllers: Annotated[tuple[Annotated[str, word(CONTROLLERS)], ...], Items()] = (DEFAULT,)
    robots: Annotated[tuple[Annotated[str, word(ROBOTS)], ...], Items()] | None = None
    fidelities: Annotated[tuple[Annotated[str, word(FIDELITIES)], ...], Items()] | None = None
    seeds: Annotated[tuple[Annotated[int, whole(0)], ...], Items()] | None = None
    robot: _Text | None = None
    port_base: Annotated[int, whole(-65535, 65535)] | None = None
    reverse_port: Annotated[int, whole(0, 65535)] | None = None
    cell: _Text | None = None
    repeat: Annotated[int, whole(1, 99)] = 1
    search: Search | None = None
    keep_recordings: Flag = False
    output: _Text | None = None
    controller: dict[str, Any] | None = None

    def __post_init__(self) -> None:
        for key in ("movements", "controllers", "robots", "fidelities", "seeds"):
            if problem := _repeated(getattr(self, key) or ()):
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
        arms: simulated arms; empty when the file names a robot.
        cell: what stands around that robot and what it carries.
    """

    file: SweepFile
    movements: tuple[MovementFile, ...]
    arms: tuple[SimulatedArm, ...]
    cell: Cell
    axes: dict[str, _Axis]

    @property
    def n_cases(self) -> int:
        """Cases in all; a search that proposes a setting twice has fewer."""
        search = self.file.search
        spanned = prod(0 if isinstance(axis, Range) else len(axis) for axis in self.axes.values())
        n_settings = search.trials if search else len(self.file.controllers) * spanned
        return len(self.movements) * max(1, len(self.arms)) * n_settings

    def batches(self, results: Callable[[], pl.DataFrame]) -> Iterator[list[Controller]]:
        """The settings to try: a grid in one batch, those of a search in several.

        `results` gives the table of the batch before, when its cases are settled.

        Raises:
            ModuleNotFoundError: a search without optuna (extra `search`).
        """
        bases = [CONTROLLERS[name] for name in self.file.controllers]
        if self.file.search is not None:
            yield from searched(bases, self.axes, self.file.search, results)
        else:
            yield _grid(bases, {k: axis for k, axis in self.axes.items() if not isinstance(axis, Range)})


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
    axes = _read_axes(file.controller or {}, str(path))
    if file.search is None:
        for name, axis in axes.items():
            if isinstance(axis, Range):
                raise SweepError(
                    f"{path}: controller.{name}: a range is searched; give a table [search], or a list"
                )
    elif not axes and len(file.controllers) == 1:
        raise SweepError(f"{path}: search: there is nothing to choose; give fields in a table [controller]")
    arms: Iterable[tuple[str, str, int]] = (
        ()
        if file.robot is not None
        else product(file.robots or ("ur3",), file.fidelities or ("typical",), file.seeds or (0,))
    )
    config = SweepConfig(
        file,
        tuple(_movement(name, path) for name in file.movements),
        tuple(SimulatedArm(*arm) for arm in arms),
        NO_CELL if file.cell is None else load_cell(path.parent / file.cell, FILE_KINDS["cell"]),
        axes,
    )
    if problem := _repeated([movement.name for movement in config.movements]):
        raise SweepError(f"{path}: movements: {problem}")
    if config.n_cases > _MOST_CASES:
        raise SweepError(
            f"{path}: {config.n_cases} cases, at most {_MOST_CASES} are allowed; make the lists shorter"
        )
    return config


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


def _read_axes(table: Mapping[str, Any], source: str) -> dict[str, _Axis]:
    """Check the table [controller] of a file: an axis a field, in the order of the file.

    Raises:
        SweepError: unknown field, or a range or list that makes no sense.
        ControllerError: a value that the field cannot hold.
    """
    for name in table:
        if name not in FIELDS:
            raise SweepError(f"{source}: controller.{name}: no such key; {nearest(name, FIELDS)}")
    return {name: _read_axis(value, name, f"{source}: controller.{name}") for name, value in table.items()}


def _read_axis(value: Any, name: str, where: str) -> _Axis:
    field = FIELDS[name]
    if isinstance(value, dict):
        if field.kind is not float:
            raise SweepError(f"{where}: a range is of numbers; give a list of values")
        axis = checked(Range, value, where, SweepError)
        for end in ("low", "high"):
            checked(field, getattr(axis, end), f"{where}.{end}", ControllerError)
        return axis
    values = value if isinstance(value, list) else [value]
    read = tuple(checked(field, item, where, ControllerError) for item in values)
    if not read:
        raise SweepError(f"{where}: an empty list; give at least one value")
    if problem := _repeated(read):
        raise SweepError(f"{where}: {problem}")
    return read


def _repeated(values: Iterable[object]) -> str:
    """What is wrong with a list that names a value twice; empty when nothing is."""
    twice = next((value for value, n in Counter(values).items() if n > 1), None)
    return "" if twice is None else f"{twice!r} is there twice; name each value once"


def _grid(bases: Sequence[Controller], axes: Mapping[str, tuple[Value, ...]]) -> list[Controller]:
    """All combinations of the values, controller by controller; the last field changes first."""
    return [
        replace(base, **dict(zip(axes, values, strict=True)))  # type: ignore[arg-type]
        for base in bases
        for values in product(*axes.values())
    ]


RANKING = (
    Column("setting", align="left", kind=str),
    Column("mean_snr_db", "mean SNR", "dB", ".2f"),
    Column("gain_margin", "gain margin", format=".2f", narrow="gain\nmargin"),
    Column("max_position_error_mm", "max position error", "mm", ".2f", narrow="max error\n[mm]"),
    Column("n_runs", "runs", kind=int),
    Column("n_refused", "refused cases", kind=int, narrow="refused"),
    Column("n_failed", "failed cases", kind=int, narrow="failed"),
)
"""What is shown of a ranking."""


def _judge(table: pl.DataFrame, by: Sequence[str]) -> pl.DataFrame:
    """What came of each setting, distinguished by some columns of the rows of a sweep.

    Returns:
        These columns and those of `RANKING` but the first, in the order of the table: mean over the runs that
        are done, smallest gain margin of all loops, largest error. `complete` says whether the mean may stand
        beside others.
    """
    done = pl.col("status") == "done"
    judged = table.group_by(by, maintain_order=True).agg(
        pl.col("snr_db").filter(done).mean().alias("mean_snr_db"),
        pl.col("gain_margin").min(),
        pl.col("max_position_error_mm").filter(done).max(),
        done.sum().alias("n_runs"),
        (pl.col("status") == "refused").sum().alias("n_refused"),
        (pl.col("status") == "failed").sum().alias("n_failed"),
    )
    all_done = (pl.col("n_refused") == 0) & (pl.col("n_failed") == 0)
    return judged.with_columns(complete=pl.col("mean_snr_db").is_not_null() & all_done)


def rank_settings(table: pl.DataFrame) -> pl.DataFrame:
    """All settings of the controller as `_judge` has them, the values of each in one phrase as `setting`.

    The best is first, incomplete ones are last; equals are in the order of the table.
    """
    axes = _controller_axes(table) or ["controller"]
    judged = _judge(table, axes)
    names = [", ".join(f"{axis} = {_short(row[axis])}" for axis in axes) for row in judged.to_dicts()]
    return judged.with_columns(setting=pl.Series(names, dtype=pl.String)).sort(
        "complete", "mean_snr_db", descending=True, nulls_last=True, maintain_order=True
    )


def edge_of(table: pl.DataFrame, settings: pl.DataFrame) -> str:
    """Where the best setting lies at the edge of what was tried, in one sentence; empty where it does not.

    The table has the rows of a sweep, the settings are as `rank_settings` returns them.
    """
    best = settings.row(0, named=True)
    ends = []
    for axis in _controller_axes(table) if best["complete"] else ():
        if axis in FIELDS and FIELDS[axis].kind is float:
            tried = table[axis].unique().sort().to_list()
            allowed = FIELDS[axis].schema
            for end, which in ((tried[0], "smallest"), (tried[-1], "largest")):
                if best[axis] == end not in (allowed["ge"], allowed["le"]):
                    ends.append(f"{axis} = {_short(end)} is the {which} of {len(tried)}")
    if not ends:
        return ""
    return f"the best lies at the edge of what was tried ({', '.join(ends)}): a better one may lie beyond"


def varying(table: pl.DataFrame) -> list[str]:
    """The axes of a sweep: columns of `FACTORS` with more than one value, in their order.

    Named controllers differ in many fields; those that follow from the name are no axes of their own.
    """
    axes = [column.name for column in FACTORS if table[column.name].n_unique() > 1]
    if "controller" not in axes:
        return axes
    n_names = table["controller"].n_unique()
    return [
        axis for axis in axes if axis not in FIELDS or table.select("controller", axis).n_unique() > n_names
    ]


def spans_grid(table: pl.DataFrame) -> bool:
    """Whether each value of the controller's fields was tried with each: not so in a search."""
    axes = _controller_axes(table)
    return not axes or table.select(axes).n_unique() == prod(table[axis].n_unique() for axis in axes)


def _controller_axes(table: pl.DataFrame) -> list[str]:
    return [name for name in varying(table) if name in {"controller", *FIELDS}]


def _short(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    return str(value).lower() if isinstance(value, bool) else str(value)


_KEY = ("controller", *FIELDS)
"""The columns that distinguish all settings."""


def searched(
    bases: Sequence[Controller],
    axes: Mapping[str, _Axis],
    search: Search,
    results: Callable[[], pl.DataFrame],
) -> Iterator[list[Controller]]:
    """The settings of a search, batch by batch.

    Nothing of the search itself is stored: with the same results the sampler proposes the same settings. A
    search that was interrupted therefore goes on as if it had not been. `results` gives the table of the
    batch before, when its cases are settled.

    Raises:
        ModuleNotFoundError: optuna is not installed (extra `search`).
    """
    import optuna

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    samplers: dict[str, type[BaseSampler]] = {
        "tpe": optuna.samplers.TPESampler,
        "random": optuna.samplers.RandomSampler,
    }
    study = optuna.create_study(direction="maximize", sampler=samplers[search.sampler](seed=search.seed))  # type: ignore[call-arg]
    named = {base.name: base for base in bases}
    space: dict[str, BaseDistribution] = {"controller": _distribution(tuple(named))}
    space |= {name: _distribution(axis) for name, axis in axes.items()}
    for first in range(0, search.trials, search.batch):
        trials = [study.ask(space) for _ in range(min(search.batch, search.trials - first))]
        settings = []
        for trial in trials:
            values = dict(trial.params)
            settings.append(replace(named[values.pop("controller")], **values))
        yield settings
        judged = _judge(results(), _KEY).rows_by_key(_KEY, named=True, unique=True)
        for trial, setting in zip(trials, settings, strict=True):
            found = judged[(setting.name, *(getattr(setting, name) for name in FIELDS))]
            if found["complete"]:
                study.tell(trial, found["mean_snr_db"])
            else:  # a refused setting is worse than any that ran; a failed one says nothing about itself
                state = optuna.trial.TrialState
                study.tell(trial, state=state.FAIL if found["n_failed"] else state.PRUNED)


def _distribution(axis: _Axis | tuple[str, ...]) -> BaseDistribution:
    from optuna.distributions import CategoricalDistribution, FloatDistribution

    if isinstance(axis, Range):
        return FloatDistribution(axis.low, axis.high, log=axis.log)
    return CategoricalDistribution(axis)
