"""docs/security.md has all attacks, in the words of their functions."""

import json
from pathlib import Path

from attack_table import described


def test_all_attacks_are_described():
    found = json.loads(Path(__file__).with_name("results.json").read_text())
    assert found["attacks"] == described(), "python tests/attack, or one attack by its name"
