"""The comparison of generators: how human-like their movements are, planned and executed.

Every generator makes a movement in the same time, for one or more seeds; all but the duplicate, which moves
its target points as people do, through the same target points. Each movement is measured as three signals: as
planned, as planned but sampled and filtered, and as executed. The last two go through the same steps (sampled
at the control cycle with some rest at both ends, filtered, differentiated), so that they differ by what the
robot did and by nothing else.

The second derivative of the speed is the third of the position: the encoders' noise, some micrometres at the
TCP, would drown it. So a Butterworth filter of second order is run forwards and backwards over the positions,
which shifts nothing in time and halves the amplitude at 5 Hz. Of noise of 8 micrometres it leaves less than
.05 m/s^3, where executed movements have .2 to 2; what is lost are the corners of trapezoids, and they are
lost from the plan, too. 5 Hz is far above the movements themselves: the speed profiles of a robot's strokes
last a second or more.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl
from scipy.interpolate import CubicSpline

from pc_client.analysis.run import MeasuredRun
from pc_client.arrays import Array
from pc_client.control.loop import SAMPLING_TIME
from pc_client.errors import ClientError
from pc_client.movements.generate import GENERATORS, generate_movement
from pc_client.movements.movement import Movement
from pc_client.results.tables import Column, finite, to_markdown, to_rich
from pc_client.studies import likeness
from pc_client.studies.likeness import Likeness
from pc_client.studies.signals import Trace, low_passed

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table as RichTable

MovementSet = Mapping[str, Movement]
"""The movements of one seed by the generator's name, in the order of `GENERATORS`."""


def make_sets(n_targets: int, seed: int, n_sets: int) -> list[MovementSet]:
    """Make the movements of n_sets seeds: seed, seed + 1 ...; each through n_targets target points."""
    if n_sets < 1:
        raise ClientError(f"{n_sets} sets of movements is nothing to compare; give at least one")

    def make(kind: str, number: int) -> Movement:
        made = generate_movement(kind, n_targets, number, name=f"{kind}_{n_targets}_seed{number}")
        return replace(made, may_be_moved=True)

    return [{kind: make(kind, number) for kind in GENERATORS} for number in range(seed, seed + n_sets)]


def save_sets(sets: Sequence[MovementSet], folder: Path) -> None:
    """Write all movements as files into a folder, so that each can be run or looked at by itself.

    Raises:
        ClientError: the folder cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ClientError(f"cannot use the folder {folder}: {error.strerror or error}") from error
    for movements in sets:
        for movement in movements.values():
            movement.save(folder / f"{movement.name}.toml")


#: Frequency (Hz) at which the filter halves an amplitude. One number for all movements and robots.
CUTOFF_HZ = 5.0
_ORDER = 2
#: What the filter is, for tables.
_FILTER_TEXT = f"Butterworth order {_ORDER}, forwards and backwards, half amplitude at {CUTOFF_HZ:g} Hz"
#: Samples a second (Hz) of the plan: the rate of the reference figures; and of filtered and executed signals.
_PLAN_RATE, _RATE = 1000.0, 1.0 / SAMPLING_TIME
#: Rest (s) before and after a movement that is filtered with it.
_REST = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class Sampled(Trace):
    """A movement from start to end, m and s since its start, with its accelerations a (n, 3), m/s^2."""

    a: Array


def filtered(t: Array, p: Array) -> Sampled:
    """Positions (n, 3) [m] at times (n,) [s], 125 a second, through the filter; their first two differences.

    The movement is at rest for the first and the last few tenths of a second.
    """
    # The rests at both ends are long enough to be continued as they are.
    smooth = low_passed(p, _RATE, cutoff=CUTOFF_HZ, order=_ORDER, padding=round(_RATE), ends="rest")
    v = np.gradient(smooth, SAMPLING_TIME, axis=0)
    return Sampled(t, smooth, v, np.gradient(v, SAMPLING_TIME, axis=0))


def planned_signal(movement: Movement) -> Sampled:
    """The movement's own closed form, at 1 kHz, unfiltered."""
    t = np.arange(math.floor(movement.duration * _PLAN_RATE + 1e-6) + 1) / _PLAN_RATE
    return Sampled(t, *movement.motion(t))


