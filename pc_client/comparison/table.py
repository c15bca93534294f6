"""One table of all generators: how human-like each is as planned, as sampled and filtered, and as executed.

Three forms: `compare.json` for programs, `compare.md` for documents, a rich table for the terminal.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import fmean
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.table import Table as RichTable
from rich.text import Text

from pc_client.analysis.run import MeasuredRun
from pc_client.comparison.filtering import FILTER_TEXT
from pc_client.comparison.likeness import Likeness, mean_likeness, measure_likeness
from pc_client.comparison.movement_set import MovementSet
from pc_client.comparison.signals import (
    PLAN_RATE,
    executed_signal,
    filtered_signal,
    planned_signal,
)
from pc_client.errors import ClientError
from pc_client.movements.movement import Movement
from pc_client.movements.twins import GENERATORS

__all__ = ["COLUMNS", "EXECUTED_COLUMNS", "Comparison", "Row", "build_comparison"]

#: Headings after the generator and the signal.
COLUMNS = (
    "SPARC",
    "LDJ",
    "peaks",
    "beta",
    "R²",
    "speed [m/s]",
    "acc. [m/s²]",
)
#: The two more where the movements were executed.
EXECUTED_COLUMNS = ("SNR [dB]", "best [dB]")


@dataclass(frozen=True, slots=True)
class Row:
    """One movement in its three signals.

    Attributes:
        kind: the generator's name.
        movement: the movement's name.
        duration: s.
        planned: the closed form at 1 kHz.
        filtered: the plan at the rate of the control cycle, through the filter.
        executed: the recording through the same filter; None where nothing was executed.
        snr_db: Eq. 10 of the run, as in Table I: neither filtered nor shifted; None likewise.
        shifted_snr_db: the same after the best time shift.
    """

    kind: str
    movement: str
    duration: float
    planned: Likeness
    filtered: Likeness
    executed: Likeness | None
    snr_db: float | None
    shifted_snr_db: float | None


@dataclass(frozen=True, slots=True)
class Comparison:
    """All rows, and what they have in common.

    Attributes:
        rows: one for each movement.
        n_strokes: of each movement.
        rate: of the control cycle, Hz.
        robot: e.g. "SIMULATED UR3 3.15.8, seed 7, controller preview"; None where nothing was executed.
    """

    rows: tuple[Row, ...]
    n_strokes: int
    rate: float
    robot: str | None

    @property
    def kinds(self) -> list[str]:
        """The generators, in order."""
        return list(dict.fromkeys(row.kind for row in self.rows))

    @property
    def title(self) -> str:
        """One line that says what was compared."""
        n_sets = len(self.rows) // len(self.kinds)
        sets = f", means over {n_sets} sets of target points" if n_sets > 1 else ""
        executed = self.robot or "planned only"
        return (
            f"Human-likeness of {len(self.kinds)} generators, {self.n_strokes} strokes each{sets}: {executed}"
        )

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

    def rows_of(self, kind: str) -> list[Row]:
        """The rows of one generator."""
        return [row for row in self.rows if row.kind == kind]

    def means(self, kind: str) -> dict[str, Likeness]:
        """The mean of each figure by signal: "planned", "filtered" and, where it was, "executed"."""
        rows = self.rows_of(kind)
        executed = [row.executed for row in rows if row.executed is not None]
        means = {
            "planned": mean_likeness([row.planned for row in rows]),
            "filtered": mean_likeness([row.filtered for row in rows]),
        }
        return {**means, "executed": mean_likeness(executed)} if executed else means

    def snr_db(self, kind: str) -> tuple[float, float] | None:
        """Mean of Eq. 10, raw and after the best shift, or None where nothing was executed."""
        rows = self.rows_of(kind)
        raw = [row.snr_db for row in rows if row.snr_db is not None]
        shifted = [row.shifted_snr_db for row in rows if row.shifted_snr_db is not None]
        return (fmean(raw), fmean(shifted)) if raw and shifted else None

    def to_json(self) -> dict[str, Any]:
        """Return the content of `compare.json`; figures that are not finite become null."""
        return {
            "robot": self.robot,
            "rate_hz": self.rate,
            "n_strokes": self.n_strokes,
            "filter": FILTER_TEXT,
            "rows": [_finite(asdict(row)) for row in self.rows],
            "means": {
                kind: _finite(
                    {
                        **{signal: asdict(figures) for signal, figures in self.means(kind).items()},
                        "snr_db": snr[0] if (snr := self.snr_db(kind)) else None,
                        "shifted_snr_db": snr[1] if snr else None,
                    }
                )
                for kind in self.kinds
            },
        }

    def to_markdown(self) -> str:
        """Return the content of `compare.md`."""
        head = self._head()
        lines = [
            f"# {self.title}",
            "",
            "| " + " | ".join(head) + " |",
            "|" + "|".join(["---"] * 2 + ["---:"] * (len(head) - 2)) + "|",
            *["| " + " | ".join(cells) + " |" for cells in self._cells()],
            "",
        ]
        for note in self.notes:
            lines += [note, ""]
        lines += [f"* `{kind}`: {GENERATORS[kind].says}" for kind in self.kinds]
        return "\n".join(lines) + "\n"

    def to_rich(self) -> RichTable:
        """Return the table for the terminal."""
        table = RichTable(title=self.title, caption="\n".join(self.notes), box=SIMPLE_HEAD, padding=0)
        for i, column in enumerate(self._head()):
            heading = Text(column.replace(" [", "\n["))
            table.add_column(heading, justify="left" if i < 2 else "right", no_wrap=True)
        cells = self._cells()
        for i, row in enumerate(cells):
            table.add_row(*row, end_section=i + 1 < len(cells) and bool(cells[i + 1][0]))
        return table

    def _head(self) -> list[str]:
        return ["generator", "signal", *COLUMNS, *(EXECUTED_COLUMNS if self.robot else ())]

    def _cells(self) -> list[list[str]]:
        """One line for each generator and signal; the generator's name stands in the first of its lines."""
        lines = []
        for kind in self.kinds:
            for i, (signal, figures) in enumerate(self.means(kind).items()):
                snr = self.snr_db(kind) if signal == "executed" else None
                lines.append(
                    [
                        kind if i == 0 else "",
                        signal,
                        f"{figures.sparc:.2f}",
                        f"{figures.log_jerk:.2f}",
                        f"{figures.peaks:.3g}",
                        _or_dash(figures.exponent, ".3f"),
                        _or_dash(figures.r_squared, ".2f"),
                        f"{figures.peak_speed:.3f}",
                        f"{figures.peak_acceleration:.2f}",
                        *([f"{value:.1f}" for value in snr] if snr else [""] * (len(self._head()) - 9)),
                    ]
                )
        return lines


