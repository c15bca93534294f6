"""The report: tables and one self-contained page, rebuilt from a folder of recordings; one page of several.

`report.html` needs no network: style and figures are inside it, and it holds no date, host or path, so the
same recordings give the same page. The plotting libraries are loaded only when a report is built.
"""

import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import polars as pl
import polars.selectors as cs
from rich.console import Console
from rich.progress import track as progress

from pc_client.analysis.groups import COLUMNS
from pc_client.analysis.measures import PARTS, SPLIT_HZ
from pc_client.analysis.noise_floor import LEAST_STEPS
from pc_client.analysis.run import MeasuredRun, analyse_run, budget_column
from pc_client.analysis.table import (
    FLOOR,
    LAG,
    MOVEMENT,
    PUBLISHED,
    SHOWN,
    SideBySide,
    Table,
    build_table,
    mean_by_kind,
    side_by_side,
)
from pc_client.control.controller import FIELDS
from pc_client.errors import CellError, RecordingError, one_line
from pc_client.files import FILE_KINDS
from pc_client.kinematics.arms import ROBOTS
from pc_client.recording.recording import load_recording
from pc_client.results.pages import picture, render, require_report_libraries, write_files
from pc_client.results.tables import Column, frame_of, to_html, to_json
from protocol.ur_types import JOINT_NAMES
from ur_hil.cell import NO_CELL, parse_cell

TABLE_JSON, TABLE_MARKDOWN, REPORT_HTML = "table1.json", "table1.md", "report.html"
_TEMPLATE, _TOGETHER = "analysis/report.html.j2", "analysis/side_by_side.html.j2"
_T = TypeVar("_T")

_LEVEL = Column("snr_db", "speed, Eq. 10", "dB", ".1f", missing="–")
_DEFINITIONS = (
    _LEVEL,
    replace(_LEVEL, name="snr_shifted_db", header="speed, shifted"),
    replace(LAG, header="shift"),
    replace(_LEVEL, name="vector_snr_db", header="vector"),
    replace(_LEVEL, name="vector_snr_shifted_db", header="vector, shifted"),
    replace(LAG, name="vector_lag_ms", header="shift"),
)
_BUDGET = (
    replace(MOVEMENT, header="SNR if this part were the only error", unit="dB"),
    *(Column(f"{budget_column(part)}_alone_db", part, format=".1f", missing="–") for part in PARTS),
    replace(_LEVEL, header="all", unit=""),
)
_DIFFERENCES = (Column("of", "in, for", align="left", kind=str), *COLUMNS)
_PATH_ERROR = Column("max_path_error_mm", "path error", "mm", ".2f")


@dataclass(frozen=True, slots=True)
class Report:
    """What was made of a folder of recordings.

    Attributes:
        paths: the files written: table1.json, table1.md and, with a page, report.html.
        left_out: one line for each recording that is not in the table, with the reason.
    """

    table: Table
    paths: tuple[Path, ...]
    left_out: tuple[str, ...]


def build_report(
    run_dir: Path | str, console: Console | None = None, *, include_aborted: bool = False
) -> Report:
    """Rebuild tables and page from the recordings `<movement>_r<k>.mcap` in a folder, as `build_tables`.

    Raises:
        RecordingError: as `build_tables`, or matplotlib or jinja2 is missing.
    """
    report = build_tables(run_dir, console, include_aborted=include_aborted)
    page = write_files(Path(run_dir), {REPORT_HTML: render_page(report.table, report.left_out, console)})
    return replace(report, paths=(*report.paths, *page))


def build_tables(
    run_dir: Path | str, console: Console | None = None, *, include_aborted: bool = False
) -> Report:
    """Rebuild the tables from the recordings in a folder, without a page.

    Recordings that were cut off, or of runs that were given up, are left out of the table and named on the
    page: half a movement has no SNR that could stand beside the others.

    Args:
        run_dir: the folder; the results are written into it.
        console: where progress is shown; None shows none.
        include_aborted: show such runs too, as movements of their own, outside of all means.

    Raises:
        RecordingError: no usable recording, recordings of different experiments, or a file cannot be
            written.
    """
    run_dir = Path(run_dir)
    files = sorted(run_dir.glob("*.mcap"))
    if not files:
        raise RecordingError(
            f"{run_dir} holds no recordings (*.mcap); give the folder that an experiment wrote"
        )
    runs: list[MeasuredRun] = []
    left_out: list[str] = []
    for path in _shown(files, "reading", console):
        try:
            runs.append(analyse_run(load_recording(path), include_aborted=include_aborted))
        except RecordingError as error:
            left_out.append(f"{path.name}: {one_line(error).removeprefix(str(path)).lstrip(': ')}")
        except Exception as error:  # an unexpected error in one file must not stop the others
            left_out.append(f"{path.name}: cannot be measured ({type(error).__name__}: {one_line(error)})")
    if not runs:
        raise RecordingError(f"{run_dir} holds no usable recording; {left_out[0]}")
    table = build_table(runs)
    paths = write_files(run_dir, {TABLE_JSON: to_json(table.to_json()), TABLE_MARKDOWN: table.to_markdown()})
    return Report(table, paths, tuple(left_out))


