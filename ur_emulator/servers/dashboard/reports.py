"""Files that the box writes for people: the log, flight reports, support files.

They go into the folder of programs, or into a temporary one that is removed with the box. What stands in them
comes from the controller: the same run writes the same bytes. Writing takes a while: the functions run in the
worker process. Name of the support file: UR dashboard documents; of the log: PolyScope's
own; the rest is ours.
"""

from __future__ import annotations

import json
import tempfile
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from ur_emulator.errors import FileMissingError, ProgramFileError
from ur_emulator.programs.folder import ProgramFolder

REPORT_KINDS = ("controller", "software", "system")
LOG_NAME = "log_history.txt"
REPORT_FOLDER = "flightreports"
# Date at which the controller's clock is 0: chosen, the box knows no date.
CLOCK_EPOCH = datetime(2021, 11, 30, tzinfo=UTC)
_MAX_SAME_SECOND = 1000


@dataclass(frozen=True, slots=True)
class BoxFacts:
    """Contents of a report; taken in the loop, written in the worker process.

    Attributes:
        serial_number: of the box.
        versions: of its software and what it rests on.
        timestamp: of the last cycle [s].
        state: snapshot of that cycle, by name.
        log: all entries, a line each.
        programs: names of what is loaded.
        script: of the loaded program.
    """

    serial_number: str
    versions: dict[str, str]
    timestamp: float
    state: dict[str, Any]
    log: str
    programs: dict[str, str] = field(default_factory=dict)
    script: str = ""

    @property
    def time(self) -> datetime:
        """Date and time of the controller, to the second."""
        return CLOCK_EPOCH + timedelta(seconds=int(self.timestamp))


class ReportFolder:
    """Where reports go."""

    def __init__(self, programs: ProgramFolder) -> None:
        self._root = programs.root
        self._temporary: tempfile.TemporaryDirectory[str] | None = None

    @property
    def root(self) -> Path:
        """The folder of programs; a box without one gets a temporary folder now."""
        if self._root is None:
            self._temporary = tempfile.TemporaryDirectory(prefix="ur-emulator-", ignore_cleanup_errors=True)
            self._root = Path(self._temporary.name)
        return self._root

    def close(self) -> None:
        """Remove the temporary folder, if there is one, with what was written into it."""
        if self._temporary is not None:
            self._temporary.cleanup()


def save_log(root: Path, facts: BoxFacts) -> Path:
    """Write the log, in place of what was written before; return the file."""
    return _write(root / LOG_NAME, facts.log.encode("utf-8"))


def flight_report(root: Path, kind: str, facts: BoxFacts) -> str:
    """Write a flight report; return its number.

    Args:
        root: of the reports.
        kind: one of `REPORT_KINDS`, or "" for the last of them.
        facts: its contents.

    Raises:
        ProgramFileError: there is no such kind.
    """
    if kind not in ("", *REPORT_KINDS):
        raise ProgramFileError(f"Unknown report type: {kind}")
    folder = root / REPORT_FOLDER
    folder.mkdir(exist_ok=True)
    number = 1 + max((int(p.stem.rpartition("_")[2]) for p in _reports(folder)), default=0)
    contents = {
        "report.json": _json({"kind": kind or REPORT_KINDS[-1], "id": number}),
        **_contents(facts),
    }
    _write(folder / f"flightreport_{number}.zip", _zip(contents, facts.time))
    return str(number)


def support_file(root: Path, directory: str, facts: BoxFacts) -> str:
    """Write a support file, which holds all flight reports and a new one; return its name.

    Args:
        root: of the reports.
        directory: of the folder of programs, as a client names it.
        facts: contents of the new report.

    Raises:
        ProgramFileError: there is no such directory.
    """
    try:
        place = ProgramFolder(root).locate(directory or "?")
    except FileMissingError:
        place = root / "?"  # a client must not see paths of this machine
    if not place.is_dir():
        raise ProgramFileError(f"Directory not found: {directory}")
    flight_report(root, "", facts)
    contents = {f"{REPORT_FOLDER}/{p.name}": p.read_bytes() for p in _reports(root / REPORT_FOLDER)}
    contents |= _contents(facts)
    for later in range(_MAX_SAME_SECOND):  # no file takes the place of another
        stamp = f"{facts.time + timedelta(seconds=later):%Y-%m-%d_%H-%M-%S}"
        path = place / f"ur_{facts.serial_number}_{stamp}.zip"
        if not path.exists():
            break
    return _write(path, _zip(contents, facts.time)).name


def _reports(folder: Path) -> list[Path]:
    return sorted(p for p in folder.glob("flightreport_*.zip") if p.stem.rpartition("_")[2].isdecimal())


def _contents(facts: BoxFacts) -> dict[str, bytes]:
    files = {
        LOG_NAME: facts.log.encode("utf-8"),
        "versions.json": _json(facts.versions),
        "programs.json": _json(facts.programs),
        "state.json": _json(facts.state),
    }
    if facts.script:
        files["program.script"] = facts.script.encode("latin-1", "replace")
    return files


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


def _write(path: Path, data: bytes) -> Path:
    """Write a file in one step: a reader never sees half of it."""
    partial = path.with_name(path.name + ".part")
    partial.write_bytes(data)
    partial.replace(path)
    return path
