"""What attacks do, in a moment: a served box in its own process lives, answers, moves, keeps its mode and lets go of all; an innocent client misses no cycle."""

import json
import math
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack, nullcontext
from pathlib import Path

import pytest
from attack_record import Attack, attacked, served
from attack_table import SECTIONS, described
from box_under_attack import KINDS, BoxUnderAttack, Kind

SECONDS = 0.1
# Of each section what costs little; `make nightly` runs the others.
TESTED = {
    "resets",
    "endless text",
    "long loops",
    "flooded inboxes",
    "pipelined http",
    "unread streams",
    "paths that lead out",
    "scripts of web pages",
    "noise",
    "endless lines of a gripper",
    "calls that never end",
    "ten pages",
}
Serve = Callable[[Attack], BoxUnderAttack]


@pytest.fixture(scope="module")
def box_for() -> Iterator[Serve]:
    """Serve an attack the box of its kind, with an empty folder of programs."""
    with ExitStack() as stack:
        boxes: dict[Kind, BoxUnderAttack] = {}

        def serve(attack: Attack) -> BoxUnderAttack:
            kind = KINDS[attack.kinds[0]]
            if kind not in boxes or boxes[kind].process.poll() is not None:
                boxes[kind] = stack.enter_context(served(attack, kind))
            for path in boxes[kind].programs.iterdir():
                shutil.rmtree(path) if path.is_dir() else path.unlink()
            return boxes[kind]

        yield serve
        assert all(box.stop() < math.inf for box in boxes.values() if box.process.poll() is None)


@pytest.mark.slow
@pytest.mark.parametrize(
    "attack",
    [
        pytest.param(attack, id=attack.name, marks=() if attack.name in TESTED else pytest.mark.nightly)
        for section in SECTIONS
        for attack in section.attacks
        if attack.is_short
    ],
)
def test_the_box_withstands(attack: Attack, box_for: Serve) -> None:
    own = served(attack, KINDS[attack.kinds[0]]) if attack.unread_log else nullcontext(box_for(attack))
    with own as box:
        assert attacked(attack, box, SECONDS).problems == ()


def test_each_class_of_attacks_is_tested() -> None:
    assert all(TESTED & {attack.name for attack in section.attacks} for section in SECTIONS)


def test_the_page_describes_all_attacks_in_the_words_of_their_functions() -> None:
    found = json.loads(Path(__file__).with_name("results.json").read_text())
    assert found["attacks"] == described(), "python tests/attack, or one attack by its name"
