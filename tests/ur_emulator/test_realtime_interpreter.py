"""What a process that has run boxes is left with: nothing of them, and its own settings."""

import gc
import sys
import weakref

from ur_emulator import ControlBox
from ur_emulator.realtime.interpreter import freeze_existing_objects


def test_a_box_that_is_gone_leaves_nothing():
    with ControlBox(pace="lockstep", port_base=None) as box:
        gone = weakref.ref(box)
    del box
    gc.collect()
    assert gone() is None


def test_a_process_has_its_own_settings_again_after_its_last_box():
    before = gc.get_threshold(), sys.getswitchinterval()
    frozen = gc.get_freeze_count()
    with ControlBox(pace="lockstep", port_base=None):
        with ControlBox(pace="lockstep", port_base=None):
            assert (gc.get_threshold(), sys.getswitchinterval()) != before
        assert (gc.get_threshold(), sys.getswitchinterval()) != before
    assert (gc.get_threshold(), sys.getswitchinterval()) == before
    assert gc.get_freeze_count() <= frozen  # what was frozen before may have gone


def test_a_process_that_only_serves_collects_nothing_of_what_existed_before():
    before = gc.get_freeze_count()
    made = [[k] for k in range(10_000)]
    freeze_existing_objects()
    assert gc.get_freeze_count() >= before + len(made)
