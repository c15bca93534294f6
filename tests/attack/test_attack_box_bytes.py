"""Bytes that make no sense, or never come: a served box in its own process lives, answers, moves and lets go of all."""

import pytest
from attack_record import withstands
from attacks_bytes import BYTES


@pytest.mark.parametrize("box_for", ["ur3", "ur5e"], indirect=True)
@pytest.mark.parametrize("attack", BYTES.short(), ids=str)
def test_the_box_withstands(attack, box_for):
    assert withstands(attack, box_for(attack), 0.5) == []
