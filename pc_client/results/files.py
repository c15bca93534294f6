"""Files of results: a folder, and what stands in it by name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from pc_client.errors import RecordingError

__all__ = ["write_files"]


def write_files(folder: Path, contents: Mapping[str, str | bytes]) -> tuple[Path, ...]:
    """Write texts (UTF-8) and bytes into files of a folder; folders that are missing are made.

    Raises:
        RecordingError: a file cannot be written.
    """
    paths = tuple(folder / name for name in contents)
    for path, content in zip(paths, contents.values(), strict=True):
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content.encode() if isinstance(content, str) else content)
        except OSError as error:
            raise RecordingError(f"cannot write {path}: {error.strerror or error}") from error
    return paths
