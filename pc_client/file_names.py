"""Names from files and archives of others, as names of files in one folder, on any system."""

from __future__ import annotations

import re
from pathlib import PurePath

MOST_BYTES = 100
"""Longest name in UTF-8; endings such as `_r12.mcap` come behind it."""

# Of the name of a recording, so that a number has room behind it.
_MOST_TAKEN = 80
_NOT_IN_NAMES = frozenset('/\\:*?"<>|')
# Devices of Windows, with any ending.
_RESERVED = re.compile(r"(?:CON|PRN|AUX|NUL|COM[0-9]|LPT[0-9])(?:\..*)?", re.IGNORECASE)

ALLOWED = (
    f"1 to {MOST_BYTES} bytes of printed characters without {' '.join(sorted(_NOT_IN_NAMES))}, "
    "no dot, minus or blank at the beginning, no dot or blank at the end, not CON, NUL and the like"
)


def is_file_name(name: str) -> bool:
    """Return whether a file of that name lies in the folder where it is made, on any system."""
    return (
        name.isprintable()
        and 0 < len(name.encode()) <= MOST_BYTES
        and not name.startswith((".", "-", " "))
        and not name.endswith((".", " "))
        and _NOT_IN_NAMES.isdisjoint(name)
        and not _RESERVED.fullmatch(name)
    )


def as_file_name(path: str, otherwise: str) -> str:
    """Return a file name like the last part of a path, without its ending.

    Args:
        path: of a file, or of a part of an archive.
        otherwise: taken if nothing is left of it.
    """
    name = re.sub(r"[^A-Za-z0-9_-]+", "_", PurePath(path).stem).lstrip("-")[:_MOST_TAKEN].strip("_")
    return name if is_file_name(name) else otherwise