def filtered_signal(movement: Movement) -> Sampled:
    """The plan as a perfect robot would report it at 125 Hz, filtered."""
    t = _grid(movement.duration)
    return _inner(filtered(t, movement.sample(t).p), movement.duration)


def executed_signal(run: MeasuredRun, duration: float) -> Sampled:
    """What the robot did in a movement of this duration (s), at 125 Hz, filtered.

    The window is that of the plan, later by the robot's lag, so that a late robot is not cut off.
    """
    t = _grid(duration)
    at = t + run.track.t_begin + run.snr.speed_lag_s
    # Frames come on the same grid but for the lag, which is no whole number of cycles.
    p = CubicSpline(run.track.t, run.track.p_actual)(np.clip(at, run.track.t[0], run.track.t[-1]))
    return _inner(filtered(t, p), duration)


def _grid(duration: float) -> Array:
    return np.arange(-round(_REST * _RATE), round((duration + _REST) * _RATE) + 1) / _RATE


def _inner(signal: Sampled, duration: float) -> Sampled:
    moving = (signal.t >= -1e-9) & (signal.t <= duration + 1e-9)
    return Sampled(signal.t[moving], signal.p[moving], signal.v[moving], signal.a[moving])


def measured(signal: Sampled) -> dict[str, float]:
    """The figures of `Likeness`, and the highest speed (m/s) and acceleration (m/s^2), by column.

    The power law is fitted from the first to the last peak of the speed.
    """
    # Not `signal.speed`, which rounds otherwise: the first of equal samples is where a plateau has its peak.
    speed, rate = np.linalg.norm(signal.v, axis=1), 1.0 / signal.step
    inner = likeness.between_peaks(speed)
    law = likeness.fit_power_law(signal.v[inner], signal.a[inner])
    figures = Likeness(
        peaks=likeness.speed_peaks(speed),
        sparc=likeness.sparc(speed, rate),
        log_jerk=likeness.log_dimensionless_jerk(speed, rate),
        exponent=law.exponent,
        r_squared=law.r_squared,
    )
    top = {"peak_speed": speed.max(), "peak_acceleration": np.linalg.norm(signal.a, axis=1).max()}
    return {name: float(value) for name, value in (asdict(figures) | top).items()}


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
_FIGURES = [column.name for column in COLUMNS[2:]]
_LEVELS = [column.name for column in EXECUTED_COLUMNS]


@dataclass(frozen=True, slots=True)
class Comparison:
    """All figures, and what they have in common.

    Attributes:
        frame: a row for each signal of each movement ("planned", "filtered" and, where it was, "executed"):
            generator, movement, duration [s], signal, the figures of `Likeness` (nan where there is nothing
            to fit) and of executed ones the SNR of Eq. 10, raw and after the best time shift.
        robot: e.g. "SIMULATED UR3 3.15.8, seed 7, controller preview"; None where nothing was executed.
    """

    frame: pl.DataFrame
    n_strokes: int
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
            f"planned: closed form at {_PLAN_RATE:g} Hz. filtered, executed: positions at {_RATE:g} Hz, "
            f"{_FILTER_TEXT}, then differentiated.",
            "SPARC and LDJ: nearer to 0 is smoother; compare LDJ only within one of the three signals. "
            "beta: the exponent of speed = k curvature^-beta, from the first to the last peak of the speed; "
            "1/3 for drawing hands, where R² is high. A dash: straight lines, or one peak only.",
            *(("SNR: Eq. 10 on the raw TCP speed; best: after the best time shift.",) if self.robot else ()),
        )

    @property
    def means(self) -> pl.DataFrame:
        """A row for each generator and signal: means over the movements that have the figure."""
        figures = pl.col(_FIGURES)
        grouped = self.frame.group_by("generator", "signal", maintain_order=True)
        return grouped.agg(
            figures.filter(figures.is_finite()).mean().fill_null(math.nan), pl.col(_LEVELS).mean()
        )

    def to_json(self) -> dict[str, Any]:
        """Return the content of `compare.json`; figures that are not finite become null."""
        rows = self.frame.partition_by("generator", "movement", maintain_order=True)
        means = self.means.partition_by("generator", maintain_order=True)
        return {
            "robot": self.robot,
            "rate_hz": _RATE,
            "n_strokes": self.n_strokes,
            "filter": _FILTER_TEXT,
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
    sets: Sequence[MovementSet], runs: Mapping[str, MeasuredRun] | None = None
) -> Comparison:
    """Measure all movements; `runs` are the recordings by the movement's name, if they were executed.

    Raises:
        ClientError: a movement has no recording although others have.
    """
    robot = None
    if runs:
        whose = next(iter(runs.values())).provenance
        robot = f"{whose.arm}, controller {whose.controller}"
    rows = [row for one in sets for kind, movement in one.items() for row in _rows(kind, movement, runs)]
    n_strokes = len(next(iter(sets[0].values())).target_points) - 1
    return Comparison(pl.DataFrame(rows, infer_schema_length=None), n_strokes, robot)


