"""What a process that has run boxes is left with: nothing of them, and its own settings."""

import gc
import sys
import weakref

from ur_emulator import ControlBox
from ur_emulator.realtime.interpreter import loop_settings


def test_a_box_that_is_gone_leaves_nothing():
    with ControlBox(pace="lockstep", port_base=None) as box:
        gone = weakref.ref(box)
    del box
    gc.collect()
    assert gone() is None


def test_while_a_loop_runs_the_collector_does_not_look_at_what_was_there_before():
    assert gc.get_freeze_count() == 0
    with loop_settings():
        assert gc.get_freeze_count() > 10_000
        with loop_settings():
            pass
        assert gc.get_freeze_count() > 10_000
    assert gc.get_freeze_count() == 0


def test_a_process_has_its_own_settings_again_after_its_last_box():
    before = gc.get_threshold(), sys.getswitchinterval()
    with ControlBox(pace="lockstep", port_base=None):
        with ControlBox(pace="lockstep", port_base=None):
            assert (gc.get_threshold(), sys.getswitchinterval()) != before
        assert (gc.get_threshold(), sys.getswitchinterval()) != before
    assert (gc.get_threshold(), sys.getswitchinterval()) == before
