"""What attacks do, in a moment: a served box in its own process lives, answers, moves, keeps its mode and lets go of all; an innocent client misses no cycle."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from attack_record import Attack, attacked
from attack_table import SECTIONS, described
from box_under_attack import BoxUnderAttack

SECONDS = 0.1


@pytest.mark.slow
@pytest.mark.parametrize(
    "attack", [attack for section in SECTIONS for attack in section.attacks if attack.is_short], ids=str
)
def test_the_box_withstands(attack: Attack, box_for: Callable[[Attack], BoxUnderAttack]) -> None:
    assert attacked(attack, box_for(attack), SECONDS).problems == ()


def test_the_page_describes_all_attacks_in_the_words_of_their_functions() -> None:
    found = json.loads(Path(__file__).with_name("results.json").read_text())
    assert found["attacks"] == described(), "python tests/attack, or one attack by its name"
