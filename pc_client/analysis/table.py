"""Table I: the signal-to-noise ratio of every movement, ours beside the paper's; several experiments.

One frame, a row a movement, in three forms: `table1.json`, `table1.md` and a table for the terminal.

Several experiments stand in one table: the paper's real arm, the published controller, ours. A controller
whose numbers were changed gets no column of its own where the unchanged one has run on the same arm: it is a
row of the table that shows how the means move with these numbers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from statistics import fmean
from typing import TYPE_CHECKING, Any

import polars as pl
from scipy import stats

from pc_client.analysis.groups import compare
from pc_client.analysis.measures import decibels
from pc_client.analysis.noise_floor import step_covariance, unrepeatable_power
from pc_client.analysis.run import GIVEN_UP, MeasuredRun
from pc_client.errors import RecordingError
from pc_client.recording.provenance import Provenance
from pc_client.results.tables import Column, finite, to_markdown, to_rich

if TYPE_CHECKING:
    from rich.table import Table as RichTable

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

_SHARED = "Paper: own points, not published; name, kind, number of targets agree"
"""Why no differences are given."""

PUBLISHED = "paper"
"""Name of the controller with the published control law."""

MOVEMENT = Column("name", "movement", align="left")
LEVEL, PAPER = Column("mean_snr_db", "mean", format=".2f"), Column("paper_snr_db", "paper", format=".2f")
FLOOR = Column("noise_floor_db", "floor", format=".2f")
ERROR, LAG = Column("max_position_error_mm", "error", "mm", ".2f"), Column("lag_ms", "lag", "ms", ".1f")

_FIGURES = (
    pl.col("kind", "n_targets").first(),
    pl.col("snr_db"),
    pl.col("snr_db").mean().alias("mean_snr_db"),
    pl.col("name").first().replace_strict(PAPER_SNR_DB, default=None).alias("paper_snr_db"),
    pl.col("max_position_error_mm").max(),
    pl.col("lag_ms").mean(),
    pl.col("snr_shifted_db").alias("shifted_snr_db"),
    pl.col("vector_snr_db"),
    pl.col("vector_snr_shifted_db").alias("shifted_vector_snr_db"),
    pl.col("rms_position_error_mm"),
    pl.col("max_path_error_mm"),
)
"""What is made of the runs of one movement: one figure, or a list with one of each run."""


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """The movements of one experiment, in the paper's order.

    Attributes:
        frame: a row a movement, as in `table1.json`, and the number of its target points.
        runs: by name of the movement, in the order of the repetitions.
    """

    frame: pl.DataFrame
    runs: Mapping[str, tuple[MeasuredRun, ...]]

    @property
    def means(self) -> pl.DataFrame:
        """A row a movement: the mean of each of `MeasuredRun.figures` over its runs."""
        return _frame_of_runs(self.all_runs).group_by("name", "kind", maintain_order=True).mean()

    @property
    def all_runs(self) -> list[MeasuredRun]:
        """Movement by movement."""
        return [run for runs in self.runs.values() for run in runs]

    @property
    def kinds(self) -> list[str]:
        """The kinds of movement, in their order."""
        return self.frame["kind"].unique(maintain_order=True).to_list()

    def mean_of(self, kind: str, figure: str = "mean_snr_db") -> float | None:
        """The mean of a figure over the movements of one kind; None where no movement has it."""
        return mean_by_kind(self.frame, figure).get(kind)

    def to_json(self) -> dict[str, Any]:
        """Return the content of `table1.json`; figures that are not finite become null."""
        p = self.provenance
        return {
            "controller": p.controller,
            "robot": p.robot,
            "seed": p.seed,
            "pace": p.pace,
            "simulated": p.simulated,
            "rows": finite(self.frame.drop("n_targets").to_dicts(), 6),
            "mean_snr_db": finite({kind: self.mean_of(kind) for kind in KINDS}, 6),
            "paper_mean_snr_db": {kind: self.mean_of(kind, PAPER.name) for kind in KINDS},
            "loop": finite(dict(p.loop), 6),
        }

    def to_markdown(self) -> str:
        """Return the content of `table1.md`."""
        notes = ["SNR of the TCP speed as in Eq. 10 of the paper, in dB: unshifted, unsmoothed."]
        floor = "floor: SNR that the noise of the arm's encoders at rest alone would leave a perfect arm."
        after = [floor] * self.has_floor + [_SHARED] * self.has_paper_rows
        return "\n\n".join([f"# {self.title}", *notes, to_markdown(*self.shown()), *after]) + "\n"

    def to_rich(self) -> RichTable:
        """Return the table for the terminal."""
        caption = "SNR of the TCP speed, Eq. 10, in dB: unshifted, unsmoothed"
        caption += f"\n{_SHARED}" if self.has_paper_rows else ""
        return to_rich(*self.shown(), bold="is_mean", section="kind", title=self.title, caption=caption)

    @property
    def provenance(self) -> Provenance:
        """Where the first run comes from; arm and controller are the same for all."""
        return self.all_runs[0].provenance

    @property
    def label(self) -> str:
        """What its column beside others is called."""
        controller = self.provenance.controller
        return "published controller" if controller == PUBLISHED else controller

    @property
    def base(self) -> tuple[str, str]:
        """The arm, and the name of the controller that the numbers of this one started from."""
        p = self.provenance
        return f"{p.arm} {p.serial} {p.pace}", str(p.controller_config.get("name", p.controller))

    def duration_in(self, other: Table) -> float | None:
        """The duration of the movements as a share of those through the same points of another table.

        None where the movements are others, or have no target points.
        """
        ours, theirs = (
            {(run.provenance.kind, run.provenance.target_points): run.errors.duration_s for run in t.all_runs}
            for t in (self, other)
        )
        if ours.keys() != theirs.keys() or not all(points for _, points in ours):
            return None
        return round(sum(ours.values()) / sum(theirs.values()), 2)

    @property
    def has_paper_rows(self) -> bool:
        """Whether a movement has the name of one in the paper's Table I."""
        return not PAPER_SNR_DB.keys().isdisjoint(self.runs)

    @property
    def has_floor(self) -> bool:
        """Whether the noise floor of a movement is known."""
        return not self.frame["noise_floor_db"].is_null().all()

    @property
    def title(self) -> str:
        """One line that says what the table shows, and whether the arm was a real one."""
        what = "Table I" if self.has_paper_rows else "SNR of the TCP speed"
        return f"{what}: {self.provenance.arm}, controller {self.provenance.controller}"

    def shown(self) -> tuple[pl.DataFrame, tuple[Column, ...]]:
        """The rows with the means, as people read them, and their columns."""
        n_runs = max(map(len, self.runs.values()))
        runs = [f"r{k}" for k in range(1, n_runs + 1)]
        frame = _with_means(self.frame, LEVEL.name, PAPER.name)
        frame = frame.with_columns(pl.col("snr_db").list.to_struct(fields=runs)).unnest("snr_db")
        return frame, (
            MOVEMENT,
            *(Column(run, format=".2f") for run in runs if n_runs > 1),
            LEVEL if n_runs > 1 else replace(LEVEL, header="SNR"),
            *([PAPER] if self.has_paper_rows else []),
            *([FLOOR] if self.has_floor else []),
            ERROR,
            LAG,
        )


