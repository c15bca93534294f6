"""The folder of programs, and how names on the wire are paths in it.

A box keeps its programs in `/programs`, the maker's simulator in `/ursim/programs`; here both
mean the one folder, and so does a name without a folder. No name leads out of it: neither by `..`, nor by
another absolute path, nor through a link.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from ur_emulator.errors import FileMissingError

# Names of the folder on the wire; the box itself uses the first.
# Source: replies of real boxes and of the maker's simulator.
WIRE_ROOTS = (PurePosixPath("/programs"), PurePosixPath("/ursim/programs"))


@dataclass(frozen=True, slots=True)
class FoundFile:
    """A file of the folder.

    Attributes:
        path: where it is.
        wire_path: its name on the wire, `/programs/sub/x.urp`.
    """

    path: Path
    wire_path: str


class ProgramFolder:
    """The folder of `--programs`; a box may have none."""

    def __init__(self, root: Path | None) -> None:
        """Take a folder; `None` is a box without programs."""
        self.root = None if root is None else root.resolve()

    def find(self, name: str) -> FoundFile:
        """Return the file of that name.

        Args:
            name: as a client gives it: with or without folder, with quotes or without.

        Raises:
            FileMissingError: there is none, or the name leads out of the folder.
        """
        path = self.locate(name)
        if not _is_file(path):
            raise FileMissingError(f"there is no file {name!r} in {self.root}")
        return self._found(path)

    def has(self, name: str) -> bool:
        """Return whether there is a file of that name."""
        try:
            self.find(name)
        except FileMissingError:
            return False
        return True

    def locate(self, name: str) -> Path:
        """Return the path that a name stands for; nothing need exist there.

        Raises:
            FileMissingError: the name leads out of the folder, or there is no folder.
        """
        if self.root is None:
            raise FileMissingError(
                f"{name!r} cannot be found: the box has no programs, give it --programs DIR"
            )
        bare = PurePosixPath(name.strip().strip('"'))
        for wire_root in WIRE_ROOTS:
            if bare.is_relative_to(wire_root):
                bare = bare.relative_to(wire_root)
                break
        try:
            path = (self.root / bare).resolve()
            inside = not bare.is_absolute() and ".." not in bare.parts and path.is_relative_to(self.root)
        except (OSError, ValueError, RuntimeError):  # a null character, a name too long, links in a circle
            inside = False
        if not inside:
            raise FileMissingError(
                f"{name!r} lies outside of the programs folder: name a file in {self.root}"
            )
        return path

    def beside(self, file: FoundFile, name: str) -> FoundFile:
        """Return the file that `file` refers to: by a path of the box, or by a name in the same folder.

        Raises:
            FileMissingError: there is none.
        """
        try:
            return self.find(name)
        except FileMissingError:
            path = file.path.parent / PurePosixPath(name.replace("\\", "/")).name
            if not _is_file(path):
                raise
            return self._found(self.locate(str(path.relative_to(self._known_root()))))

    def _known_root(self) -> Path:
        assert self.root is not None  # there was a file in it
        return self.root

    def _found(self, path: Path) -> FoundFile:
        inside = PurePosixPath(path.relative_to(self._known_root()).as_posix())
        return FoundFile(path, str(WIRE_ROOTS[0] / inside))


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # a name that is too long, a folder that may not be looked into
        return False
