"""Files that the box writes for people: the log, flight reports, support files.

They go into the folder of programs, or into a temporary one that is removed with the box. What stands in them
comes from the controller: the same run writes the same bytes. Writing takes a while: the functions run in the
worker process. Name of the support file: UR dashboard documents; of the log: PolyScope's own; the rest is
ours.
"""

import fcntl
import json
import os
import re
import shutil
import stat
import tempfile
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path, PurePosixPath
from typing import Any

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import FileMissingError, ProgramFileError
from ur_emulator.machine.controller.clock import clock_time
from ur_emulator.program_files.folder import ProgramFolder

# --- A temporary folder: it goes away with the box, or, after a box was killed, when the next one is made
#
# It is locked as long as its box lives; the system drops the lock of a process that has ended for any reason.

_PREFIX = "ur-emulator-box-reports-"
# What `mkdtemp` gives its folders.
_MODE = 0o700


class TemporaryFolder:
    """A folder for one box."""

    def __init__(self) -> None:
        """Make it; OSError if that fails."""
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


# --- Reports

REPORT_KINDS = ("controller", "software", "system")
LOG_NAME = "log_history.txt"
REPORT_FOLDER = "flightreports"
_MAX_SAME_SECOND = 1000
_FLIGHT_REPORT = re.compile(r"flightreport_([0-9]{1,9})\.zip")
# Flight reports, and support files of any box.
_REPORT = re.compile(r"flightreport_[0-9]{1,9}\.zip|ur_[0-9]+_[0-9_-]+\.zip")


@dataclass(frozen=True, slots=True)
class BoxFacts:
    """Contents of a report; taken in the loop, written in the worker process.

    Attributes:
        versions: of its software and what it rests on.
        timestamp: of the last cycle [s].
        state: snapshot of that cycle, by name.
        log: all entries, a line each.
        programs: names of what is loaded.
        interpreter: log files of interpreter mode, by name.
    """

    serial_number: str
    versions: dict[str, str]
    timestamp: float
    state: dict[str, Any]
    log: str
    programs: dict[str, str] = field(default_factory=dict)
    script: str = ""
    interpreter: dict[str, str] = field(default_factory=dict)

    @property
    def time(self) -> datetime:
        """Date and time of the controller, to the second."""
        return clock_time(self.timestamp)


def save_log(folder: ProgramFolder, facts: BoxFacts) -> str:
    """Write the log, in place of what was written before; return the name of the file on the wire."""
    file = PurePosixPath(LOG_NAME)
    folder.write(file, facts.log.encode("utf-8"))
    return folder.wire_path(file)


def flight_report(folder: ProgramFolder, kind: str, facts: BoxFacts) -> str:
    """Write a flight report of one of `REPORT_KINDS`, "" for the last of them; return its number.

    ProgramFileError if there is no such kind, or the report is one too many.
    """
    if kind not in ("", *REPORT_KINDS):
        raise ProgramFileError(f"Unknown report type: {kind}")
    place = folder.make_folder(REPORT_FOLDER)
    number = 1 + max(_flight_reports(folder, place), default=0)
    contents = {"report.json": _json({"kind": kind or REPORT_KINDS[-1], "id": number}), **_contents(facts)}
    _write_report(folder, place / f"flightreport_{number}.zip", _zip(contents, facts.time))
    return str(number)


def support_file(folder: ProgramFolder, directory: str, facts: BoxFacts) -> str:
    """Write a support file, which holds all flight reports and a new one; return its name.

    The directory is in the folder of programs, as a client names it. ProgramFileError if there is none, or
    the file is one too many.
    """
    try:
        place = folder.locate_folder(directory or "?")
    except FileMissingError:
        raise ProgramFileError(f"Directory not found: {directory}") from None
    flight_report(folder, "", facts)
    contents = _all_flight_reports(folder) | _contents(facts)
    for later in range(_MAX_SAME_SECOND):  # no file takes the place of another
        stamp = f"{facts.time + timedelta(seconds=later):%Y-%m-%d_%H-%M-%S}"
        inside = place / f"ur_{facts.serial_number}_{stamp}.zip"
        if not folder.has(str(inside)):
            break
    _write_report(folder, inside, _zip(contents, facts.time))
    return inside.name


def flight_report_archive(folder: ProgramFolder, facts: BoxFacts) -> bytes:
    """Return an archive of all flight reports, b"" without one."""
    reports = _all_flight_reports(folder)
    return _zip(reports, facts.time) if reports else b""


def _all_flight_reports(folder: ProgramFolder) -> dict[str, bytes]:
    """Return the contents of all flight reports by their names in an archive."""
    reports = _flight_reports(folder, folder.make_folder(REPORT_FOLDER)).values()
    return {f"{REPORT_FOLDER}/{file.name}": folder.read(file, BUDGETS.report_bytes) for file in reports}


def _flight_reports(folder: ProgramFolder, place: PurePosixPath) -> dict[int, PurePosixPath]:
    return {
        int(match[1]): inside
        for inside, _ in folder.sizes()
        if inside.parent == place and (match := _FLIGHT_REPORT.fullmatch(inside.name))
    }


def _write_report(folder: ProgramFolder, inside: PurePosixPath, data: bytes) -> None:
    """Write a report unless it is one too many: clients must not fill the disk."""
    reports = [size for other, size in folder.sizes() if _REPORT.fullmatch(other.name)]
    if len(reports) >= BUDGETS.report_files or sum(reports) + len(data) > BUDGETS.report_bytes:
        raise ProgramFileError(
            f"the folder holds {len(reports)} reports with {sum(reports)} bytes, and may hold "
            f"{BUDGETS.report_files} with {BUDGETS.report_bytes}: remove some"
        )
    folder.write(inside, data)


def _contents(facts: BoxFacts) -> dict[str, bytes]:
    scripts = facts.interpreter | ({"program.script": facts.script} if facts.script else {})
    return {
        LOG_NAME: facts.log.encode("utf-8"),
        "versions.json": _json(facts.versions),
        "programs.json": _json(facts.programs),
        "state.json": _json(facts.state),
        **{name: text.encode("latin-1", "replace") for name, text in scripts.items()},
    }


def _json(value: Any) -> bytes:
    return (json.dumps(value, indent=2, default=list) + "\n").encode()


def _zip(files: dict[str, bytes], time: datetime) -> bytes:
    """Return an archive; equal contents are equal bytes."""
    import io
    import zipfile

    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in sorted(files.items()):
            info = zipfile.ZipInfo(name, date_time=time.timetuple()[:6])
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(info, content)
    return buffer.getvalue()
