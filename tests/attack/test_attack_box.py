"""What attacks do, in a moment: a served box in its own process lives, answers, moves, keeps its mode and lets go of all; an innocent client misses no cycle."""

import pytest
from attack_record import attacked
from attack_table import SECTIONS

SECONDS = 0.2


@pytest.mark.slow
@pytest.mark.parametrize(
    "attack", [attack for section in SECTIONS for attack in section.attacks if attack.is_short], ids=str
)
def test_the_box_withstands(attack, box_for):
    assert attacked(attack, box_for(attack), SECONDS).problems == ()
