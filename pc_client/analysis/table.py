"""Table I: the signal-to-noise ratio of every movement, ours beside the paper's.

One table, three forms: `table1.json` for programs, `table1.md` for documents, a rich table for the terminal.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from statistics import fmean
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.table import Table as RichTable
from rich.text import Text

from pc_client.analysis.noise_floor import floor_db, step_covariance, unrepeatable_power
from pc_client.analysis.run import MeasuredRun
from pc_client.errors import RecordingError
from pc_client.recording.provenance import Provenance

# Source: A. Wolniakowski et al., "Towards human-like kinematics in industrial robotic arms: a case study on a
# UR3 robot", Table I, in its order. One figure a movement, over three repetitions on a real UR3.
PAPER_SNR_DB = {
    "uniform_4_1": 19.02,
    "uniform_4_2": 17.58,
    "uniform_5_1": 21.44,
    "uniform_5_2": 18.92,
    "uniform_5_3": 19.75,
    "lognorm_4_1": 29.90,
    "lognorm_4_2": 15.96,
    "lognorm_5_1": 26.50,
    "lognorm_5_2": 16.56,
    "lognorm_5_3": 21.88,
}
KINDS = ("uniform", "lognormal")

SHARED = "Paper: own points, not published; name, kind, number of targets agree"
"""Why no differences are given."""


@dataclass(frozen=True, slots=True)
class Row:
    """One movement: one figure a repetition, in the order of the repetitions.

    Attributes:
        name: of the movement.
        kind: of the movement.
        runs: its repetitions.
        noise_floor_db: SNR that the noise of the arm's encoders alone would leave (`noise_floor`).
    """

    name: str
    kind: str
    runs: tuple[MeasuredRun, ...]
    noise_floor_db: float | None = None

    @property
    def snr_db(self) -> list[float]:
        """Eq. 10 of each repetition, dB."""
        return [run.snr.speed_db for run in self.runs]

    @property
    def mean_snr_db(self) -> float:
        """Mean of Eq. 10 over the repetitions, dB."""
        return fmean(self.snr_db)

    @property
    def paper_snr_db(self) -> float | None:
        """The paper's figure, or None when the paper did not run this movement."""
        return PAPER_SNR_DB.get(self.name)

    @property
    def unrepeatable_db(self) -> float | None:
        """SNR that what does not repeat from run to run would leave; None when it is not known."""
        power = unrepeatable_power(self.runs)
        return 10.0 * math.log10(self.runs[0].budget.signal_power / power) if power else None

    @property
    def max_position_error_mm(self) -> float:
        """Largest TCP position error of all repetitions."""
        return max(run.errors.max_position_error_mm for run in self.runs)

    @property
    def lag_ms(self) -> float:
        """Mean of the best time shift of the scalar speed over the repetitions."""
        return 1e3 * fmean(run.snr.speed_lag_s for run in self.runs)


