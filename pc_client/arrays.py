"""Arrays of numbers: their type, copies that nobody changes, and the frozen records that hold them."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
"""Floating-point numbers; each docstring says their shape and unit."""


def read_only(values: ArrayLike, shape: tuple[int, ...] | None = None) -> Array:
    """A read-only float64 copy."""
    array = np.array(values, dtype=np.float64)
    if shape is not None:
        array = array.reshape(shape)
    array.setflags(write=False)
    return array


def set_fields(record: object, **values: object) -> None:
    """Set fields of a frozen record in its `__post_init__`: what was checked, or follows from the others."""
    for name, value in values.items():
        object.__setattr__(record, name, value)
