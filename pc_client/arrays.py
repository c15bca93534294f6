"""Arrays of numbers: their type, and copies that nobody changes."""

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
