"""docs/security.md has all attacks, in the words of their functions."""

import json
from pathlib import Path

from attack_table import SECTIONS


def test_all_attacks_have_figures():
    rows = json.loads(Path(__file__).with_name("results.json").read_text())["attacks"]
    known = [
        (section.title, attack.name, attack.what, attack.limit)
        for section in SECTIONS
        for attack in section.attacks
    ]
    assert [(row["section"], row["name"], row["what"], row["limit"]) for row in rows] == known, "make attack"
