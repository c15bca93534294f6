"""Arithmetic that gives the same bits with every version of Python."""

from collections.abc import Iterable
from functools import reduce
from operator import add


def add_up(values: Iterable[float]) -> float:
    """Return the sum of numbers, added from the left; `sum` rounds otherwise from Python 3.12 on."""
    return reduce(add, values, 0.0)
