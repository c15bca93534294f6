"""How much the client reads of each kind of file, and what it raises for one that is wrong."""

from __future__ import annotations

from collections.abc import Mapping
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
