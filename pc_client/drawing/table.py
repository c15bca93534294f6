"""The figures of drawings in three forms: `draw.json` for programs, `draw.md` for documents, a rich table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.box import SIMPLE_HEAD
from rich.table import Table as RichTable
from rich.text import Text

from pc_client.drawing.drawing import Drawing
from pc_client.drawing.execution import Execution
from pc_client.drawing.judgement import Agreement, Fluency, Verdict
from pc_client.recording.provenance import Provenance

__all__ = ["COLUMNS", "Entry", "facts_of", "provenance_facts", "rows_of", "to_json", "to_markdown", "to_rich"]

#: Headings of the table of one drawing.
COLUMNS = (
    "signal",
    "SNR_v to human [dB]",
    "SNR_t to human [dB]",
    "SNR_v to plan [dB]",
    "SNR_t to plan [dB]",
    "speed peaks",
    "SPARC",
    "LDJ",
    "beta",
    "R²",
)

#: So many of them have room on a terminal.
_ON_TERMINAL = 8


@dataclass(frozen=True, slots=True, eq=False)
class Entry:
    """One drawing of a report.

    Attributes:
        drawing: what was done.
        executions: the runs.
        verdict: the figures.
    """

    drawing: Drawing
    executions: tuple[Execution, ...]
    verdict: Verdict

    @property
    def name(self) -> str:
        """Of the movement."""
        return self.drawing.movement.name


def rows_of(verdict: Verdict) -> list[tuple[str, ...]]:
    """The rows of one drawing as texts, in the order of `COLUMNS`: one for each signal."""
    none = ("", "")
    rows = [
        ("human", *none, *none, *_fluency(verdict.human)),
        ("reconstructed", *_agreement(verdict.reconstruction), *none, *_fluency(verdict.reconstructed)),
        ("planned", *_agreement(verdict.plan), *none, *[""] * 5),
    ]
    for run in verdict.runs:
        who = f"executed r{run.repetition}" if len(verdict.runs) > 1 else "executed"
        rows += [
            (who, *_agreement(run.human), *_agreement(run.planned), *_fluency(run.fluency)),
            (
                f"{who}, aligned",
                *_agreement(run.human_aligned),
                *_agreement(run.planned_aligned),
                *[""] * 5,
            ),
        ]
    return rows


def facts_of(entry: Entry) -> dict[str, str]:
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
        "scale": f"{1e3 * scale:.3f} mm per unit of the recording; drawn {_sizes(drawn)} mm",
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


def provenance_facts(entries: Sequence[Entry]) -> dict[str, str]:
    """What all runs have in common."""
    first = _provenance(entries[0])
    delay = first.identified_delay_s
    return {
        "robot": first.robot,
        "data": first.origin.says,
        **({} if first.seed is None else {"seed of the emulated arm": str(first.seed)}),
        "serial number": first.serial,
        "pace": first.pace,
        "control cycle": f"{1e3 * first.cycle_time_s:g} ms",
        "controller": first.controller,
        "loop delay identified by the client": "not identified" if delay is None else f"{1e3 * delay:.1f} ms",
        "client version": first.client_version,
        "runs": f"{sum(len(entry.executions) for entry in entries)}, of {len(entries)} drawings",
        "recordings": "belong to those who made them; see the licence beside the data (Omniglot: MIT)",
    }


def to_json(entries: Sequence[Entry]) -> dict[str, Any]:
    """The content of `draw.json`; figures that are not finite become null."""
    first = _provenance(entries[0])
    found: dict[str, Any] = _finite(
        {
            "robot": first.robot,
            "simulated": first.simulated,
            "seed": first.seed,
            "controller": first.controller,
            "drawings": [_drawing_json(entry) for entry in entries],
        }
    )
    return found


def to_markdown(entries: Sequence[Entry]) -> str:
    """The text of `draw.md`."""
    lines = ["# Human movements on the arm", ""]
    lines += [f"- {name}: {text}" for name, text in provenance_facts(entries).items()]
    for entry in entries:
        lines += ["", f"## {entry.name}", "", "| " + " | ".join(COLUMNS) + " |"]
        lines += ["|---|" + "---:|" * (len(COLUMNS) - 1)]
        lines += ["| " + " | ".join(row) + " |" for row in rows_of(entry.verdict)]
        lines += ["", *(f"- {name}: {text}" for name, text in facts_of(entry).items())]
    return "\n".join(lines) + "\n"


def to_rich(entry: Entry) -> RichTable:
    """The table of one drawing for the terminal."""
    first = _provenance(entry)
    table = RichTable(
        title=Text(f"{entry.name}: {first.arm}, controller {first.controller}; SNR in dB"),
        box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    for column in COLUMNS[:_ON_TERMINAL]:
        narrow = column.replace(" [dB]", "").replace(" to", "").replace(" ", "\n")
        table.add_column(Text(narrow), justify="left" if column == "signal" else "right", no_wrap=True)
    for row in rows_of(entry.verdict):
        table.add_row(*map(Text, row[:_ON_TERMINAL]))
    return table


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


def _provenance(entry: Entry) -> Provenance:
    return entry.executions[0].run.provenance


def _place(drawing: Drawing) -> str:
    placement = drawing.placement
    if not drawing.flat:
        return "in space, axes of the recording along those of the base frame"
    y = "up" if placement.y_up else "down, as pixels are counted"
    turned = f", turned by {math.degrees(placement.rotation):.1f}°" if placement.rotation else ", not turned"
    return f"{placement.plane} sheet before the robot{turned}; y of the recording points {y}; not mirrored"


def _sizes(drawn: NDArray[np.float64]) -> str:
    return " x ".join(f"{value:.0f}" for value in drawn)


def _agreement(agreement: Agreement) -> tuple[str, str]:
    return _number(agreement.snr_v_db, 2), _number(agreement.snr_t_db, 2)


def _fluency(fluency: Fluency) -> tuple[str, ...]:
    return (
        str(fluency.peaks),
        _number(fluency.sparc, 3),
        _number(fluency.log_jerk, 2),
        _number(fluency.exponent, 3),
        _number(fluency.r_squared, 2),
    )


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else "–"


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
