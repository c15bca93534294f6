"""The table [controller] of a sweep: values of `Controller`'s fields, and the settings they span.

A field has one value, a list of values, or a range `{ from = a, to = b }`. Lists span a grid; with
`random = N` they and the ranges are drawn from instead. Each field has a random stream of its own, made of
the seed and its name: a larger N keeps the first samples, and one more field does not change the others.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pc_client.control.controller import FIELDS, Controller, Value
from pc_client.errors import ControllerError, SweepError
from pc_client.spelling import check_keys
from ur_hil.records import checked


@dataclass(frozen=True, slots=True)
class Range:
    """Values between two ends, both > 0 when the scale is logarithmic."""

    low: float
    high: float
    logarithmic: bool

    def draw(self, rng: np.random.Generator) -> float:
        """One value."""
        if self.logarithmic:
            return float(math.exp(rng.uniform(math.log(self.low), math.log(self.high))))
        return float(rng.uniform(self.low, self.high))


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
    check_keys(table, FIELDS, f"{source}: controller.", SweepError)
    return {name: _read_axis(value, name, f"{source}: controller.{name}") for name, value in table.items()}


def grid(base: Controller, axes: Mapping[str, Axis], source: str) -> list[Controller]:
    """All combinations of the values; the last field changes first.

    Raises:
        SweepError: an axis is a range, which has no end of values.
    """
    for name, axis in axes.items():
        if isinstance(axis, Range):
            raise SweepError(
                f"{source}: controller.{name}: a range is drawn from; give random = N beside it, or a list"
            )
    values = [axis for axis in axes.values() if not isinstance(axis, Range)]
    return [
        dataclasses.replace(base, **dict(zip(axes, combination, strict=True)))  # type: ignore[arg-type]
        for combination in itertools.product(*values)
    ]


def samples(base: Controller, axes: Mapping[str, Axis], n: int, seed: int) -> list[Controller]:
    """Settings drawn at random; the same seed draws the same ones."""
    drawn = {name: _draw(axis, n, seed, name) for name, axis in axes.items()}
    return [
        dataclasses.replace(base, **{name: values[k] for name, values in drawn.items()})  # type: ignore[arg-type]
        for k in range(n)
    ]


def _draw(axis: Axis, n: int, seed: int, name: str) -> list[Value]:
    rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
    if isinstance(axis, Range):
        return [axis.draw(rng) for _ in range(n)]
    return [axis[int(rng.integers(len(axis)))] for _ in range(n)]


def _read_axis(value: Any, name: str, where: str) -> Axis:
    if isinstance(value, dict):
        return _read_range(value, name, where)
    values = value if isinstance(value, list) else [value]
    if not values:
        raise SweepError(f"{where}: an empty list; give at least one value")
    read = tuple(checked(FIELDS[name], item, where, ControllerError) for item in values)
    check_distinct(read, where)
    return read


def _read_range(table: Mapping[str, Any], name: str, where: str) -> Range:
    if FIELDS[name].kind is not float:
        raise SweepError(f"{where}: a range is of numbers; give a list of values")
    check_keys(table, ("from", "to", "scale"), f"{where}.", SweepError)
    for key in ("from", "to"):
        if key not in table:
            raise SweepError(f"{where}: a range without {key!r}; give {{ from = A, to = B }}")
    low, high = (
        checked(FIELDS[name], table[key], f"{where}.{key}", ControllerError) for key in ("from", "to")
    )
    scale = table.get("scale", "linear")
    if scale not in ("linear", "log"):
        raise SweepError(f'{where}.scale: {scale!r}; give "linear" or "log"')
    if not low < high:
        raise SweepError(f"{where}: from {low:g} to {high:g}; `from` must be the smaller")
    if scale == "log" and low == 0.0:
        raise SweepError(f"{where}: a logarithmic range from 0; give a `from` above 0")
    return Range(low, high, scale == "log")


def check_distinct(values: Sequence[object], where: str) -> None:
    """Refuse a list that names a value twice.

    Raises:
        SweepError: which value.
    """
    for i, value in enumerate(values):
        if value in values[:i]:
            raise SweepError(f"{where}: {value!r} is there twice; name each value once")
