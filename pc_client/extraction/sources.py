"""Which recordings a user means by a file, a folder or an archive."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from pc_client.errors import RecordingError

__all__ = ["PenSource", "contents", "pen_sources"]

#: Files that are taken for recordings in a folder or an archive; a file that is named itself is always.
SUFFIXES = (".csv", ".tsv", ".txt")


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
    """All recordings that are meant by files, folders and .zip archives, in their order.

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
                    yield source, source.path.read_bytes()
                    continue
                if archive is None or archive.filename != str(source.path):
                    opened.close()
                    archive = opened.enter_context(zipfile.ZipFile(source.path))
                yield source, archive.read(source.member)
            except OSError as error:
                yield source, RecordingError(f"{source.name}: cannot be read ({error.strerror or error})")
            except (zipfile.BadZipFile, zlib.error, KeyError, NotImplementedError, RuntimeError) as error:
                yield source, RecordingError(f"{source.name}: cannot be unpacked ({error})")


def _sources(given: str | Path) -> Iterator[PenSource]:
    path = Path(given)
    if path.is_dir():
        inside = sorted(
            file for file in path.rglob("*") if file.suffix.lower() in SUFFIXES and file.is_file()
        )
        if not inside:
            raise RecordingError(f"{given}: no {', '.join(SUFFIXES)} file in this folder")
        yield from (PenSource(str(file), file) for file in inside)
    elif path.suffix.lower() == ".zip":
        yield from (PenSource(member, path, member) for member in _members(path))
    else:
        yield PenSource(str(given), path)


def _members(path: Path) -> list[str]:
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror or error})") from error
    except zipfile.BadZipFile as error:
        raise RecordingError(f"{path}: no .zip archive ({error})") from error
    # macOS packs a shadow of every file beside it.
    members = sorted(
        name
        for name in names
        if PurePosixPath(name).suffix.lower() in SUFFIXES and "__MACOSX" not in PurePosixPath(name).parts
    )
    if not members:
        raise RecordingError(f"{path}: no {', '.join(SUFFIXES)} file in this archive")
    return members
