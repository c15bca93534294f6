"""Groups of runs: the mean of a figure over each group, and the differences of all pairs of groups."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from pathlib import Path
from typing import Any, TypeAlias

import polars as pl

from pc_client.analysis.inference import mean_interval, paired_difference
from pc_client.analysis.run import MeasuredRun, analyse_run
from pc_client.analysis.signals import Run
from pc_client.errors import ClientError
from pc_client.recording.recording import load_recording
from pc_client.results.tables import Column, cells, frame_of, to_csv

_RunLike: TypeAlias = Run | MeasuredRun | Path | str
"""A run, the file of one, or a folder of files."""

COLUMNS = (
    *(Column(name, align="left", kind=str) for name in ("group", "minus", "unit")),
    Column("n", kind=int),
    *(Column(name, format=".2f", missing="–") for name in ("mean", "spread", "low", "high")),
    Column("p", format=".2g", missing="–"),
)
"""Of the frame of `Groups`."""

_UNITS = ("movement", "target points", "arm")
"""What a unit may be; of equally many the first counts."""


@dataclass(frozen=True, slots=True, eq=False)
class Groups:
    """Groups of runs, compared by one figure.

    Attributes:
        figure: its name.
        frame: a row for each group: the mean over its n units, their standard deviation (`spread`), and the
            ends of the mean's 95 % interval (`low`, `high`). Then one for each pair of groups, less the
            second (`minus`): the same of the n paired differences, and `p`. Null where units are too few.
    """

    figure: str
    frame: pl.DataFrame

    def to_csv(self) -> str:
        """All values of the frame."""
        return to_csv(self.frame)

    def to_latex(self) -> str:
        """A tabular with the rules of the package booktabs, rounded."""
        lines = [[column.name for column in COLUMNS], *cells(self.frame, COLUMNS)]
        escapes = str.maketrans({"\\": r"\textbackslash{}"} | {sign: f"\\{sign}" for sign in "&%$#_{}"})
        head, *rows = [" & ".join(cell.translate(escapes) for cell in line) + r" \\" for line in lines]
        align = "".join(column.align[0] for column in COLUMNS)
        body = [r"\toprule", head, r"\midrule", *rows, r"\bottomrule"]
        return "\n".join([rf"\begin{{tabular}}{{{align}}}", *body, r"\end{tabular}", ""])


def compare(
    runs: Mapping[str, _RunLike | Sequence[_RunLike]] | Sequence[_RunLike], figure: str = "snr_db"
) -> Groups:
    """Compare groups of runs by a figure: mean, spread, interval, and paired differences.

    A unit is a movement or, where there are more of them, an arm (a seed); repetitions are averaged. Groups
    of different kinds are paired by the target points that their movements share.

    Args:
        runs: by the label of their group; or all in one, then grouped by what differs: controller, kind and
            robot, or else the serial number.
        figure: a column of numbers of `MeasuredRun.figures`: `snr_db`, `lag_ms`, `max_path_error_mm` ...

    Raises:
        ClientError: no runs, no such figure, or a file cannot be read.
    """
    if isinstance(runs, Mapping):
        groups = {label: [*_measured(given)] for label, given in runs.items()}
    else:
        groups = _by_what_differs([*_measured(runs)])
    if not groups or not all(groups.values()):
        raise ClientError("there is no run to compare; give at least one for each group")
    first = next(iter(groups.values()))[0].figures
    numbers = [name for name, value in first.items() if isinstance(value, float)]
    if figure not in numbers:
        raise ClientError(f'figure "{figure}" is none of {", ".join(numbers)}')
    units = {label: _units_of(group, figure) for label, group in groups.items()}
    rows = [_of_group(*one) for one in units.items()]
    rows += [_of_pair(*one, *other) for one, other in combinations(units.items(), 2)]
    return Groups(figure, frame_of(rows, COLUMNS).with_columns(pl.col(pl.Float64).fill_nan(None)))


def _measured(given: _RunLike | Sequence[_RunLike]) -> Iterator[MeasuredRun]:
    for one in [given] if isinstance(given, _RunLike) else given:
        if isinstance(one, Run | MeasuredRun):
            yield one.measured if isinstance(one, Run) else one
        else:
            path = Path(one)
            for file in sorted(path.glob("*.mcap")) if path.is_dir() else [path]:
                yield analyse_run(load_recording(file))


def _by_what_differs(runs: Sequence[MeasuredRun]) -> dict[str, list[MeasuredRun]]:
    owners = [run.provenance for run in runs]
    all_facts = [(p.controller, p.kind, p.robot) for p in owners]
    if len(set(all_facts)) == 1:
        all_facts = [(p.controller, p.kind, p.serial) for p in owners]
    differ = [len(set(column)) > 1 for column in zip(*all_facts, strict=True)]
    groups: dict[str, list[MeasuredRun]] = {}
    for run, facts in zip(runs, all_facts, strict=True):
        label = ", ".join(fact for fact, differs in zip(facts, differ, strict=True) if differs)
        groups.setdefault(label or run.provenance.controller, []).append(run)
    return groups


def _units_of(runs: Sequence[MeasuredRun], figure: str) -> pl.DataFrame:
    """A row for each movement on each arm: what its unit may be, and the mean of the figure (`value`)."""
    rows = [
        (p.movement, str(p.target_points or "") or None, f"{p.robot} {p.serial}", run.figures[figure])
        for run in runs
        for p in [run.provenance]
    ]
    return _means(pl.DataFrame(rows, [*_UNITS, "value"], orient="row"), *_UNITS)


def _means(frame: pl.DataFrame, *units: str) -> pl.DataFrame:
    return frame.group_by(units, maintain_order=True).agg(pl.col("value").mean())


def _of_group(label: str, frame: pl.DataFrame) -> dict[str, Any]:
    unit = max(_UNITS, key=lambda name: frame[name].n_unique())
    values = _means(frame, unit)["value"]
    return {"group": label, "unit": unit, "n": len(values), **asdict(mean_interval(values))}


def _of_pair(label: str, frame: pl.DataFrame, minus: str, other: pl.DataFrame) -> dict[str, Any]:
    pairs = {u: _means(frame, u).join(_means(other, u), on=u, maintain_order="left") for u in _UNITS}
    unit = max(_UNITS, key=lambda name: len(pairs[name]))
    _, a, b = pairs[unit]
    difference = asdict(paired_difference(a, b)) if len(a) else {}
    return {"group": label, "minus": minus, "unit": unit, "n": len(a), **difference}
