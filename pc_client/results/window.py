"""The window on recordings, a process of its own: `ur_pendant` imports this package, not the reverse."""

import atexit
import json
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from pc_client.errors import RecordingError


def view_command(files: Sequence[Path], port: int, save: Path | None = None) -> list[str]:
    """The command that shows recordings, or saves a page. ModuleNotFoundError without viser."""
    if find_spec("viser") is None:
        raise ModuleNotFoundError("No module named 'viser'", name="viser")
    options = {"files": [*map(str, files)], "port": port, "save": None if save is None else str(save)}
    return [sys.executable, "-m", "ur_pendant", json.dumps(options)]


def open_window(*files: Path) -> str:
    """Show recordings until this program ends; return where.

    Raises:
        RecordingError: the window did not open.
    """
    command = view_command(files, 0)
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
    atexit.register(process.terminate)
    assert process.stdout is not None
    address = process.stdout.readline().partition("http")
    if not address[1]:
        raise RecordingError(f"the window on {', '.join(map(str, files))} did not open: see the line before")
    return "".join(address[1:]).strip()
