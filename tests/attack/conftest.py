"""The attacks of a file share a box of a kind, but for those that want one of their own."""

import math
import shutil
from contextlib import ExitStack

import pytest
from attack_record import served
from box_under_attack import KINDS


@pytest.fixture(scope="module")
def box_for():
    """Serve an attack a box with an empty folder of programs; it must end when it is told to."""
    with ExitStack() as stack:
        shared = {}

        def serve(attack):
            kind = KINDS[attack.kinds[0]]
            if attack.is_special:
                return stack.enter_context(served(attack, kind))
            if kind not in shared or shared[kind].process.poll() is not None:
                shared[kind] = stack.enter_context(served(attack, kind))
            for path in shared[kind].programs.iterdir():
                shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
            return shared[kind]

        yield serve
        assert all(box.stop() < math.inf for box in shared.values() if box.process.poll() is None)
