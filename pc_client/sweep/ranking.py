"""Which setting of the controller is the best: the mean SNR over everything that it was tried on.

Settings are compared on equal terms: one counts only when all its cases are done. A setting that was refused
for one of the arms, or failed on one movement, has a mean over something else.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import prod
from typing import Any

import polars as pl

from pc_client.control.controller import FIELDS
from pc_client.results.tables import Column
from pc_client.sweep.columns import FACTORS

RANKING = (
    Column("setting", align="left", kind=str),
    Column("mean_snr_db", "mean SNR", "dB", ".2f"),
    Column("gain_margin", "gain margin", format=".2f", narrow="gain\nmargin"),
    Column("max_position_error_mm", "max position error", "mm", ".2f", narrow="max error\n[mm]"),
    Column("n_runs", "runs", kind=int),
    Column("n_refused", "refused cases", kind=int, narrow="refused"),
    Column("n_failed", "failed cases", kind=int, narrow="failed"),
)
"""What is shown of a ranking."""


def judge(table: pl.DataFrame, by: Sequence[str]) -> pl.DataFrame:
    """What came of each setting.

    Args:
        table: rows of a sweep.
        by: columns that distinguish settings.

    Returns:
        These columns and those of `RANKING` but the first, in the order of the table: mean over the runs that
        are done, smallest gain margin of all loops, largest error. `complete` says whether the mean may stand
        beside others.
    """
    done = pl.col("status") == "done"
    judged = table.group_by(by, maintain_order=True).agg(
        pl.col("snr_db").filter(done).mean().alias("mean_snr_db"),
        pl.col("gain_margin").min(),
        pl.col("max_position_error_mm").filter(done).max(),
        done.sum().alias("n_runs"),
        (pl.col("status") == "refused").sum().alias("n_refused"),
        (pl.col("status") == "failed").sum().alias("n_failed"),
    )
    all_done = (pl.col("n_refused") == 0) & (pl.col("n_failed") == 0)
    return judged.with_columns(complete=pl.col("mean_snr_db").is_not_null() & all_done)


def rank_settings(table: pl.DataFrame) -> pl.DataFrame:
    """All settings of the controller, the best first, incomplete ones last; equals as in the table.

    Returns:
        What `judge` returns, and the values of a setting in one phrase, as `setting`.
    """
    axes = _controller_axes(table) or ["controller"]
    judged = judge(table, axes)
    names = [", ".join(f"{axis} = {_short(row[axis])}" for axis in axes) for row in judged.to_dicts()]
    return judged.with_columns(setting=pl.Series(names, dtype=pl.String)).sort(
        "complete", "mean_snr_db", descending=True, nulls_last=True, maintain_order=True
    )


def varying(table: pl.DataFrame) -> list[str]:
    """The axes of a sweep: columns of `FACTORS` with more than one value, in their order.

    Named controllers differ in many fields; those that follow from the name are no axes of their own.
    """
    axes = [column.name for column in FACTORS if table[column.name].n_unique() > 1]
    if "controller" not in axes:
        return axes
    n_names = table["controller"].n_unique()
    return [
        axis for axis in axes if axis not in FIELDS or table.select("controller", axis).n_unique() > n_names
    ]


def spans_grid(table: pl.DataFrame) -> bool:
    """Whether each value of the controller's fields was tried with each: not so in a search."""
    axes = _controller_axes(table)
    return not axes or table.select(axes).n_unique() == prod(table[axis].n_unique() for axis in axes)


def _controller_axes(table: pl.DataFrame) -> list[str]:
    return [name for name in varying(table) if name in {"controller", *FIELDS}]


def _short(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    return str(value).lower() if isinstance(value, bool) else str(value)
