"""Files from elsewhere: how much of each kind is read, and one kind of error for all that is wrong with it.

`FILE_KINDS` is the only table of these limits. A file beyond its limit is refused before its content is in
memory. Only regular files are read: a pipe that nobody writes to would be waited for without an end.
"""

from __future__ import annotations

import stat
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from pc_client.errors import (
    CellError,
    ClientError,
    ControllerError,
    MovementError,
    RecordingError,
    SweepError,
)

MIB = 1 << 20


@dataclass(frozen=True, slots=True)
class FileKind:
    """What is read of one kind of file.

    Attributes:
        most_bytes: a longer file is refused.
        error: what is raised for a file of this kind.
        reason: where the limit comes from.
    """

    most_bytes: int
    error: type[ClientError]
    reason: str


FILE_KINDS: Mapping[str, FileKind] = MappingProxyType(
    {
        "recording": FileKind(256 * MIB, RecordingError, "23 minutes of rows; a movement lasts 20 at most"),
        "pen": FileKind(8 * MIB, RecordingError, "16 minutes of samples at 200 Hz, 40 characters each"),
        "movement": FileKind(8 * MIB, MovementError, "20 minutes of samples at 100 Hz, 60 characters each"),
        "cell": FileKind(MIB, CellError, "100 bodies have less than 0.1 MiB"),
        "controller": FileKind(MIB, ControllerError, "all fields have less than 0.01 MiB"),
        "sweep": FileKind(MIB, SweepError, "all keys with lists of a thousand values have less"),
        "outcome": FileKind(16 * MIB, SweepError, "99 runs of a case have less than 0.2 MiB"),
    }
)
"""All kinds of files from elsewhere. `pen` is also the limit of one file in an archive."""


def read_bytes(path: Path, kind: str) -> bytes:
    """The content of a file.

    Args:
        path: where.
        kind: a key of `FILE_KINDS`.

    Raises:
        ClientError: of the kind's type: it cannot be read, is no regular file, or is too long.
    """
    limit = FILE_KINDS[kind]
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise limit.error(f"{path}: cannot be read (no regular file); give a file")
        with path.open("rb") as file:
            content = file.read(limit.most_bytes + 1)
    except OSError as error:
        raise limit.error(
            f"{path}: cannot be read ({error.strerror or error}); give a file that exists"
        ) from error
    except ValueError as error:  # a zero byte in the path
        raise limit.error(f"{str(path)!r}: cannot be read ({error}); give a file that exists") from error
    if len(content) > limit.most_bytes:
        raise limit.error(f"{path}: longer than {limit.most_bytes / MIB:g} MiB; give a shorter file")
    return content


def read_text(path: Path, kind: str) -> str:
    """The text of a file; UTF-8, line ends of any system.

    Raises:
        ClientError: as `read_bytes`, or it is not UTF-8.
    """
    content = read_bytes(path, kind)
    try:
        return content.decode("utf-8").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise FILE_KINDS[kind].error(
            f"{path}: byte {error.start} is not UTF-8; save the file as UTF-8 text"
        ) from error


def parse_toml(text: str, source: str, kind: str) -> dict[str, Any]:
    """The top table of a TOML text.

    Args:
        text: TOML.
        source: the file's name, for messages.
        kind: a key of `FILE_KINDS`.

    Raises:
        ClientError: of the kind's type: not TOML.
    """
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # ValueError: also of a number with thousands of digits
        raise FILE_KINDS[kind].error(f"{source}: not TOML: {error}") from error
