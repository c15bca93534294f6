"""Many clients, and clients that ask for much: a served box in its own process lives, answers, moves and lets go of all."""

import pytest
from attack_record import withstands
from attacks_clients import CLIENTS


@pytest.mark.parametrize("attack", CLIENTS.short(), ids=str)
def test_the_box_withstands(attack, box_for):
    assert withstands(attack, box_for(attack), 0.5) == []
