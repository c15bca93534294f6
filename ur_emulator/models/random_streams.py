"""Independent random streams from one seed.

Every part that needs random numbers gets a stream by name, so that adding a part does not change what the
others draw: the same seed stays the same box.
"""

from __future__ import annotations

from zlib import crc32

import numpy as np


def random_stream(seed: int, name: str) -> np.random.Generator:
    """Return the generator named `name` of the box with this `seed` (any integer >= 0)."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, crc32(name.encode())])))
