"""Short random walks on boxes of all kinds (`make walk`: long ones)."""

import pytest
from walk import make_walk, walk
from walk_box import KINDS


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "length"),
    [("CB3 3.15", 16), *(pytest.param(kind, 24, marks=pytest.mark.nightly) for kind in KINDS)],
)
def test_a_walk_breaks_no_rule(kind: str, length: int) -> None:
    made = make_walk(kind, 1, length)
    found = walk(made)
    assert found is None, f"{kind}, step {found[0]}: {made.steps[found[0]]}: {found[1]}"
