"""The folder of programs, and how names on the wire are paths in it.

A box keeps its programs in `/programs`, the maker's simulator in `/ursim/programs`; here both
mean the one folder, and so does a name without a folder. No name leads out of it: neither by `..`, nor by
another absolute path, nor through a link. Everything below the folder is read and written here.
"""

import errno
import os
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import FileMissingError, ProgramFileError

# Names of the folder on the wire; the box itself uses the first.
# Source: replies of real boxes and of the maker's simulator.
WIRE_ROOTS = (PurePosixPath("/programs"), PurePosixPath("/ursim/programs"))
# A program is one of these files: nodes of PolyScope, a text, a program of PolyScope X.
PROGRAM_SUFFIX, SCRIPT_SUFFIX, URPX_SUFFIX = ".urp", ".script", ".urpx"
# A file while it is written; every write removes what a killed process has left in the same folder.
PART_NAME = "ur-emulator.part"
_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW
# A pipe without a writer is not waited for, a terminal does not become ours.
_READ = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_NOCTTY
_CREATE = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW


class ProgramFolder:
    """The folder of `--programs`; a box may have none. Its files are paths from it on, without links."""

    def __init__(self, root: Path | None) -> None:
        """Take a folder; `None` is a box without programs."""
        self._root = None if root is None else root.resolve()

    @property
    def exists(self) -> bool:
        """Whether the box has a folder."""
        return self._root is not None

    @staticmethod
    def wire_path(file: PurePosixPath) -> str:
        """Return the name of a file on the wire, `/programs/sub/x.urp`."""
        return str(WIRE_ROOTS[0] / file)

    def find(self, name: str) -> PurePosixPath:
        """Return the file of that name, as a client gives it: with or without folder, with or without quotes.

        FileMissingError if there is none, or the name leads out of the folder.
        """
        return self._locate(name, Path.is_file, "file")

    def has(self, name: str) -> bool:
        """Return whether there is a file of that name."""
        try:
            self.find(name)
        except FileMissingError:
            return False
        return True

    def locate(self, name: str) -> PurePosixPath:
        """Return the path that a name stands for, from the folder on; nothing need exist there.

        FileMissingError if the name is too long or leads out of the folder, or there is no folder.
        """
        # Before a path is made of it: each part costs a question to the file system.
        if len(name) > BUDGETS.path_length or name.count("/") >= BUDGETS.path_parts:
            raise FileMissingError(
                f"a path of {len(name)} characters and {name.count('/') + 1} parts given: there is no file "
                f"with more than {BUDGETS.path_length} and {BUDGETS.path_parts}"
            )
        if self._root is None:
            raise FileMissingError(
                f"{name!r} cannot be found: the box has no programs, give it --programs DIR"
            )
        bare = PurePosixPath(name.strip().strip('"'))
        for wire_root in WIRE_ROOTS:
            if bare.is_relative_to(wire_root):
                bare = bare.relative_to(wire_root)
                break
        try:
            path = (self._root / bare).resolve()
            if not bare.is_absolute() and ".." not in bare.parts and path.is_relative_to(self._root):
                return PurePosixPath(path.relative_to(self._root))
        except (OSError, ValueError, RuntimeError):  # a null character, a name too long, links in a circle
            pass
        raise FileMissingError(f"{name!r} lies outside of the programs folder: name a file in it")

    def locate_folder(self, name: str) -> PurePosixPath:
        """Return the path of a folder in this folder, from there on; FileMissingError if there is none."""
        return self._locate(name, Path.is_dir, "folder")

    def beside(self, file: PurePosixPath, name: str) -> PurePosixPath:
        """Return the file that `file` refers to: by a path of the box, or by a name in the same folder.

        FileMissingError if there is none.
        """
        if self.has(name):
            return self.find(name)
        return self.find(str(file.parent / PurePosixPath(name.replace("\\", "/")).name))

    def read(self, file: PurePosixPath, most: int) -> bytes:
        """Return what is in a file; ProgramFileError if it has more than `most` bytes, or cannot be read."""
        with self._opened(file.parent, f"{file.name} cannot be read") as folder:
            descriptor = os.open(file.name, _READ, dir_fd=folder)
            with open(descriptor, "rb") as opened:
                if not stat.S_ISREG(os.fstat(descriptor).st_mode):
                    raise OSError(errno.EINVAL, "it is not a file")
                data = opened.read(most + 1)
        if len(data) > most:
            raise ProgramFileError(f"{file.name} has more than {most} bytes")
        return data

    def write(self, inside: PurePosixPath, data: bytes) -> None:
        """Write a file in one step, in place of what has its name.

        No part of it stays after a ProgramFileError.
        """
        with self._opened(inside.parent, f"{inside.name} cannot be written") as folder:
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

    def make_folder(self, name: str) -> PurePosixPath:
        """Make a folder directly in this folder, if there is none of that name; return its path.

        ProgramFileError if it cannot be made, or a link of that name leads out of this folder.
        """
        with self._opened(PurePosixPath(), f"{name} cannot be made") as root, suppress(FileExistsError):
            os.mkdir(name, dir_fd=root)
        return self.locate_folder(name)

    def sizes(self) -> Iterator[tuple[PurePosixPath, int]]:
        """Yield path and size [bytes] of each regular file, those in inner folders too.

        Links and folders that cannot be read are left out. ProgramFileError if there are too many files and
        folders.
        """
        root, most = self._known_root(), BUDGETS.folder_files
        waiting = [PurePosixPath()]
        for inside in waiting:
            with suppress(OSError), _folder_below(root, inside) as folder, os.scandir(folder) as entries:
                for entry in entries:
                    most -= 1
                    if most < 0:
                        raise ProgramFileError("the programs folder has too many files to write another")
                    if entry.is_dir(follow_symlinks=False):
                        waiting.append(inside / entry.name)
                    elif entry.is_file(follow_symlinks=False):
                        yield inside / entry.name, entry.stat(follow_symlinks=False).st_size

    def _locate(self, name: str, is_kind: Callable[[Path], bool], kind: str) -> PurePosixPath:
        inside = self.locate(name)
        with suppress(OSError):  # a name that is too long, a folder that may not be looked into
            if is_kind(self._known_root() / inside):
                return inside
        raise FileMissingError(f"there is no {kind} {name!r} in the programs folder")

    @contextmanager
    def _opened(self, inside: PurePosixPath, problem: str) -> Iterator[int]:
        """Open a folder below this one; an OSError becomes a ProgramFileError with the problem."""
        try:
            with _folder_below(self._known_root(), inside) as folder:
                yield folder
        except OSError as error:
            raise ProgramFileError(f"{problem}: {error.strerror or error}") from None

    def _known_root(self) -> Path:
        if self._root is None:
            raise FileMissingError("the box has no programs, give it --programs DIR")
        return self._root


# Files are read and written without following a link. Paths are resolved before, so that links which stay in
# the folder work. What they resolve to is opened folder by folder, each from the one before it: a link that
# somebody puts there in between is an error and leads nowhere.


@contextmanager
def _folder_below(root: Path, inside: PurePosixPath) -> Iterator[int]:
    descriptor = os.open(root, _FOLDER)
    try:
        for part in inside.parts:
            outer, descriptor = descriptor, os.open(part, _FOLDER, dir_fd=descriptor)
            os.close(outer)
        yield descriptor
    finally:
        os.close(descriptor)