def _with_means(frame: pl.DataFrame, *figures: str) -> pl.DataFrame:
    """Rows by kind, and after those of a kind with several a row `mean KIND` (`is_mean`) of some figures."""
    kinds = frame["kind"].unique(maintain_order=True)
    several = frame.filter(pl.len().over("kind") > 1, pl.col("kind") != GIVEN_UP)
    means = several.group_by("kind", maintain_order=True).agg(pl.col(figures).mean())
    means = means.with_columns(pl.format("mean {}", "kind").alias("name"), is_mean=True)
    both = pl.concat([frame.with_columns(is_mean=False), means], how="diagonal")
    return both.sort(pl.col("kind").cast(pl.Enum(kinds)), "is_mean", maintain_order=True)


def mean_by_kind(frame: pl.DataFrame, figure: str) -> dict[str, float]:
    """The mean of a figure over the movements of each kind that has it."""
    means = frame.drop_nulls(figure).group_by("kind", maintain_order=True).agg(pl.col(figure).mean())
    return dict(means.iter_rows())


def _frame_of_runs(runs: Sequence[MeasuredRun]) -> pl.DataFrame:
    """A row a run: `MeasuredRun.figures`."""
    return pl.DataFrame([run.figures for run in runs], infer_schema_length=None)


def build_table(runs: Sequence[MeasuredRun]) -> Table:
    """Build the table of one experiment.

    Args:
        runs: at least one run; all of the same arm, pace and controller.

    Raises:
        RecordingError: no runs, or runs of different experiments.
    """
    if not runs:
        raise RecordingError("there is no run to put into a table; record at least one movement")
    experiments = [
        (p.controller, p.robot, p.serial, p.seed, p.pace, p.simulated)
        for p in (run.provenance for run in runs)
    ]
    for run, experiment in zip(runs, experiments, strict=True):
        if experiment != experiments[0]:
            raise RecordingError(
                f"{run.recording.path.name} is of another experiment than {runs[0].recording.path.name} "
                "(robot, serial number, seed, pace or controller differ); keep one experiment a folder"
            )
    # The encoders are the same in all runs; the more of them are at rest, the better their noise is known.
    covariance = step_covariance(runs)
    runs = [replace(run, covariance=covariance) for run in runs]
    ordered = sorted(runs, key=lambda run: (*_rank(run), run.provenance.repetition))
    by_name = {name: tuple(group) for name, group in groupby(ordered, lambda run: run.provenance.movement)}
    frame = _frame_of_runs(ordered).group_by("name", maintain_order=True).agg(_FIGURES)
    levels = {
        "noise_floor_db": [group[0].floor_db for group in by_name.values()],
        # What does not repeat from run to run would leave this; None when it is not known.
        "unrepeatable_db": [
            decibels(group[0].budget.signal_power, power) if (power := unrepeatable_power(group)) else None
            for group in by_name.values()
        ],
    }
    return Table(frame.with_columns(pl.DataFrame(levels, dict.fromkeys(levels, pl.Float64))), by_name)


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


