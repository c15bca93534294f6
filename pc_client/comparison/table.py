"""One table of all generators: how human-like each is as planned, as sampled and filtered, and as executed.

One frame, a row for each signal of each movement, in three forms: `compare.json`, `compare.md` and a table
for the terminal.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import TYPE_CHECKING, Any

import polars as pl

from pc_client.analysis.run import MeasuredRun
from pc_client.comparison.movement_set import MovementSet
from pc_client.comparison.signals import (
    FILTER_TEXT,
    PLAN_RATE,
    Likeness,
    executed_signal,
    filtered_signal,
    measure_likeness,
    planned_signal,
    sampling_rate,
)
from pc_client.errors import ClientError
from pc_client.movements.movement import Movement
from pc_client.movements.twins import GENERATORS
from pc_client.results.tables import Column, finite, to_markdown, to_rich

if TYPE_CHECKING:
    from rich.table import Table as RichTable

__all__ = ["COLUMNS", "EXECUTED_COLUMNS", "Comparison", "build_comparison"]

COLUMNS = (
    Column("generator", align="left"),
    Column("signal", align="left"),
    Column("sparc", "SPARC", format=".2f"),
    Column("log_jerk", "LDJ", format=".2f"),
    Column("peaks", format=".3g"),
    Column("exponent", "beta", format=".3f"),
    Column("r_squared", "R²", format=".2f"),
    Column("peak_speed", "speed", "m/s", ".3f"),
    Column("peak_acceleration", "acc.", "m/s²", ".2f"),
)
EXECUTED_COLUMNS = (Column("snr_db", "SNR", "dB", ".1f"), Column("shifted_snr_db", "best", "dB", ".1f"))
"""The two more where the movements were executed."""

_SIGNALS = ("planned", "filtered", "executed")
_LIKENESS = [field.name for field in fields(Likeness)]
_LEVELS = [column.name for column in EXECUTED_COLUMNS]


@dataclass(frozen=True, slots=True)
class Comparison:
    """All figures, and what they have in common.

    Attributes:
        frame: a row for each signal of each movement ("planned", "filtered" and, where it was, "executed"):
            generator, movement, duration [s], signal, the figures of `Likeness` (nan where there is nothing
            to fit) and of executed ones the SNR of Eq. 10, raw and after the best time shift.
        n_strokes: of each movement.
        rate: of the control cycle, Hz.
        robot: e.g. "SIMULATED UR3 3.15.8, seed 7, controller preview"; None where nothing was executed.
    """

    frame: pl.DataFrame
    n_strokes: int
    rate: float
    robot: str | None

    @property
    def generators(self) -> list[str]:
        """Their names, in order."""
        return self.frame["generator"].unique(maintain_order=True).to_list()

    @property
    def title(self) -> str:
        """One line that says what was compared."""
        n = len(self.generators)
        n_sets = self.frame["movement"].n_unique() // n
        sets = f", means over {n_sets} sets of target points" if n_sets > 1 else ""
        executed = self.robot or "planned only"
        return f"Human-likeness of {n} generators, {self.n_strokes} strokes each{sets}: {executed}"

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader must know of the columns."""
        return (
            f"planned: closed form at {PLAN_RATE:g} Hz. filtered, executed: positions at {self.rate:g} Hz, "
            f"{FILTER_TEXT}, then differentiated.",
            "SPARC and LDJ: nearer to 0 is smoother; compare LDJ only within one of the three signals. "
            "beta: the exponent of speed = k curvature^-beta, from the first to the last peak of the speed; "
            "1/3 for drawing hands, where R² is high. A dash: straight lines, or one peak only.",
            *(("SNR: Eq. 10 on the raw TCP speed; best: after the best time shift.",) if self.robot else ()),
        )

    @property
    def means(self) -> pl.DataFrame:
        """A row for each generator and signal: means over the movements that have the figure."""
        likeness = pl.col(_LIKENESS)
        grouped = self.frame.group_by("generator", "signal", maintain_order=True)
        return grouped.agg(
            likeness.filter(likeness.is_finite()).mean().fill_null(math.nan), pl.col(_LEVELS).mean()
        )

    def to_json(self) -> dict[str, Any]:
        """Return the content of `compare.json`; figures that are not finite become null."""
        rows = self.frame.partition_by("generator", "movement", maintain_order=True)
        means = self.means.partition_by("generator", maintain_order=True)
        return {
            "robot": self.robot,
            "rate_hz": self.rate,
            "n_strokes": self.n_strokes,
            "filter": FILTER_TEXT,
            "rows": finite(
                [
                    {"kind": row["generator"][0], "movement": row["movement"][0]}
                    | {"duration": row["duration"][0]}
                    | dict.fromkeys(_SIGNALS)
                    | _by_signal(row)
                    for row in rows
                ],
                6,
            ),
            "means": finite({mean["generator"][0]: _by_signal(mean) for mean in means}, 6),
        }

    def to_markdown(self) -> str:
        """Return the content of `compare.md`."""
        lines = [f"# {self.title}", "", to_markdown(*self._shown()), ""]
        for note in self.notes:
            lines += [note, ""]
        lines += [f"* `{name}`: {GENERATORS[name].says}" for name in self.generators]
        return "\n".join(lines) + "\n"

    def to_rich(self) -> RichTable:
        """Return the table for the terminal."""
        caption = "\n".join(self.notes)
        return to_rich(*self._shown(), section="section", padding=0, title=self.title, caption=caption)

    def _shown(self) -> tuple[pl.DataFrame, tuple[Column, ...]]:
        """The means as people read them: a generator's name stands in the first of its lines."""
        name = pl.col("generator")
        frame = self.means.with_columns(section=name, generator=pl.when(name.is_first_distinct()).then(name))
        return frame, (*COLUMNS, *(EXECUTED_COLUMNS if self.robot else ()))


