"""What a process that makes many boxes, one after the other, is left with."""

import gc
import weakref

from ur_emulator import ControlBox
from ur_emulator.realtime.garbage import settled_heap


def test_a_box_that_is_gone_leaves_nothing():
    with ControlBox(pace="lockstep", port_base=None) as box:
        gone = weakref.ref(box)
    del box
    gc.collect()
    assert gone() is None


def test_while_a_loop_runs_the_collector_does_not_look_at_what_was_there_before():
    assert gc.get_freeze_count() == 0
    with settled_heap():
        before = gc.get_freeze_count()
        assert before > 10_000
        with settled_heap():
            pass
        assert gc.get_freeze_count() >= before
    assert gc.get_freeze_count() == 0