SHOWN = (LEVEL, LAG, ERROR)
"""What is shown of each experiment; in the frame with the number of the experiment behind the name."""


@dataclass(frozen=True, slots=True)
class SideBySide:
    """The experiments of one page.

    Attributes:
        columns: what stands beside the paper's figures, in the order given.
        changed: the same controllers with other numbers, or with the same movements in another time.
    """

    columns: tuple[Table, ...]
    changed: tuple[Table, ...]

    @property
    def frame(self) -> pl.DataFrame:
        """A row for each movement that any experiment has, with figures of all; null where one lacks it."""
        tables = [table.frame.with_columns(experiment=i) for i, table in enumerate(self.columns)]
        together = pl.concat(tables, how="vertical_relaxed")
        kinds = together["kind"].unique(maintain_order=True).to_list()
        kinds = [*(kind for kind in KINDS if kind in kinds), *(kind for kind in kinds if kind not in KINDS)]
        figures = [
            pl.col(figure.name).filter(experiment=i).first().alias(f"{figure.name}_{i}")
            for i in range(len(tables))
            for figure in SHOWN
        ]
        rows = together.group_by("name", maintain_order=True).agg(
            pl.col("kind", PAPER.name, "n_targets").first(), *figures
        )
        return rows.sort(pl.col("kind").cast(pl.Enum(kinds)), maintain_order=True)

    def shown(self) -> tuple[pl.DataFrame, list[Column]]:
        """The rows with the means of the levels of each kind, as people read them, and their columns."""
        columns = [MOVEMENT]
        if self.has_paper_rows:
            columns.append(replace(PAPER, header="paper, real UR3", unit="dB", narrow="paper,\nreal UR3"))
        for i, label in enumerate(self.labels):
            narrow = label.removesuffix(" controller")
            level, *others = (replace(figure, name=f"{figure.name}_{i}") for figure in SHOWN)
            columns += [replace(level, header=label, unit="dB", narrow=narrow), *others]
        levels = [column.name for column in columns if column.unit == "dB"]
        return _with_means(self.frame, *levels), columns

    @property
    def has_paper_rows(self) -> bool:
        """Whether a movement has the name of one in the paper's Table I."""
        return any(table.has_paper_rows for table in self.columns)

    @property
    def labels(self) -> list[str]:
        """What the columns are called; experiments of one controller by what else differs, or numbered."""
        names = []
        for table in self.columns:
            alike = [t.provenance for t in self.columns if t.label == table.label]
            facts = {
                id(p): (p.robot, f"serial {p.serial}" if p.seed is None else f"seed {p.seed}", p.pace)
                for p in alike
            }
            differ = [i for i, column in enumerate(zip(*facts.values(), strict=True)) if len(set(column)) > 1]
            names.append(", ".join([table.label, *(facts[id(table.provenance)][i] for i in differ)]))
        return [
            f"{name} ({names[:i].count(name) + 1})" if names.count(name) > 1 else name
            for i, name in enumerate(names)
        ]

    @property
    def mark(self) -> str:
        """What the data are; every mark that any experiment has."""
        return ", ".join(dict.fromkeys(m for table in self.columns if (m := table.provenance.origin.mark)))

    @property
    def differences(self) -> list[dict[str, Any]]:
        """Paired differences of the SNR, as rows of `compare`: of the kinds, and of the experiments.

        `of` says in which experiment, or for which kind.
        """

        def runs(kind: str, table: Table) -> list[MeasuredRun]:
            return [run for run in table.all_runs if run.provenance.kind == kind]

        tables = dict(zip(self.labels, self.columns, strict=True))
        groups = {label: {kind: runs(kind, table) for kind in KINDS[::-1]} for label, table in tables.items()}
        groups |= {kind: {of: runs(kind, table) for of, table in reversed(tables.items())} for kind in KINDS}
        return [
            {"of": of, **row}
            for of, several in groups.items()
            if (known := {name: group for name, group in several.items() if group})
            for row in compare(known).frame.to_dicts()
            if row["minus"] and row["mean"] is not None
        ]

    @property
    def finding(self) -> str:
        """What the experiments show of the paper's finding; empty without pairs of both kinds."""
        here = [f"{said(row)} with {row['of']}" for row in self.differences if row["minus"] == KINDS[0]]
        if not here or not self.has_paper_rows:
            return ""
        return (
            f"{papers_finding()} Here lognormal less uniform, in pairs through the same points, is "
            f"{'; '.join(here)}."
        )

    @property
    def offsets(self) -> list[str]:
        """What the largest position error of each experiment is made of, a sentence each."""
        worst = [
            max((run.errors for run in table.all_runs), key=lambda e: e.max_position_error_mm)
            for table in self.columns
        ]
        return [
            f"{label}: {e.max_position_error_mm:.1f} mm, there the constant offset between the client's "
            f"nominal arm and the robot's calibrated one is {math.hypot(*e.offset_mm):.1f} mm; without it "
            f"and the lag {e.max_path_error_mm:.1f} mm are left."
            for label, e in zip(self.labels, worst, strict=True)
        ]

    @property
    def arms(self) -> list[str]:
        """Which arm moved, one line for each that did."""
        arms: dict[str, list[str]] = {}
        for table in self.columns:
            arms.setdefault(table.provenance.arm, []).append(table.label)
        return [f"{', '.join(labels)}: {arm}" for arm, labels in arms.items()]

    def changes_of(self, table: Table) -> list[Table]:
        """A column and what was changed of it; nothing when there is none."""
        first = next(t for t in self.columns if t.base == table.base)
        changed = [other for other in self.changed if other.base == table.base]
        return [table, *changed] if changed and table is first else []

    def to_rich(self) -> RichTable:
        """Return the table for the terminal."""
        title = "\n".join(["Side by side: SNR of the TCP speed, Eq. 10, in dB", *self.arms])
        caption = "\n".join([_SHARED, self.finding] if self.has_paper_rows else [])
        return to_rich(*self.shown(), bold="is_mean", section="kind", title=title, caption=caption)