def build_comparison(
    sets: Sequence[MovementSet], runs: Mapping[str, MeasuredRun] | None = None, *, rate: float = 125.0
) -> Comparison:
    """Measure all movements.

    Args:
        sets: what was planned.
        runs: the recordings by the movement's name; None where nothing was executed.
        rate: of the samples, Hz, where nothing was executed.

    Raises:
        ClientError: a movement has no recording although others have.
    """
    if runs:
        run = next(iter(runs.values()))
        rate = sampling_rate(run)
        robot: str | None = f"{run.provenance.arm}, controller {run.provenance.controller}"
    else:
        robot = None
    rows = [
        row
        for one in sets
        for generator, movement in one.items()
        for row in _rows(generator, movement, runs, rate)
    ]
    n_strokes = len(next(iter(sets[0].values())).target_points) - 1
    return Comparison(pl.DataFrame(rows, infer_schema_length=None), n_strokes, rate, robot)


def _rows(
    generator: str, movement: Movement, runs: Mapping[str, MeasuredRun] | None, rate: float
) -> Iterator[dict[str, Any]]:
    """One row for each signal of a movement."""
    signals = {"planned": planned_signal(movement), "filtered": filtered_signal(movement, rate)}
    run = None
    if runs:
        run = runs.get(movement.name)
        if run is None:
            raise ClientError(f"there is no recording of {movement.name}; run the comparison again")
        signals["executed"] = executed_signal(run, movement.duration)
    for name, signal in signals.items():
        levels = (run.snr.speed_db, run.snr.speed_shifted_db) if run and name == "executed" else (None, None)
        yield {
            "generator": generator,
            "movement": movement.name,
            "duration": movement.duration,
            "signal": name,
            **asdict(measure_likeness(signal.motion, signal.rate)),
            **dict(zip(_LEVELS, levels, strict=True)),
        }


def _by_signal(rows: pl.DataFrame) -> dict[str, Any]:
    """The figures of one movement or generator, by signal; the levels are those of the last, if executed."""
    figures = {row["signal"]: {name: row[name] for name in _LIKENESS} for row in rows.to_dicts()}
    return figures | {name: rows[name][-1] for name in _LEVELS}
