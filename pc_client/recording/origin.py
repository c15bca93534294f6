"""The words for where data come from: a simulated arm, a real one, or unknown.

Everything that shows data takes them from here. Only data of an arm that is known to be real bear no mark.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

Source: TypeAlias = Mapping[str, str | bool | None]
"""Columns of a table that say whose data it holds: `robot`, `software`, `serial`, `simulated`."""


@dataclass(frozen=True, slots=True)
class Origin:
    """One of the three.

    Attributes:
        name: in one phrase.
        mark: stands on every figure; empty for a real arm.
        prefix: stands before a robot in titles.
        says: a sentence for the page.
    """

    name: str
    mark: str
    prefix: str
    says: str


_UNKNOWN = "NOT KNOWN whether real or simulated"
_ORIGINS = {
    True: Origin("SIMULATED", "SIMULATED", "SIMULATED ", "SIMULATED: an emulated arm, no real robot moved"),
    False: Origin("real arm", "", "", "measured on a real arm"),
    None: Origin(
        _UNKNOWN,
        _UNKNOWN,
        f"{_UNKNOWN}: ",
        f"{_UNKNOWN}: the robot reported neither a serial number nor that it is simulated",
    ),
}


def origin_of(simulated: bool | None) -> Origin:
    """Return the words for `Provenance.simulated`: True, False, or None where it is not known."""
    return _ORIGINS[simulated]
