"""What fails in a callback ends a connection or a program, never the box: a served box in its own process lives, answers, moves and lets go of all."""

import pytest
from attack_record import withstands
from attacks_failures import FAILURES


@pytest.mark.parametrize("attack", FAILURES.short(), ids=str)
def test_the_box_withstands(attack, box_for):
    assert withstands(attack, box_for(attack), 0.5) == []
