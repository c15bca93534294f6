"""A temporary folder that goes away: with the box, or, after a box was killed, when the next one is made.

Each is locked as long as its box lives; the system drops the lock of a process that has ended for any reason.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import stat
import tempfile
from contextlib import suppress
from pathlib import Path

_PREFIX = "ur-emulator-box-reports-"
# What `mkdtemp` gives its folders.
_MODE = 0o700


class TemporaryFolder:
    """A folder for one box.

    Attributes:
        path: where it is.
    """

    def __init__(self) -> None:
        """Make it.

        Raises:
            OSError: it cannot be made.
        """
        while True:
            self.path = Path(tempfile.mkdtemp(prefix=_PREFIX))
            # Before it is locked, another box may take it for one that was left, and remove it.
            with suppress(FileNotFoundError):
                self._lock = _lock(self.path, fcntl.LOCK_EX)
                if self.path.exists():
                    return
                os.close(self._lock)

    def close(self) -> None:
        """Remove it with all that is in it."""
        shutil.rmtree(self.path, ignore_errors=True)
        os.close(self._lock)


def remove_left_folders() -> None:
    """Remove the folders of boxes of this user that were killed."""
    with suppress(OSError):
        for path in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
            with suppress(OSError):  # its box lives, or it is not ours
                lock = _lock(path, fcntl.LOCK_EX | fcntl.LOCK_NB)
                try:
                    found = os.fstat(lock)
                    if (found.st_uid, stat.S_IMODE(found.st_mode)) == (os.getuid(), _MODE):
                        shutil.rmtree(path, ignore_errors=True)
                finally:
                    os.close(lock)


def _lock(path: Path, how: int) -> int:
    descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(descriptor, how)
    except OSError:
        os.close(descriptor)
        raise
    return descriptor