def render_page(table: Table, left_out: Iterable[str] = (), console: Console | None = None) -> str:
    """The text of `report.html`; RecordingError if matplotlib or jinja2 is not installed."""
    require_report_libraries()
    from pc_client.analysis import figures, run_figures

    movements = [
        {
            "row": row,
            "errors": table.runs[row["name"]][0].errors,
            "figure": picture(
                run_figures.movement_figure(table.runs[row["name"]]),
                f"Speed, speed error, path, joints and position error of {row['name']}",
            ),
        }
        for row in _shown(table.frame.to_dicts(), "drawing", console)
    ]
    level = cs.ends_with("_db")  # one that is beyond all measure (no error at all) is a dash
    means = table.means.with_columns(pl.when(level.abs() < 200.0).then(level))
    rows, (*columns, error, lag) = table.shown()
    columns = [replace(c, header="noise floor") if c is FLOOR else c for c in columns]
    columns += [replace(error, header="position error")]
    rows = rows.with_columns(pl.col(_PATH_ERROR.name).list.max())
    origin, several = table.provenance.origin, len(table.all_runs) > len(table.runs)
    learned = sum(bool(run.recording.summary.get("learned_from")) for run in table.all_runs)
    definitions = [replace(MOVEMENT, header="means over the repetitions" if several else ""), *_DEFINITIONS]
    return render(
        _TEMPLATE,
        table=table,
        levels=to_html(rows, [*columns, _PATH_ERROR, lag], bold="is_mean", links=True),
        definitions=to_html(means, definitions),
        budget=to_html(means, _BUDGET),
        movements=movements,
        split_hz=SPLIT_HZ,
        joint_names=JOINT_NAMES,
        table_figure=picture(
            figures.levels_figure(
                table.frame, [(table.provenance.controller, table)], origin.mark, floors=True
            ),
            "Bars of the SNR of each movement",
        ),
        definitions_figure=picture(
            figures.definitions_figure(table), "Four SNR definitions for each movement"
        ),
        budget_figure=picture(
            figures.budget_figure(table), "Share of each part in the error power, for each movement"
        ),
        origin=origin,
        known_arm=table.provenance.robot_model.lower() in ROBOTS,
        least_rest=LEAST_STEPS,
        seed=table.provenance.seed,
        facts=provenance_facts(table.all_runs),
        learned=f"{learned} of {len(table.all_runs)}" if learned else "",
        left_out=list(left_out),
    )


def provenance_facts(runs: Sequence[MeasuredRun]) -> dict[str, str]:
    """Return what all runs have in common, and what differs, as texts by name."""
    first = runs[0].provenance
    delays = sorted(
        {p.identified_delay_s for run in runs if (p := run.provenance).identified_delay_s is not None}
    )
    delay = "not identified"
    if delays:
        low, high = 1e3 * delays[0], 1e3 * delays[-1]
        delay = f"{low:.1f} ms" if low == high else f"{low:.1f} to {high:.1f} ms"
    return {
        "robot": first.robot_model,
        "controller software": first.firmware,
        "serial number": ", ".join(sorted({run.provenance.serial for run in runs})),
        "data": first.origin.says,
        **({} if first.seed is None else {"seed of the emulated arm": str(first.seed)}),
        "pace": first.pace,
        "control cycle": f"{1e3 * first.cycle_time_s:g} ms",
        "controller": first.controller,
        "controller settings": ", ".join(f"{k} = {v}" for k, v in sorted(first.controller_config.items())),
        "loop delay identified by the client": delay,
        **_loop_facts(first.loop),
        "cell": _cell_summary(first.cell_text),
        "client version": ", ".join(sorted({run.provenance.client_version for run in runs})),
        "runs": f"{len(runs)}, movements: {len({run.provenance.movement for run in runs})}",
    }


def _cell_summary(text: str) -> str:
    """What stood around the arm and what it carried, in words."""
    try:
        return (parse_cell(text, "recording", FILE_KINDS["cell"]) if text else NO_CELL).summary
    except CellError as error:
        return f"cannot be read ({one_line(error)})"


_LOOP = {
    # By a controller that identifies dead time and lag separately.
    "identified loop": "dead time {dead_time_s:.1f} ms, lag {lag_s:.1f} ms, "
    "single joints within {joint_spread_s:.1f} ms",
    "margins of the feedback": "gain {gain_margin:.1f}, phase {phase_margin_deg:.0f}°, "
    "delay {delay_margin_s:.0f} ms, sensitivity at most {sensitivity_peak:.2f}",
    "learning": "up to {learning_cut_off_hz:.1f} Hz (set by the {learning_limited_by}), "
    "contraction {learning_contraction:.2f} a run",
}
"""What is said of a loop, where all of it is known; times are in ms."""


