"""The table [controller] of a sweep: for each field of the controller a value, a list of values, or a range.

Lists span a grid. From lists and ranges a search chooses (`search`).
"""

from __future__ import annotations

import dataclasses
import itertools
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from pc_client.control.controller import FIELDS, Controller, Value
from pc_client.errors import ControllerError, SweepError
from ur_hil.records import Finite, Flag, checked, nearest, record


@record
class Range:
    """Values between two ends.

    Attributes:
        low: smallest value.
        high: largest value.
        log: whether they are equally likely on a logarithmic scale.
    """

    low: Finite
    high: Finite
    log: Flag = False

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise ValueError(f"high: {self.high:g}; give a number above low, which is {self.low:g}")
        if self.log and self.low <= 0.0:
            raise ValueError(f"low: {self.low:g}; with log = true, give a number above 0")


Axis = tuple[Value, ...] | Range


def read_axes(table: Mapping[str, Any], source: str) -> dict[str, Axis]:
    """Check the table [controller].

    Args:
        table: as `tomllib` gives it.
        source: the file's name, for messages.

    Returns:
        One axis a field, in the order of the file.

    Raises:
        SweepError: unknown field, or a range or list that makes no sense.
        ControllerError: a value that the field cannot hold.
    """
    for name in table:
        if name not in FIELDS:
            raise SweepError(f"{source}: controller.{name}: no such key; {nearest(name, FIELDS)}")
    return {name: _read_axis(value, name, f"{source}: controller.{name}") for name, value in table.items()}


def _read_axis(value: Any, name: str, where: str) -> Axis:
    field = FIELDS[name]
    if isinstance(value, dict):
        if field.kind is not float:
            raise SweepError(f"{where}: a range is of numbers; give a list of values")
        axis = checked(Range, value, where, SweepError)
        for end in ("low", "high"):
            checked(field, getattr(axis, end), f"{where}.{end}", ControllerError)
        return axis
    values = value if isinstance(value, list) else [value]
    read = tuple(checked(field, item, where, ControllerError) for item in values)
    if not read:
        raise SweepError(f"{where}: an empty list; give at least one value")
    if problem := repeated(read):
        raise SweepError(f"{where}: {problem}")
    return read


def repeated(values: Iterable[object]) -> str:
    """What is wrong with a list that names a value twice; empty when nothing is."""
    twice = next((value for value, n in Counter(values).items() if n > 1), None)
    return "" if twice is None else f"{twice!r} is there twice; name each value once"


def grid(bases: Sequence[Controller], axes: Mapping[str, tuple[Value, ...]]) -> list[Controller]:
    """All combinations of the values, controller by controller; the last field changes first."""
    return [
        dataclasses.replace(base, **dict(zip(axes, values, strict=True)))  # type: ignore[arg-type]
        for base in bases
        for values in itertools.product(*axes.values())
    ]
