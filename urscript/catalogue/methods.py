"""The methods that values have in later software: `list.append(x)` and its like.

None is modelled; with the table, the box reports that instead of an unknown method. Source: e-Series script
directory, chapter Lists and Structs.
"""

from __future__ import annotations

from collections.abc import Mapping

from .versions import Version, releases

SINCE = releases(None, "5.15", "10.0")

_LIST = "append extend insert pop remove clear slice length capacity excess_capacity to_string"
_MATRIX = "get_row get_column shape to_string"

METHODS: Mapping[str, frozenset[str]] = {
    "list": frozenset(_LIST.split()),
    "matrix": frozenset(_MATRIX.split()),
}
"""Type of a value -> names of its methods. Structs have some too, but no program can make one here."""


def methods_of(version: Version) -> Mapping[str, frozenset[str]]:
    """The methods that software of this version knows."""
    first = SINCE.get(version.generation)
    return METHODS if first is not None and first <= version else {}
