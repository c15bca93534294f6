"""Running programs pay for what they do: a served box in its own process lives, answers, moves and lets go of all."""

import pytest
from attack_record import withstands
from attacks_scripts import SCRIPTS


@pytest.mark.parametrize("attack", SCRIPTS.short(), ids=str)
def test_the_box_withstands(attack, box_for):
    assert withstands(attack, box_for(attack), 0.5) == []
