"""Waiting counts only while the one who waits runs."""

from hypothesis import given
from hypothesis import strategies as st

from ur_hil.patience import LONGEST_STEP, Patience


@given(st.lists(st.floats(0.0, LONGEST_STEP), max_size=50))
def test_who_looks_often_counts_the_time_that_passes(steps):
    patience, now = Patience(), 1e6
    assert patience.spent(now) == 0.0
    for step in steps:
        now += step
        spent = patience.spent(now)
    assert abs((spent if steps else 0.0) - (now - 1e6)) < 1e-6


@given(st.lists(st.floats(0.0, 1e6), min_size=1, max_size=50))
def test_a_jump_of_the_clock_counts_as_one_step_at_most(steps):
    patience, now = Patience(), 0.0
    patience.spent(now)
    for step in steps:
        before, now = patience.spent(now), now + step
        assert before <= patience.spent(now) <= before + LONGEST_STEP + 1e-9


def test_a_new_wait_begins_with_its_first_look():
    patience = Patience()
    patience.spent(0.0)
    assert patience.spent(0.05) == 0.05
    patience.restart()
    assert patience.spent(10.0) == 0.0
