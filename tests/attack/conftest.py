"""The attacks of a file share a box of an arm, but for those that want one of their own."""

import math
import shutil
from contextlib import ExitStack

import pytest
from attack_record import served


@pytest.fixture(scope="module", params=["ur3"])
def box_for(request):
    """Serve an attack a box with an empty folder of programs; it must end when it is told to."""
    with ExitStack() as stack:
        shared = []

        def serve(attack):
            if attack.is_special:
                return stack.enter_context(served(attack, request.param))
            if not shared or shared[-1].process.poll() is not None:
                shared.append(stack.enter_context(served(attack, request.param)))
            for path in shared[-1].programs.iterdir():
                shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
            shared[-1].forget_peaks()
            return shared[-1]

        yield serve
        assert all(box.stop() < math.inf for box in shared if box.process.poll() is None)
