"""Property tests: `make test` runs the same few cases every time, `make nightly` and `make explore` draw new ones. None looks at a clock.

Files with slow tests come first, so that none is left for the end when the others are done. The garbage collector
rests while tests are collected, and never looks again at what exists then.
"""

import gc
import os
import signal

import pytest
from hypothesis import HealthCheck, settings

gc.disable()
# Shells start what runs in the background with Ctrl-C ignored, and so would be what the tests start.
signal.signal(signal.SIGINT, signal.default_int_handler)
_COMMON = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("fixed", _COMMON, derandomize=True, max_examples=25)
settings.register_profile("nightly", _COMMON, print_blob=True, max_examples=500)
settings.register_profile("explore", _COMMON, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "fixed"))


def pytest_xdist_auto_num_workers():
    """One process more than cores: tests with other people's clients wait for boxes in real time."""
    return (os.cpu_count() or 1) + 1


def pytest_collection_modifyitems(items):
    slow = {
        item.path for item in items if item.get_closest_marker("slow") or item.get_closest_marker("nightly")
    }
    items.sort(key=lambda item: item.path not in slow)


def pytest_collection_finish():
    gc.collect()
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="module")
def without_page():
    """A command that has run movements writes an empty page: figures take as long as the movement."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("pc_client.analysis.report.render_page", lambda *_: "")
        yield
