"""Python's garbage collector and the control cycle: while it runs, nothing else does."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def collection_put_off() -> Iterator[None]:
    """Collect nothing in this block: for work that makes many objects and leaves hardly any.

    Going through the trees of a long program takes longer than a cycle has to spare, and finds nothing, since
    they do not refer to themselves. Blocks of several threads may overlap: the first to begin lets the
    collector run again when it ends, which is only slower for the others.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
