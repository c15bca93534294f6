"""Twins: the scripts that PolyScope saves beside programs, as of the last save. PolyScope never reads them.

A script of that name can be the user's own, which a node of the program reads. Source of the marks: scripts
that PolyScope saved, and software that saved the programs beside them.
"""

from __future__ import annotations

import re

_DEF = re.compile(r"\s*def \w+\(\):")
_LABEL = re.compile(r'^\s*\$ \d+ "', re.MULTILINE)
# Text in the header -> the software that writes it; the first that is found.
_MARKS = (
    ("_hidden_verificationVariable", "5.12 or later"),
    ("set_target_payload", "5.10 or later"),
    ("set_tool_communication", "5.x"),
    ("set_tool_voltage", "3.x"),
)


def is_twin(text: str) -> bool:
    """True for a script that PolyScope made: a program with labels."""
    return _DEF.match(text) is not None and _LABEL.search(text) is not None


def software_of(text: str) -> str:
    """Return the software that saved a twin, as far as its header shows it."""
    return next((software for mark, software in _MARKS if mark in text), "unknown")