def _loop_facts(loop: Mapping[str, float | str]) -> Mapping[str, str]:
    """Return the identified loop and its margins as texts by name; nothing for old recordings."""
    known = {k: 1e3 * v if k.endswith("_s") and not isinstance(v, str) else v for k, v in loop.items()}
    facts: dict[str, str] = {}
    for name, text in _LOOP.items():
        with suppress(KeyError):
            facts[name] = text.format(**known)
    return facts


def _shown(items: Iterable[_T], what: str, console: Console | None) -> Iterable[_T]:
    """Iterate with a progress bar when there is a terminal to show it."""
    items = list(items)
    if console is None or not console.is_terminal:
        return items
    return progress(items, description=what, console=console, transient=True)


def build_side_by_side(reports: Sequence[Report], out: Path) -> SideBySide:
    """Write one page of several experiments.

    Args:
        reports: of their folders; the page links to those that have pages.

    Raises:
        RecordingError: there is no experiment, matplotlib or jinja2 is missing, or the page cannot be
            written.
    """
    shown = side_by_side([report.table for report in reports])
    require_report_libraries()
    from pc_client.analysis import figures

    folder = {id(report.table): report.paths[0].parent for report in reports}
    experiments = list(zip(shown.labels, shown.columns, strict=True))
    rows, (name, *columns) = shown.shown()
    levels = [column for column in columns if column.unit == "dB"]
    # What is compared stands together: on a narrow screen it is what is seen.
    others = [
        replace(figure, name=f"{figure.name}_{i}", header=f"{figure.header}, {label}")
        for figure in SHOWN[1:]
        for i, label in enumerate(shown.labels)
    ]
    text = render(
        _TOGETHER,
        shown=shown,
        n_movements=len(shown.frame),
        cards=[(level.header, mean_by_kind(shown.frame, level.name)) for level in levels],
        links=[
            (Path(os.path.relpath(page, out.parent)).as_posix(), label)
            for label, table in experiments
            if (page := folder[id(table)] / REPORT_HTML).exists()
        ],
        labels=shown.labels,
        levels=to_html(rows, [name, *levels, Column("n_targets", "targets"), *others], bold="is_mean"),
        differences=to_html(frame_of(shown.differences, _DIFFERENCES), _DIFFERENCES),
        levels_figure=picture(
            figures.levels_figure(shown.frame, experiments, shown.mark),
            "Bars of the SNR of each movement: the paper's, and those of each experiment",
        ),
        speeds_figure=picture(
            figures.speeds_figure(shown.frame["name"].to_list(), experiments, shown.mark),
            "TCP speed over time of each movement, desired and actual",
        ),
        mark=shown.mark,
        published=next((t for t in shown.columns if t.provenance.controller == PUBLISHED), None),
        settings=[
            (tables[0].label, _settings(tables))
            for table in shown.columns
            if (tables := shown.changes_of(table))
        ],
        facts=_common([provenance_facts(table.all_runs) for table in shown.columns]),
        left_out=[f"{report.paths[0].parent.name}/{line}" for report in reports for line in report.left_out],
    )
    write_files(out.parent, {out.name: text})
    return shown


def _settings(tables: Sequence[Table]) -> str:
    """One controller with its own and other numbers and paces: what differs, and for each what came of it."""
    configs = [table.provenance.controller_config for table in tables]
    fields = [name for name in FIELDS if len({config.get(name) for config in configs}) > 1]
    kinds, own = tables[0].kinds, tables[0]
    rows = [
        {name: f"{x:g}" if isinstance(x := config.get(name), float) else str(x) for name in fields}
        | {kind: table.mean_of(kind) for kind in kinds}
        | {f"floor {kind}": table.mean_of(kind, FLOOR.name) for kind in kinds}
        | {"duration": table.duration_in(own) or 1.0, "is_own": table is own}
        | {"n_runs": len(next(iter(table.runs.values())))}
        | {LAG.name: table.frame[LAG.name].mean()}
        for table, config in zip(tables, configs, strict=True)
    ]
    columns = [
        *(Column(name, unit=getattr(FIELDS.get(name), "unit", "")) for name in fields),
        Column("duration", "duration of the movements", "own = 1", ".2g"),
        Column("n_runs", "runs of each movement"),
        *(Column(kind, f"mean {kind}", "dB", ".2f") for kind in kinds),
        *(Column(f"floor {kind}", f"noise floor {kind}", "dB", ".2f") for kind in kinds),
        LAG,
    ]
    return to_html(pl.DataFrame(rows, infer_schema_length=None), columns, bold="is_own")


def _common(facts: Sequence[Mapping[str, str]]) -> Mapping[str, str | list[str]]:
    """Facts of all columns by name: one text where they agree, else one for each column."""
    names = list(dict.fromkeys(name for one in facts for name in one))
    texts = {name: [one.get(name, "–") for one in facts] for name in names}
    return {name: given[0] if len(set(given)) == 1 else given for name, given in texts.items()}