def _rows(
    generator: str, movement: Movement, runs: Mapping[str, MeasuredRun] | None
) -> Iterator[dict[str, Any]]:
    """One row for each signal of a movement."""
    signals = {"planned": planned_signal(movement), "filtered": filtered_signal(movement)}
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
            **measured(signal),
            **dict(zip(_LEVELS, levels, strict=True)),
        }


def _by_signal(rows: pl.DataFrame) -> dict[str, Any]:
    """The figures of one movement or generator, by signal; the levels are those of the last, if executed."""
    figures = {row["signal"]: {name: row[name] for name in _FIGURES} for row in rows.to_dicts()}
    return figures | {name: rows[name][-1] for name in _LEVELS}


_COLUMNS = 2
_PANEL_HEIGHT = 1.75
_WIDTH = 12.0


def comparison_figure(one: MovementSet, runs: Mapping[str, MeasuredRun] | None = None) -> Figure:
    """The movements of one seed, and their recordings by name where they were executed. Loads matplotlib."""
    from pc_client.results.figures import BLUE, HOLLOW, REFERENCE_GREY, figure, label_axes, space_axes

    n_rows = -(-len(one) // _COLUMNS)
    plans = {movement.name: planned_signal(movement) for movement in one.values()}
    top = 1.08e3 * max(float(plan.speed.max()) for plan in plans.values())
    everything = np.vstack([1e3 * plan.p for plan in plans.values()])
    executed = "; blue: as executed, filtered" if runs else ""
    title = (
        f"TCP speed and path, grey: as planned{executed}. Same time, same target points (all but duplicate)"
    )
    mark = next(iter(runs.values())).provenance.origin.mark if runs else ""
    with figure(_PANEL_HEIGHT * n_rows + 0.75, mark, width=_WIDTH, title=title) as page:
        grid = page.add_gridspec(n_rows, 2 * _COLUMNS, width_ratios=(2.5, 1.0) * _COLUMNS)
        for index, (kind, movement) in enumerate(one.items()):
            row, column = divmod(index, _COLUMNS)
            speeds = page.add_subplot(grid[row, 2 * column])
            paths: Any = page.add_subplot(grid[row, 2 * column + 1], projection="3d")
            plan, run = plans[movement.name], (runs or {}).get(movement.name)
            speeds.plot(plan.t, 1e3 * plan.speed, color=REFERENCE_GREY, lw=2.6)
            paths.plot(*(1e3 * plan.p).T, color=REFERENCE_GREY, lw=2.4, alpha=0.7)
            if run is not None:
                done = executed_signal(run, movement.duration)
                speeds.plot(done.t, 1e3 * done.speed, color=BLUE)
                paths.plot(*(1e3 * run.track.p_actual[run.track.movement]).T, color=BLUE, lw=0.9)
            paths.plot(*(1e3 * movement.target_points).T, color="black", **HOLLOW)
            label_axes(
                speeds,
                f"{kind}: {GENERATORS[kind].says}",
                "time [s]" if index + _COLUMNS >= len(plans) else "",
                "" if column else "mm/s",
                (0.0, movement.duration),
                0.0,
                top,
            )
            space_axes(paths, everything, view=(24.0, -40.0), zoom=1.3)
    return page
