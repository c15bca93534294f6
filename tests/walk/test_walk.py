"""Short random walks on boxes of all kinds (`make walk`: long ones)."""

import pytest
from walk import make_walk, walk
from walk_box import KINDS


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_walk_breaks_no_rule(kind: str) -> None:
    made = make_walk(kind, 1, 24)
    found = walk(made)
    assert found is None, f"{kind}, step {found[0]}: {made.steps[found[0]]}: {found[1]}"
