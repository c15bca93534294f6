"""Lets the worker process write reports about a box, with what the box knows at that time."""

import platform
from collections.abc import Callable
from typing import TypeVar

from ur_emulator.errors import ProgramFileError
from ur_emulator.host.player.player import ProgramPlayer
from ur_emulator.host.reports import report_files
from ur_emulator.host.served_box import ServedBox
from ur_emulator.host.steps import Steps
from ur_emulator.program_files.folder import ProgramFolder
from ur_hil import tool_version

T = TypeVar("T")


class ReportWriter:
    """Writes reports about a box; ProgramFileError for one that cannot be written.

    The player holds the loaded program, and the folder of programs.
    """

    def __init__(self, box: ServedBox, player: ProgramPlayer) -> None:
        self._box = box
        self._player = player
        self._folder = player.folder
        self._temporary: report_files.TemporaryFolder | None = None
        if not self._folder.exists:
            report_files.remove_left_folders()
        # Looked up now: a process without descriptors cannot do it later.
        self._versions = {
            "software": str(box.identity.software.version),
            "robot": box.identity.model,
            "emulator": tool_version(),
            "python": platform.python_version(),
        }

    def flight_report(self, kind: str = "") -> Steps[str]:
        """Write a flight report; return its number."""
        return self._written(report_files.flight_report, kind)

    def support_file(self, directory: str) -> Steps[str]:
        """Write a support file into a directory; return its name."""
        return self._written(report_files.support_file, directory)

    def save_log(self) -> Steps[str]:
        """Write the log; return the name of the file on the wire."""
        return self._written(report_files.save_log)

    def archive(self) -> Steps[bytes]:
        """Return an archive of all flight reports, b"" without one."""
        return self._written(report_files.flight_report_archive)

    def close(self) -> None:
        """Remove what was written into a temporary folder."""
        temporary, self._temporary = self._temporary, None
        if temporary is not None:
            temporary.close()

    def _written(self, write: Callable[..., T], *arguments: str) -> Steps[T]:
        """Write a report in the worker process; a box without programs gets a temporary folder now."""
        facts = self._facts()
        if not self._folder.exists:
            try:
                self._temporary = report_files.TemporaryFolder()
            except OSError as error:
                raise ProgramFileError(f"no temporary folder: {error.strerror or error}") from None
            self._folder = ProgramFolder(self._temporary.path)
        return (yield from self._box.in_worker(write, self._folder, *arguments, facts))

    def _facts(self) -> report_files.BoxFacts:
        box, player = self._box, self._player
        return report_files.BoxFacts(
            serial_number=box.identity.serial_number,
            versions=self._versions,
            timestamp=box.snapshot.timestamp,
            state=box.snapshot.as_dict(),
            log="".join(f"{entry}\n" for entry in box.log.entries),
            programs={
                "program": player.loaded.wire_path if player.loaded else "",
                "installation": player.installation.wire_path,
            },
            script=player.script,
            interpreter=dict(box.controller.state.interpreter.log.files),
        )
