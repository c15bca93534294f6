"""docs/results.md: what `make demo` shows.

`python -m docs.generate.results_page out/demo` takes over a new run.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from docs.generate.templates import HERE, bare, rendered, table
from pc_client.analysis.report import build_tables
from pc_client.analysis.table import KINDS, papers_finding, side_by_side
from pc_client.results.tables import to_json

_DATA = HERE / "demo.json"
_NUMBERS = ("gain_p", "gain_i", "speedj_acceleration")


def render() -> str:
    """The page."""
    run = json.loads(_DATA.read_text(encoding="utf-8"))
    published = [row for row in run["rows"] if row["controller"] == "published controller"]
    return rendered(
        "results.md.j2",
        run=run,
        papers_finding=papers_finding(),
        differences=_differences(run),
        changes=_changes(run),
        own=published[0],
        preview=next(row for row in run["rows"] if row["controller"] == "preview"),
        fast=next(row for row in published if row["duration"] != 1.0),
    )


def _differences(run: dict[str, Any]) -> str:
    rows = [
        [
            row["of"],
            f"{row['group']} less {row['minus']}",
            f"{round(row['mean'], 1) + 0.0:.1f}",
            f"{row['low']:.1f} to {row['high']:.1f}",
            f"{row['n']}",
            bare(row["p"], 3),
        ]
        for row in run["differences"]
    ]
    return table(["in, for", "SNR of", "mean [dB]", "95 % [dB]", "pairs", "p"], rows, n_right=4)


def _changes(run: dict[str, Any]) -> str:
    heads = ["controller", "P 1/s, I 1/s², a rad/s²", "duration", *(f"{kind} [dB]" for kind in KINDS)]
    rows = [
        [row["controller"], row["numbers"], f"{row['duration']:g}"]
        + [f"{row[figure][kind]:.1f}" for figure in ("snr_db", "floor_db") for kind in KINDS]
        for row in run["rows"]
    ]
    return table([*heads, *(f"floor, {kind} [dB]" for kind in KINDS)], rows, n_right=5)


def collected(folder: Path) -> dict[str, Any]:
    """What is shown of the folders of a demo."""
    tables = [build_tables(path.parent).table for path in sorted(folder.rglob("table1.json"))]
    order = {"published controller": 0, "preview": 1}
    tables.sort(key=lambda t: ("_fast" in next(iter(t.runs)), order.get(t.label, 2)))
    shown = side_by_side(tables)
    own = {t.base: t for t in shown.columns}
    rows = [
        {
            "controller": own[t.base].label,
            "numbers": ", ".join(f"{t.provenance.controller_config[name]:g}" for name in _NUMBERS),
            "duration": t.duration_in(own[t.base]),
            "snr_db": {kind: t.mean_of(kind) for kind in KINDS},
            "floor_db": {kind: t.mean_of(kind, "noise_floor_db") for kind in KINDS},
        }
        for column in shown.columns
        for t in shown.changes_of(column)
    ]
    return {
        "arms": shown.arms,
        "finding": shown.finding,
        "differences": shown.differences,
        "offsets": shown.offsets,
        "rows": rows,
    }


if __name__ == "__main__":
    _DATA.write_text(to_json(collected(Path(sys.argv[1])), 4), encoding="utf-8")
