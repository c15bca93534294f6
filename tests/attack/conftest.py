"""The attacks of a file share a box of a kind, but for those that want one of their own."""

import math
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest
from attack_record import Attack, served
from box_under_attack import KINDS, BoxUnderAttack, Kind

Serve = Callable[[Attack, Kind], BoxUnderAttack]


@pytest.fixture(scope="module")
def shared_boxes() -> Iterator[Serve]:
    """Boxes by kind; they must end when they are told to."""
    with ExitStack() as stack:
        boxes: dict[Kind, BoxUnderAttack] = {}

        def serve(attack: Attack, kind: Kind) -> BoxUnderAttack:
            if kind not in boxes or boxes[kind].process.poll() is not None:
                boxes[kind] = stack.enter_context(served(attack, kind))
            return boxes[kind]

        yield serve
        assert all(box.stop() < math.inf for box in boxes.values() if box.process.poll() is None)


@pytest.fixture
def box_for(shared_boxes: Serve) -> Iterator[Callable[[Attack], BoxUnderAttack]]:
    """Serve an attack a box with an empty folder of programs; one that is special ends with it."""
    with ExitStack() as stack:

        def serve(attack: Attack) -> BoxUnderAttack:
            kind = KINDS[attack.kinds[0]]
            if attack.is_special:
                return stack.enter_context(served(attack, kind))
            box = shared_boxes(attack, kind)
            for path in box.programs.iterdir():
                shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
            return box

        yield serve