@dataclass(frozen=True, slots=True)
class Table:
    """The rows of one experiment, in the paper's order, and what they have in common."""

    controller: str
    robot: str
    seed: int | None
    pace: str
    simulated: bool | None
    rows: tuple[Row, ...]

    def rows_of(self, kind: str) -> list[Row]:
        """Return the rows of one kind of movement."""
        return [row for row in self.rows if row.kind == kind]

    def mean_of(self, kind: str) -> float | None:
        """Return the mean of the rows' means of one kind, dB; None without such rows."""
        rows = self.rows_of(kind)
        return fmean(row.mean_snr_db for row in rows) if rows else None

    def paper_mean_of(self, kind: str) -> float | None:
        """Return the mean of the paper's figures for the rows of one kind, dB; None without any."""
        figures = [row.paper_snr_db for row in self.rows_of(kind) if row.paper_snr_db is not None]
        return fmean(figures) if figures else None

    def to_json(self) -> dict[str, Any]:
        """Return the content of `table1.json`; figures that are not finite become null."""
        rows = [
            {
                "name": row.name,
                "kind": row.kind,
                "snr_db": [_number(v) for v in row.snr_db],
                "mean_snr_db": _number(row.mean_snr_db),
                "paper_snr_db": row.paper_snr_db,
                "max_position_error_mm": _number(row.max_position_error_mm),
                "lag_ms": _number(row.lag_ms),
                "shifted_snr_db": [_number(run.snr.speed_shifted_db) for run in row.runs],
                "vector_snr_db": [_number(run.snr.velocity_db) for run in row.runs],
                "shifted_vector_snr_db": [_number(run.snr.velocity_shifted_db) for run in row.runs],
                "rms_position_error_mm": [_number(run.errors.rms_position_error_mm) for run in row.runs],
                "max_path_error_mm": [_number(run.errors.max_path_error_mm) for run in row.runs],
                "noise_floor_db": None if row.noise_floor_db is None else _number(row.noise_floor_db),
                "unrepeatable_db": None if row.unrepeatable_db is None else _number(row.unrepeatable_db),
            }
            for row in self.rows
        ]
        means = {kind: self.mean_of(kind) for kind in KINDS}
        return {
            "controller": self.controller,
            "robot": self.robot,
            "seed": self.seed,
            "pace": self.pace,
            "simulated": self.simulated,
            "rows": rows,
            "mean_snr_db": {kind: None if mean is None else _number(mean) for kind, mean in means.items()},
            "paper_mean_snr_db": {kind: self.paper_mean_of(kind) for kind in KINDS},
            "loop": {k: _number(v) if isinstance(v, float) else v for k, v in self.loop.items()},
        }

    def to_markdown(self) -> str:
        """Return the content of `table1.md`."""
        columns, rows = self._cells()
        shared = ["", SHARED] if self.has_paper_rows else []
        lines = [
            f"# {self.title}",
            "",
            "SNR of the TCP speed as in Eq. 10 of the paper, in dB: unshifted, unsmoothed.",
            "",
            "| " + " | ".join(columns) + " |",
            "|" + "|".join(["---", *["---:"] * (len(columns) - 1)]) + "|",
            *["| " + " | ".join(row) + " |" for row in rows],
            "",
            "floor: SNR that the noise of the arm's encoders at rest alone would leave a perfect arm.",
            *shared,
        ]
        return "\n".join(lines) + "\n"

    def to_rich(self) -> RichTable:
        """Return the table for the terminal."""
        columns, rows = self._cells()
        caption = "SNR of the TCP speed, Eq. 10, in dB: unshifted, unsmoothed"
        caption += f"\n{SHARED}" if self.has_paper_rows else ""
        table = RichTable(title=self.title, caption=caption, box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
        for i, column in enumerate(columns):
            heading = Text(column.replace(" [", "\n["))
            table.add_column(heading, justify="left" if i == 0 else "right", no_wrap=True)
        for i, row in enumerate(rows):
            is_mean = row[0].startswith("mean")
            table.add_row(*row, style="bold" if is_mean else None, end_section=is_mean and i < len(rows) - 1)
        return table

    @property
    def provenance(self) -> Provenance:
        """Where the first run comes from; arm and controller are the same for all."""
        return self.rows[0].runs[0].provenance

    @property
    def has_paper_rows(self) -> bool:
        """Whether a movement has the name of one in the paper's Table I."""
        return any(row.paper_snr_db is not None for row in self.rows)

    @property
    def loop(self) -> Mapping[str, float | str]:
        """What the client identified of the loop and its margins; empty for old recordings."""
        return self.provenance.loop

    @property
    def title(self) -> str:
        """One line that says what the table shows, and whether the arm was a real one."""
        return f"Table I: {self.provenance.arm}, controller {self.controller}"

    def _cells(self) -> tuple[list[str], list[list[str]]]:
        """Return headings and texts; the mean of a kind follows its rows."""
        n_runs = max((len(row.runs) for row in self.rows), default=0)
        repetitions = [f"r{k}" for k in range(1, n_runs + 1)]
        paper = ["paper"] if self.has_paper_rows else []
        columns = ["movement", *repetitions, "mean", *paper, "floor", "error [mm]", "lag [ms]"]
        rows = []
        for kind, group in groupby(self.rows, key=lambda row: row.kind):
            for row in group:
                figures = [f"{v:.2f}" for v in row.snr_db] + [""] * (n_runs - len(row.runs))
                levels = (row.mean_snr_db, *[row.paper_snr_db for _ in paper], row.noise_floor_db)
                errors = [f"{row.max_position_error_mm:.2f}", f"{row.lag_ms:.1f}"]
                rows.append([row.name, *figures, *map(_decibels, levels), *errors])
            means = (self.mean_of(kind), *[self.paper_mean_of(kind) for _ in paper])
            rows.append([f"mean {kind}", *[""] * n_runs, *map(_decibels, means), "", "", ""])
        return columns, rows


def build_table(runs: Sequence[MeasuredRun]) -> Table:
    """Build the table of one experiment.

    Args:
        runs: at least one run; all of the same robot, seed, pace and controller.

    Raises:
        RecordingError: no runs, or runs of different experiments.
    """
    if not runs:
        raise RecordingError("there is no run to put into a table; record at least one movement")
    first = runs[0].provenance
    common = (first.controller, first.robot, first.seed, first.pace, first.simulated)
    for run in runs:
        p = run.provenance
        if (p.controller, p.robot, p.seed, p.pace, p.simulated) != common:
            raise RecordingError(
                f"{run.recording.path.name} is of another experiment than {runs[0].recording.path.name} "
                "(robot, seed, pace or controller differ); keep one experiment a folder"
            )
    ordered = sorted(runs, key=lambda run: (*_rank(run), run.provenance.repetition))
    # The encoders are the same in all runs; the more of them are at rest, the better their noise is known.
    covariance = step_covariance(runs)
    rows = [
        Row(name, group[0].provenance.kind, group, floor_db(group[0], covariance))
        for name, group in ((n, tuple(g)) for n, g in groupby(ordered, key=lambda r: r.provenance.movement))
    ]
    return Table(*common, rows=tuple(rows))


def _rank(run: MeasuredRun) -> tuple[int, str, int, str]:
    """Order of rows: kinds as in the paper, the paper's movements in its order, then others by name."""
    name, kind = run.provenance.movement, run.provenance.kind
    paper = list(PAPER_SNR_DB)
    return (
        KINDS.index(kind) if kind in KINDS else len(KINDS),
        kind,
        paper.index(name) if name in PAPER_SNR_DB else len(paper),
        name,
    )


def _decibels(value: float | None) -> str:
    """Return a cell; empty where there is no figure."""
    return "" if value is None else f"{value:.2f}"


def _number(value: float) -> float | None:
    """Round to what is worth writing down; JSON knows no infinity."""
    return round(value, 6) if math.isfinite(value) else None
