"""Files from elsewhere: how much of each kind is read, and one kind of error for all that is wrong with it.

A file beyond its limit is refused before its content is in memory. Only regular files are read: a pipe that
nobody writes to would be waited for without an end.
"""

import stat
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from ur_hil.records import checked

MIB = 1 << 20
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class FileKind:
    """What is read of one kind of file.

    Attributes:
        most_bytes: a longer file is refused.
        error: what is raised for a file of this kind.
        reason: where the limit comes from.
    """

    most_bytes: int
    error: type[Exception]
    reason: str

    def read_bytes(self, path: Path) -> bytes:
        """The content of a file.

        Raises:
            Exception: of the type `error`: it cannot be read, is no regular file, or is too long.
        """
        try:
            if not stat.S_ISREG(path.stat().st_mode):
                raise self.error(f"{path}: cannot be read (no regular file); give a file")
            with path.open("rb") as file:
                content = file.read(self.most_bytes + 1)
        except OSError as error:
            raise self.error(
                f"{path}: cannot be read ({error.strerror or error}); give a file that exists"
            ) from error
        except ValueError as error:  # a zero byte in the path
            raise self.error(f"{str(path)!r}: cannot be read ({error}); give a file that exists") from error
        if len(content) > self.most_bytes:
            raise self.error(f"{path}: longer than {self.most_bytes / MIB:g} MiB; give a shorter file")
        return content

    def read_text(self, path: Path) -> str:
        """The text of a file; UTF-8, line ends of any system.

        Raises:
            Exception: as `read_bytes`, or it is not UTF-8.
        """
        content = self.read_bytes(path)
        try:
            return content.decode("utf-8").replace("\r\n", "\n")
        except UnicodeDecodeError as error:
            raise self.error(
                f"{path}: byte {error.start} is not UTF-8; save the file as UTF-8 text"
            ) from error

    def parse_toml(self, text: str, source: str) -> dict[str, Any]:
        """The top table of a TOML text; `source` is the file's name, for messages.

        Raises:
            Exception: of the type `error`: not TOML.
        """
        try:
            return tomllib.loads(text)
        except (ValueError, RecursionError) as error:  # ValueError: also of a number with thousands of digits
            raise self.error(f"{source}: not TOML: {error}") from error

    def read_toml(self, path: Path) -> dict[str, Any]:
        """The top table of a TOML file; errors as `read_text` and `parse_toml`."""
        return self.parse_toml(self.read_text(path), str(path))

    def read_record(self, path: Path, kind: type[T]) -> T:
        """The record of a TOML file, of a class made by `ur_hil.records.record`.

        Raises:
            Exception: as `read_toml`, or a field is wrong.
        """
        return checked(kind, self.read_toml(path), str(path), self.error)
