"""How well the arm follows the ten movements of the paper, in lockstep: the SNR of Eq. 10, in dB."""

from __future__ import annotations

import tempfile
from pathlib import Path
from statistics import fmean
from typing import Any

import pc_client as ur
from bench.box_process import box_process
from bench.length import FULL, Length
from pc_client.analysis.run import analyse_run
from pc_client.analysis.table import build_table
from pc_client.movements.library_sets import library_names
from pc_client.movements.movement import Style
from pc_client.recording.recording import load_recording


def measure_paper_set(length: Length = FULL) -> dict[str, float]:
    """Run the set once with `preview` and three times with `best`.

    A level "least above" another is that of the movement for which the difference is smallest.
    """
    chosen = movements(length)
    preview = _rows(chosen, ur.Controller.preview(), 1)
    best = _rows(chosen, ur.Controller.best(), length.part_of(3))
    levels = {
        kind: fmean(row["mean_snr_db"] for row in preview if row["kind"] == kind)
        for kind in ("lognormal", "uniform")
    }
    return {
        "paper_set_preview_lognormal_db": levels["lognormal"],
        "paper_set_preview_uniform_db": levels["uniform"],
        "paper_set_preview_least_above_paper_db": min(
            row["mean_snr_db"] - row["paper_snr_db"] for row in preview
        ),
        "paper_set_best_third_least_above_floor_db": min(
            row["snr_db"][-1] - row["noise_floor_db"] for row in best
        ),
        "paper_set_best_third_above_first_db": fmean(row["snr_db"][-1] - row["snr_db"][0] for row in best),
    }


def movements(length: Length) -> list[ur.Movement]:
    """The ten movements of the paper; in short one of each kind, as far as its second point."""
    ten = [ur.Movement.library(name) for name in library_names()]
    if length.is_whole:
        return ten
    kinds: tuple[tuple[ur.Movement, Style], ...] = ((ten[0], "robot"), (ten[-1], "human"))
    return [ur.Movement.through(m.target_points[:2], style, name=m.name) for m, style in kinds]


def _rows(chosen: list[ur.Movement], controller: ur.Controller, repeat: int) -> list[dict[str, Any]]:
    """The rows of Table I for these movements by this controller, on a box of its own."""
    with box_process("--pace", "lockstep", "--seed", "7") as box, tempfile.TemporaryDirectory() as folder:
        arm = ur.connect(box.host, box.ports)
        plans = [ur.plan(movement, arm) for movement in chosen]
        report = arm.experiment(plans, repeat, controller, Path(folder))
        table = build_table([analyse_run(load_recording(path)) for path in report.paths])
    return table.frame.to_dicts()
