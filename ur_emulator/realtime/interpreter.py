"""Settings of the Python interpreter for a control loop; the settings before are restored afterwards.

While the garbage collector runs, nothing else does. A thread with long work, such as the user's own beside
`with ControlBox()`, shares the interpreter with the loop, so turns must be short.
"""

from __future__ import annotations

import gc
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

# Collect rarely: a full collection over a large heap costs more than a cycle has to spare.
_RARELY = (50_000, 20, 100)
_SWITCH_INTERVAL = 1e-4  # s

_lock = threading.Lock()
_running_loops = 0
_before = (gc.get_threshold(), sys.getswitchinterval())


@contextmanager
def loop_settings() -> Iterator[None]:
    """Collect rarely and switch threads often in this block.

    Blocks of several loops may overlap. When the last one ends, the settings are again what they were before
    the first.
    """
    global _running_loops, _before
    with _lock:
        if not _running_loops:
            _before = (gc.get_threshold(), sys.getswitchinterval())
        _running_loops += 1
        gc.set_threshold(*_RARELY)
        sys.setswitchinterval(_SWITCH_INTERVAL)
    try:
        yield
    finally:
        with _lock:
            _running_loops -= 1
            if not _running_loops:
                thresholds, interval = _before
                gc.set_threshold(*thresholds)
                sys.setswitchinterval(interval)


def freeze_existing_objects() -> None:
    """Let the collector never look again at what exists now: for a process that only serves boxes.

    A box in the process of its user must not do it: the heap may be large (with 11,000 tests
    a collection takes a quarter of a second), and its owner may have frozen objects too.
    """
    gc.collect()
    gc.freeze()
