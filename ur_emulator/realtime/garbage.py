"""Python's garbage collector and the control cycle: while it runs, nothing else does."""

from __future__ import annotations

import gc
import threading
from collections.abc import Iterator
from contextlib import contextmanager

# Collect rarely: a full collection over a large heap costs more than a cycle has to spare.
_RARELY = (50_000, 20, 100)

_lock = threading.Lock()
_running_loops = 0


@contextmanager
def settled_heap() -> Iterator[None]:
    """Let the collector never look, while this block runs, at what exists when it begins.

    Blocks of several loops may overlap. When the last one ends everything is looked at again, so that boxes
    that are gone, in a process that makes many of them one after the other, leave nothing behind.
    """
    global _running_loops
    with _lock:
        gc.collect()
        gc.freeze()
        gc.set_threshold(*_RARELY)
        _running_loops += 1
    try:
        yield
    finally:
        with _lock:
            _running_loops -= 1
            if not _running_loops:
                gc.unfreeze()


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
