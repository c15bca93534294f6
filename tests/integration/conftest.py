"""Boxes of this process. An error that ends a box's loop fails the test that used it."""

import pytest
from integration_support import free_port_base

from ur_emulator import ControlBox


@pytest.fixture
def lockstep_box():
    """A box in lockstep on free ports."""
    with ControlBox(pace="lockstep", port_base=None, seed=7) as box:
        yield box


@pytest.fixture
def realtime_box():
    """A box in real time on free ports."""
    with ControlBox(pace="realtime", port_base=None, seed=7) as box:
        yield box


@pytest.fixture
def standard_box():
    """A box in lockstep on ports that `--port-base` can name."""
    with ControlBox(pace="lockstep", port_base=free_port_base(), seed=7) as box:
        yield box
