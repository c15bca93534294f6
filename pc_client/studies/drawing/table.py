"""The figures of drawings for readers: `draw.json`, `draw.md`, a table for the terminal, and the page.

The page is one file that needs no network and holds no date, host or path of this machine.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl

from pc_client.analysis.report import provenance_facts
from pc_client.recording.provenance import Provenance
from pc_client.results.pages import picture, render
from pc_client.results.tables import Column, finite, frame_of, to_html, to_markdown, to_rich
from pc_client.studies.drawing.drawing import Drawing
from pc_client.studies.drawing.figures import COLOURS, FIGURES
from pc_client.studies.drawing.judgement import Agreement, Execution, Verdict

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table as RichTable

COLUMNS = (
    Column("signal", align="left", kind=str),
    Column("human_v", "SNR_v to human", "dB", ".2f", narrow="SNR_v\nhuman"),
    Column("human_t", "SNR_t to human", "dB", ".2f", narrow="SNR_t\nhuman"),
    Column("plan_v", "SNR_v to plan", "dB", ".2f", narrow="SNR_v\nplan"),
    Column("plan_t", "SNR_t to plan", "dB", ".2f", narrow="SNR_t\nplan"),
    Column("peaks", "speed peaks", narrow="speed\npeaks", kind=int),
    Column("sparc", "SPARC", format=".3f"),
    Column("log_jerk", "LDJ", format=".2f"),
    Column("exponent", "beta", format=".3f"),
    Column("r_squared", "R²", format=".2f"),
)
"""The table of one drawing."""

_ON_TERMINAL = 8
"""So many of them have room there."""

_COMMON_FACTS = (
    "data",
    "seed of the emulated arm",
    "serial number",
    "pace",
    "control cycle",
    "controller",
    "loop delay identified by the client",
    "client version",
)
"""What `analysis.report` says of runs that is said of drawings, too."""


@dataclass(frozen=True, slots=True, eq=False)
class Entry:
    """One drawing of a report: what was done, the runs, the figures."""

    drawing: Drawing
    executions: tuple[Execution, ...]
    verdict: Verdict

    @property
    def name(self) -> str:
        """Of the movement."""
        return self.drawing.movement.name

    @property
    def provenance(self) -> Provenance:
        """Of its first run."""
        return self.executions[0].run.provenance


def table_of(verdict: Verdict) -> pl.DataFrame:
    """A row for each signal of one drawing, with `COLUMNS`."""
    strokes = {**_agreement(human=verdict.reconstruction), **asdict(verdict.reconstructed)}
    rows = [
        {"signal": "human", **asdict(verdict.human)},
        {"signal": "reconstructed", **strokes},
        {"signal": "planned", **_agreement(human=verdict.plan)},
    ]
    for run in verdict.runs:
        who = f"executed r{run.repetition}" if len(verdict.runs) > 1 else "executed"
        aligned = _agreement(human=run.human_aligned, plan=run.planned_aligned)
        rows += [
            {"signal": who, **_agreement(human=run.human, plan=run.planned), **asdict(run.fluency)},
            {"signal": f"{who}, aligned", **aligned},
        ]
    return frame_of(rows, COLUMNS)


def _facts_of(entry: Entry) -> dict[str, str]:
    """What was done to a drawing, by name."""
    drawing, verdict = entry.drawing, entry.verdict
    placement = drawing.placement
    scale, run = placement.similarity.scale, verdict.best
    drawn = 1e3 * scale * np.ptp(drawing.drawn, axis=0)[: 2 if drawing.flat else 3]
    dots = sum(mark.trajectory is None for mark in drawing.marks)
    later = float(drawing.delays.max())
    lift = 1e3 * float(np.linalg.norm(placement.lift))
    t = np.linspace(0.0, drawing.movement.duration, 4001)
    report = {
        "recording": "/".join(PurePath(drawing.extraction.name).parts[-3:]),
        "marks": f"{len(drawing.marks)}" + (f", {dots} of them dots" if dots else ""),
        "strokes": f"{drawing.extraction.n_strokes} for {drawing.extraction.n_speed_peaks} speed peaks, "
        f"SNR_v per stroke {drawing.extraction.lognormality or math.nan:.2f} dB",
        "scale": f"{1e3 * scale:.3f} mm per unit of the recording; drawn "
        f"{' x '.join(f'{value:.0f}' for value in drawn)} mm",
        "place": _place(drawing),
        "slower than the hand": f"{drawing.factor:.3f} times, all strokes alike",
        "duration": f"{drawing.movement.duration:.2f} s, lifts of {lift:.0f} mm included",
        "gaps": f"later marks come up to {later:.2f} s of the hand later than recorded"
        if later > 0.005
        else "as recorded",
        "largest error while drawing": f"{1e3 * run.max_error:.2f} mm from the plan at equal time stamps"
        + (f", {1e3 * run.off_sheet:.2f} mm off the sheet" if drawing.flat else ""),
        "aligned": f"without a delay of {1e3 * run.lag:.1f} ms and the {1e3 * run.offset:.2f} mm between the "
        "nominal arm of the plan and the calibrated one",
        "Eq. 10, whole movement": f"{run.speed_db:.2f} dB, scalar TCP speed with lifts",
        "top speed of the arm": f"{1e3 * float(drawing.movement.speed(t).max()):.0f} mm/s",
    }
    for number, remark in enumerate(drawing.extraction.remarks, start=1):
        report[f"remark {number}"] = remark
    return report


def _common_facts(entries: Sequence[Entry]) -> dict[str, str]:
    """What all runs have in common."""
    runs = [execution.run for entry in entries for execution in entry.executions]
    facts = provenance_facts(runs)
    return {
        "robot": runs[0].provenance.robot,
        **{name: facts[name] for name in _COMMON_FACTS if name in facts},
        "runs": f"{len(runs)}, of {len(entries)} drawings",
        "recordings": "belong to those who made them; their licence is beside them",
    }


def drawings_json(entries: Sequence[Entry]) -> dict[str, Any]:
    """The content of `draw.json`; figures that are not finite become null."""
    first = entries[0].provenance
    found: dict[str, Any] = finite(
        {
            "robot": first.robot,
            "simulated": first.simulated,
            "seed": first.seed,
            "controller": first.controller,
            "drawings": [_drawing_json(entry) for entry in entries],
        }
    )
    return found


def drawings_markdown(entries: Sequence[Entry]) -> str:
    """The text of `draw.md`."""
    lines = ["# Drawings on the arm", "", *_list(_common_facts(entries))]
    for entry in entries:
        lines += ["", f"## {entry.name}", "", to_markdown(table_of(entry.verdict), COLUMNS)]
        lines += ["", *_list(_facts_of(entry))]
    return "\n".join(lines) + "\n"


def drawing_rich(entry: Entry) -> RichTable:
    """The table of one drawing for the terminal."""
    first = entry.provenance
    title = f"{entry.name}: {first.arm}, controller {first.controller}; SNR in dB"
    return to_rich(table_of(entry.verdict), COLUMNS[:_ON_TERMINAL], title=title)


def _drawing_json(entry: Entry) -> dict[str, Any]:
    drawing, placement = entry.drawing, entry.drawing.placement
    return {
        "name": entry.name,
        "recording": drawing.extraction.name,
        "marks": len(drawing.marks),
        "strokes": drawing.extraction.n_strokes,
        "speed_peaks": drawing.extraction.n_speed_peaks,
        "lognormality_db": drawing.extraction.lognormality,
        "remarks": list(drawing.extraction.remarks),
        "plane": placement.plane,
        "y_up": placement.y_up,
        "metres_per_unit": placement.similarity.scale,
        "rotation_deg": math.degrees(placement.rotation),
        "shift_m": placement.similarity.shift.tolist(),
        "lift_m": float(np.linalg.norm(placement.lift)),
        "slower_than_the_hand": drawing.factor,
        "duration_s": drawing.movement.duration,
        "delays_s_of_the_hand": drawing.delays.tolist(),
        **asdict(entry.verdict),
    }


def _place(drawing: Drawing) -> str:
    placement = drawing.placement
    if not drawing.flat:
        return "in space, axes of the recording along those of the base frame"
    y = "up" if placement.y_up else "down, as pixels are counted"
    turned = f", turned by {math.degrees(placement.rotation):.1f}°" if placement.rotation else ", not turned"
    return f"{placement.plane} sheet before the robot{turned}; y of the recording points {y}; not mirrored"


def _agreement(**agreements: Agreement) -> dict[str, Any]:
    """Cells of SNR_v and SNR_t by what is agreed with: human, plan."""
    return {
        f"{what}_{letter}": level
        for what, agreement in agreements.items()
        for letter, level in (("v", agreement.snr_v_db), ("t", agreement.snr_t_db))
    }


def _list(facts: Mapping[str, str]) -> list[str]:
    return [f"- {name}: {text}" for name, text in facts.items()]


_TEMPLATE = "studies/drawing/draw.html.j2"


def render_page(entries: Sequence[Entry], figures: Mapping[str, Mapping[str, Figure]]) -> str:
    """Return the text of `report.html`.

    Args:
        entries: the drawings, at least one.
        figures: `figures.figures_of` each, by its name.

    Raises:
        ModuleNotFoundError: matplotlib or jinja2 is not installed (extra `report`).
    """
    sections = [
        {
            "name": entry.name,
            "verdict": entry.verdict,
            "factor": entry.drawing.factor,
            "table": to_html(table_of(entry.verdict), COLUMNS),
            "facts": _facts_of(entry),
            "pictures": {name: picture(one, FIGURES[name]) for name, one in figures[entry.name].items()},
        }
        for entry in entries
    ]
    return render(
        _TEMPLATE,
        sections=sections,
        colours=COLOURS,
        facts=_common_facts(entries),
        origin=entries[0].provenance.origin,
        seed=entries[0].provenance.seed,
    )
