"""docs/urscript-tool.md has the table of warnings as it is; its programs and sessions run in test_pages.py."""

import re
from pathlib import Path

from urscript.check.warnings import RULES

PAGE = Path(__file__).parents[2] / "docs" / "urscript-tool.md"


def test_the_table_of_warnings_is_that_of_the_rules():
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    table = [line for line in lines if re.match(r"\| W\d+ \|", line)]
    assert table == [f"| {rule.code} | {rule.meaning} | {rule.reason} |" for rule in RULES]
