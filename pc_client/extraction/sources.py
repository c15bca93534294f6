"""The recordings in a file, a folder or an archive."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from pc_client.errors import RecordingError
from pc_client.extraction.files import parse_pen
from pc_client.extraction.recording import PenRecording
from pc_client.input_files import FILE_KINDS
from ur_hil.input_files import MIB

__all__ = ["PenSource", "contents", "pen_sources", "read_recording"]

#: Files that are taken for recordings in a folder or an archive; a file that is named itself is always.
_SUFFIXES = (".csv", ".tsv", ".txt")

MOST_MEMBERS = 100_000
"""Files in one archive: three times those of Omniglot."""

_MOST_UNPACKED = 1024 * MIB
"""What the recordings of one archive say they are unpacked [bytes]; Omniglot's have some 200 MiB."""

_BROKEN_ARCHIVE = (
    zipfile.BadZipFile, zlib.error, EOFError, KeyError, NotImplementedError, RuntimeError, ValueError,
)  # fmt: skip
"""What `zipfile` raises about an archive that is damaged, locked, or of a later form."""


@dataclass(frozen=True, slots=True)
class PenSource:
    """One recording before it is read.

    Attributes:
        name: as the user gave it, or its path in the folder or archive that the user gave.
        path: file on the disk.
        member: path inside, where `path` is an archive.
    """

    name: str
    path: Path
    member: str | None = None


def pen_sources(paths: Sequence[str | Path]) -> list[PenSource]:
    """All recordings in files, folders and .zip archives, in their order.

    Raises:
        RecordingError: a folder or an archive that cannot be opened, or holds no recording. Files are only
            looked at when they are read.
    """
    return [source for path in paths for source in _sources(path)]


def contents(sources: Iterable[PenSource]) -> Iterator[tuple[PenSource, bytes | RecordingError]]:
    """Read recordings one after the other: each with its bytes, or with what is wrong with it.

    An archive is opened once for all of its recordings that follow each other.
    """
    with ExitStack() as opened:
        archive: zipfile.ZipFile | None = None
        for source in sources:
            try:
                if source.member is None:
                    yield source, FILE_KINDS["pen"].read_bytes(source.path)
                    continue
                if archive is None or archive.filename != str(source.path):
                    opened.close()
                    archive = opened.enter_context(zipfile.ZipFile(source.path))
                yield source, _unpack(archive, source.member)
            except RecordingError as error:
                yield source, error
            except OSError as error:
                yield source, RecordingError(f"{source.name}: cannot be read ({error.strerror or error})")
            except _BROKEN_ARCHIVE as error:
                yield source, RecordingError(f"{source.name}: cannot be unpacked ({error})")


def read_recording(given: str | Path, time_unit: str | None = None) -> PenRecording:
    """The one recording in a file, or at `ARCHIVE.zip:PATH`.

    Args:
        given: which.
        time_unit: of `files.TIME_UNITS`; None: found from the times.

    Raises:
        RecordingError: it cannot be read, or is a folder or an archive of many.
    """
    text = str(given)
    archive, inside, member = text.partition(".zip:")
    if inside:
        source = PenSource(member, Path(f"{archive}.zip"), member)
    elif Path(text).is_dir() or text.lower().endswith(".zip"):
        raise RecordingError(f"{text} holds many recordings: name one, a file or ARCHIVE.zip:PATH")
    else:
        source = PenSource(text, Path(text))
    ((_, content),) = contents([source])
    if isinstance(content, RecordingError):
        raise content
    return parse_pen(content, source.name, time_unit)


def _unpack(archive: zipfile.ZipFile, member: str) -> bytes:
    """One file of an archive, unpacked no further than its limit, whatever the archive says of its size.

    Raises:
        RecordingError: it is longer, or packed by a method that cannot be unpacked piece by piece.
    """
    info = archive.getinfo(member)
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise RecordingError(
            f"{member}: cannot be unpacked (method {info.compress_type}); pack it by deflate"
        )
    most = FILE_KINDS["pen"].most_bytes
    with archive.open(info) as packed:
        content = packed.read(most + 1)
    if len(content) > most:
        raise RecordingError(f"{member}: longer than {most / MIB:g} MiB unpacked; give a shorter file")
    return content


def _sources(given: str | Path) -> Iterator[PenSource]:
    path = Path(given)
    if path.is_dir():
        inside = sorted(
            file for file in path.rglob("*") if file.suffix.lower() in _SUFFIXES and file.is_file()
        )
        if not inside:
            raise RecordingError(f"{given}: no {', '.join(_SUFFIXES)} file in this folder")
        yield from (PenSource(str(file), file) for file in inside)
    elif path.suffix.lower() == ".zip":
        yield from (PenSource(member, path, member) for member in _members(path))
    else:
        yield PenSource(str(given), path)


def _members(path: Path) -> list[str]:
    try:
        with zipfile.ZipFile(path) as archive:
            files = archive.infolist()
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror or error})") from error
    except _BROKEN_ARCHIVE as error:
        raise RecordingError(f"{path}: no .zip archive ({error})") from error
    unpacked = sum(file.file_size for file in files)
    if len(files) > MOST_MEMBERS or unpacked > _MOST_UNPACKED:
        raise RecordingError(
            f"{path}: {len(files)} files of {unpacked / MIB:.0f} MiB in all; allowed are {MOST_MEMBERS} "
            f"files of {_MOST_UNPACKED / MIB:.0f} MiB: unpack what is needed"
        )
    # macOS packs a shadow of every file beside it.
    members = sorted(
        name
        for name in dict.fromkeys(file.filename for file in files)
        if PurePosixPath(name).suffix.lower() in _SUFFIXES and "__MACOSX" not in PurePosixPath(name).parts
    )
    if not members:
        raise RecordingError(f"{path}: no {', '.join(_SUFFIXES)} file in this archive")
    return members
