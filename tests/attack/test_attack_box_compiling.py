"""What waits for the compiler, files and reports has limits: a served box in its own process lives, answers, moves and lets go of all."""

import pytest
from attack_record import withstands
from attacks_compiling import COMPILING


@pytest.mark.parametrize("attack", COMPILING.short(), ids=str)
def test_the_box_withstands(attack, box_for):
    assert withstands(attack, box_for(attack), 0.5) == []
