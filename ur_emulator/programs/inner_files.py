"""Files below a folder, read and written without following a link.

Paths are resolved before, so that links which stay in the folder work. What they resolve to is opened folder
by folder, each from the one before it: a link that somebody puts there in between is an error and leads
nowhere.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath

from ur_emulator.errors import ProgramFileError

# A file while it is written; every write removes what a killed process has left in the same folder.
PART_NAME = "ur-emulator.part"
_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW
# A pipe without a writer is not waited for, a terminal does not become ours.
_READ = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_NOCTTY
_CREATE = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW


def read(root: Path, inside: PurePosixPath, most: int) -> bytes:
    """Return the first `most` bytes of a file.

    Raises:
        OSError: it cannot be read, or is no regular file.
    """
    with _opened(root, inside.parent) as folder:
        descriptor = os.open(inside.name, _READ, dir_fd=folder)
    with open(descriptor, "rb") as file:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise OSError(errno.EINVAL, "it is not a file")
        return file.read(most)


def write(root: Path, inside: PurePosixPath, data: bytes) -> None:
    """Write a file in one step, in place of what has its name.

    Raises:
        OSError: it cannot be written; no part of it stays.
    """
    with _opened(root, inside.parent) as folder:
        with suppress(FileNotFoundError):
            os.unlink(PART_NAME, dir_fd=folder)
        descriptor = os.open(PART_NAME, _CREATE, 0o666, dir_fd=folder)
        try:
            with open(descriptor, "wb") as file:
                file.write(data)
            os.replace(PART_NAME, inside.name, src_dir_fd=folder, dst_dir_fd=folder)
        except BaseException:
            with suppress(OSError):
                os.unlink(PART_NAME, dir_fd=folder)
            raise


def make_folder(root: Path, name: str) -> None:
    """Make a folder, unless something has its name.

    Raises:
        OSError: it cannot be made.
    """
    with _opened(root, PurePosixPath()) as folder, suppress(FileExistsError):
        os.mkdir(name, dir_fd=folder)


def sizes(root: Path, most: int) -> Iterator[tuple[PurePosixPath, int]]:
    """Yield path and size [bytes] of each regular file; folders that cannot be read are left out.

    Raises:
        ProgramFileError: there are more than `most` files and folders.
    """
    waiting = [PurePosixPath()]
    for inside in waiting:
        with suppress(OSError), _opened(root, inside) as folder, os.scandir(folder) as entries:
            for entry in entries:
                most -= 1
                if most < 0:
                    raise ProgramFileError("the programs folder has too many files for reports")
                if entry.is_dir(follow_symlinks=False):
                    waiting.append(inside / entry.name)
                elif entry.is_file(follow_symlinks=False):
                    yield inside / entry.name, entry.stat(follow_symlinks=False).st_size


@contextmanager
def _opened(root: Path, inside: PurePosixPath) -> Iterator[int]:
    """Open a folder below the root."""
    descriptor = os.open(root, _FOLDER)
    try:
        for part in inside.parts:
            outer, descriptor = descriptor, os.open(part, _FOLDER, dir_fd=descriptor)
            os.close(outer)
        yield descriptor
    finally:
        os.close(descriptor)