def side_by_side(tables: Sequence[Table]) -> SideBySide:
    """Put experiments beside each other; RecordingError if there is none.

    Where a controller has run with its own numbers, those with others, and faster or slower runs of the same
    movements, are no columns but changes of it.
    """
    if not tables:
        raise RecordingError("there is no experiment to show; give at least one folder")
    own: dict[tuple[str, str], Table] = {}
    for table in tables:
        if table.provenance.controller == table.base[1]:
            own.setdefault(table.base, table)
    changed = [
        t
        for t in tables
        if (first := own.get(t.base))
        and (t.provenance.controller != t.base[1] or t.duration_in(first) not in (None, 1.0))
    ]
    return SideBySide(tuple(t for t in tables if t not in changed), tuple(changed))


def papers_finding() -> str:
    """What the paper's ten values show of its finding, in one sentence."""
    lognormal, uniform = (
        [level for name, level in PAPER_SNR_DB.items() if name.startswith(kind)] for kind in ("logn", "unif")
    )
    low, high = stats.ttest_ind(lognormal, uniform, equal_var=False).confidence_interval()
    return (
        "The paper's ten values do not show a difference of lognormal and uniform movements that survives a "
        f"test: five and five differ by {fmean(lognormal) - fmean(uniform):.1f} dB "
        f"(95 %: {low:.1f} to {high:.1f} dB, Welch)."
    )


def said(row: Mapping[str, Any]) -> str:
    """A row of `differences` in words."""
    interval = "no interval" if row["p"] is None else "95 %: {low:.1f} to {high:.1f} dB".format(**row)
    p = "" if row["p"] is None else f", p = {row['p']:.2g}"
    return f"{round(row['mean'], 1) + 0.0:.1f} dB ({interval}; {row['n']} pair{'s' * (row['n'] != 1)}{p})"