def build_comparison(
    sets: Sequence[MovementSet], runs: Mapping[str, MeasuredRun] | None = None, *, rate: float = 125.0
) -> Comparison:
    """Measure all movements.

    Args:
        sets: what was planned.
        runs: the recordings by the movement's name; None where nothing was executed.
        rate: of the control cycle, Hz, where nothing was executed.

    Raises:
        ClientError: a movement has no recording although others have.
    """
    if runs:
        provenance = next(iter(runs.values())).provenance
        rate = 1.0 / provenance.cycle_time_s
        robot: str | None = f"{provenance.arm}, controller {provenance.controller}"
    else:
        robot = None
    rows = tuple(_row(kind, movement, runs, rate) for one in sets for kind, movement in one.movements.items())
    n_strokes = len(next(iter(sets[0].movements.values())).target_points) - 1
    return Comparison(rows, n_strokes, rate, robot)


def _row(kind: str, movement: Movement, runs: Mapping[str, MeasuredRun] | None, rate: float) -> Row:
    run = None
    if runs:
        run = runs.get(movement.name)
        if run is None:
            raise ClientError(f"there is no recording of {movement.name}; run the comparison again")
    planned, filtered = planned_signal(movement), filtered_signal(movement, rate)
    executed = None if run is None else executed_signal(run, movement.duration)
    return Row(
        kind,
        movement.name,
        movement.duration,
        measure_likeness(planned.motion, planned.rate),
        measure_likeness(filtered.motion, filtered.rate),
        None if executed is None else measure_likeness(executed.motion, executed.rate),
        None if run is None else run.snr.speed_db,
        None if run is None else run.snr.speed_shifted_db,
    )


def _or_dash(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "–"


def _finite(values: Any) -> Any:
    """The same nested data with numbers rounded, and None for those that JSON does not know."""
    if isinstance(values, dict):
        return {key: _finite(value) for key, value in values.items()}
    if isinstance(values, float):
        return round(values, 6) if math.isfinite(values) else None
    return values
