"""The files of the client: how much is read of each kind, what is raised for a wrong one, and file names.

Names come from files and archives of others; here they become names of files in one folder, on any system.
"""

import re
from collections.abc import Mapping
from pathlib import PurePath
from types import MappingProxyType

from pc_client.errors import CellError, ControllerError, MovementError, RecordingError, SweepError
from ur_hil.input_files import MIB, FileKind

FILE_KINDS: Mapping[str, FileKind] = MappingProxyType(
    {
        "recording": FileKind(256 * MIB, RecordingError, "23 minutes of rows; a movement lasts 20 at most"),
        "pen": FileKind(8 * MIB, RecordingError, "16 minutes of samples at 200 Hz, 40 characters each"),
        "samples": FileKind(8 * MIB, MovementError, "20 minutes of samples at 100 Hz, 60 characters each"),
        "movement": FileKind(MIB, MovementError, "1000 points and strokes have less than 0.3 MiB"),
        "cell": FileKind(MIB, CellError, "100 bodies have less than 0.1 MiB"),
        "controller": FileKind(MIB, ControllerError, "all fields have less than 0.01 MiB"),
        "sweep": FileKind(MIB, SweepError, "all keys with lists of a thousand values have less"),
        "outcome": FileKind(16 * MIB, SweepError, "99 runs of a case have less than 0.2 MiB"),
    }
)
"""All kinds of files from elsewhere. `pen` is also the limit of one file in an archive."""


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
    """A file name like the last part of a path, without its ending; another where nothing is left of it."""
    name = re.sub(r"[^A-Za-z0-9_-]+", "_", PurePath(path).stem).lstrip("-")[:_MOST_TAKEN].strip("_")
    return name if is_file_name(name) else otherwise
