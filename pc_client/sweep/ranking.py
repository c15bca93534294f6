"""Which setting of the controller is the best: the mean SNR over everything that it was tried on.

Settings are compared on equal terms: one counts only when all its cases are done. A setting that was refused
for one of the arms, or failed on one movement, has a mean over something else.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import prod
from statistics import fmean
from typing import Any

from pc_client.control.controller import FIELDS
from pc_client.sweep.columns import FACTORS

Rows = Sequence[Mapping[str, Any]]


@dataclass(frozen=True, slots=True)
class Setting:
    """What came of one setting of the controller.

    Attributes:
        values: what distinguishes it from the others, by column.
        n_runs: runs that were done.
        mean_snr_db: mean over them, Eq. 10; None without any.
        gain_margin: the smallest of all its loops; None when there is no feedback.
        max_position_error_mm: the largest of all runs.
        n_refused: cases that were refused.
        n_failed: cases that failed.
    """

    values: Mapping[str, Any]
    n_runs: int
    mean_snr_db: float | None
    gain_margin: float | None
    max_position_error_mm: float | None
    n_refused: int
    n_failed: int

    @property
    def complete(self) -> bool:
        """Whether its mean may stand beside others."""
        return self.mean_snr_db is not None and not self.n_refused and not self.n_failed

    @property
    def name(self) -> str:
        """Its values in one phrase."""
        return ", ".join(f"{name} = {value}" for name, value in self.texts().items())

    def texts(self) -> dict[str, str]:
        """Its values as texts, by column."""
        return {name: _short(value) for name, value in self.values.items()}


def varying(rows: Rows) -> list[str]:
    """The axes of a sweep: columns of `FACTORS` with more than one value, in their order.

    Named controllers differ in many fields; those that follow from the name are no axes of their own.
    """
    axes = [column.name for column in FACTORS if len({row.get(column.name) for row in rows}) > 1]
    if "controller" not in axes:
        return axes
    names = {row["controller"] for row in rows}
    return [
        axis
        for axis in axes
        if axis not in FIELDS or len({(row["controller"], row[axis]) for row in rows}) > len(names)
    ]


def spans_grid(rows: Rows) -> bool:
    """Whether each value of the controller's fields was tried with each: not so for random samples."""
    axes = _controller_axes(rows)
    settings = {tuple(row[axis] for axis in axes) for row in rows}
    return len(settings) == prod(len({row[axis] for row in rows}) for axis in axes)


def rank_settings(rows: Rows) -> list[Setting]:
    """All settings of the controller, the best first, incomplete ones last.

    Args:
        rows: of the table, with values of all `FACTORS`.
    """
    axes = _controller_axes(rows) or ["controller"]
    groups: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    for row in rows:
        groups.setdefault(tuple(row[axis] for axis in axes), []).append(row)
    settings = [_judge(dict(zip(axes, key, strict=True)), group) for key, group in groups.items()]
    # The sort is stable: equals keep the order of the table.
    return sorted(settings, key=lambda s: (not s.complete, -(s.mean_snr_db or 0.0), s.mean_snr_db is None))


def _controller_axes(rows: Rows) -> list[str]:
    of_controller = {"controller", *FIELDS}
    return [name for name in varying(rows) if name in of_controller]


def _judge(values: Mapping[str, Any], rows: Rows) -> Setting:
    done = [row for row in rows if row["status"] == "done"]
    snr = [row["snr_db"] for row in done if row["snr_db"] is not None]
    margins = [row["gain_margin"] for row in rows if row.get("gain_margin") is not None]
    errors = [row["max_position_error_mm"] for row in done]
    return Setting(
        values=values,
        n_runs=len(done),
        mean_snr_db=fmean(snr) if snr else None,
        gain_margin=min(margins, default=None),
        max_position_error_mm=max(errors, default=None),
        n_refused=sum(row["status"] == "refused" for row in rows),
        n_failed=sum(row["status"] == "failed" for row in rows),
    )


def _short(value: Any) -> str:
    return (
        f"{value:.4g}"
        if isinstance(value, float)
        else str(value).lower()
        if isinstance(value, bool)
        else str(value)
    )
