"""Results on disk: one small file a case, written in one step when the case is done.

    DIR/cases/<identity>.json            what the case is and what came of it
    DIR/recordings/<identity>/*.mcap     its recordings, when they are kept

A file that is there is whole, whatever ended the sweep. Its name is the identity of the case, so a sweep with
another configuration finds the cases that it shares with this one.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from pc_client.errors import SweepError
from pc_client.input_files import FILE_KINDS
from pc_client.sweep.case import Case
from pc_client.sweep.outcome import Outcome

# A part of a file that is older [s] belongs to a sweep that was killed.
_LONGEST_WRITE = 60.0


@dataclass(frozen=True, slots=True)
class SweepFolder:
    """The folder of a sweep's results.

    Attributes:
        path: where.
    """

    path: Path

    def prepare(self) -> None:
        """Make the folder, find out now whether it can be written, and remove what a killed sweep has left.

        Raises:
            SweepError: it cannot.
        """
        self.write("cases/.writable", b"")
        (self.path / "cases/.writable").unlink(missing_ok=True)
        for folder in ("cases", "recordings"):
            for partial in (self.path / folder).rglob("*.part"):
                with suppress(OSError):  # another sweep into this folder has removed it
                    if time.time() - partial.stat().st_mtime > _LONGEST_WRITE:
                        partial.unlink()

    def load(self, case: Case, keep_recordings: bool) -> Outcome | None:
        """What came of a case in an earlier call; None when it has to run (again).

        A failed case is tried again: the robot may answer now. So is one whose recordings shall stay now.
        """
        try:
            stored = json.loads(FILE_KINDS["outcome"].read_bytes(self.path / _case_file(case)))
            outcome = Outcome(stored["status"], stored["error"], tuple(stored["rows"]))
        except (SweepError, ValueError, KeyError, TypeError, RecursionError):  # not there, or not ours
            return None
        if outcome.status == "failed":
            return None
        if keep_recordings and outcome.status == "done":
            folder = self.path / _recordings(case)
            if len(list(folder.glob("*.mcap"))) < case.repeat:
                return None
        return outcome

    def store(self, case: Case, outcome: Outcome) -> None:
        """Keep what came of a case; its own file comes last and makes it count.

        Raises:
            SweepError: the disk is full, the folder has gone.
        """
        for name, content in outcome.recordings:
            self.write(f"{_recordings(case)}/{name}", content)
        facts = {
            "case": case.content(),
            "status": outcome.status,
            "error": outcome.error,
            "rows": [dict(row) for row in outcome.rows],
        }
        self.write(_case_file(case), (json.dumps(facts, indent=1, allow_nan=False) + "\n").encode())

    def write(self, name: str, content: bytes) -> Path:
        """Write one file in one step.

        Args:
            name: within the folder.
            content: all of it.

        Returns:
            Its path.

        Raises:
            SweepError: it cannot be written.
        """
        path = self.path / name
        partial = path.with_name(f"{path.name}.{os.getpid()}.part")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            try:
                partial.write_bytes(content)
                partial.replace(path)
            finally:  # Ctrl-C too leaves no part of a file
                partial.unlink(missing_ok=True)
        except OSError as error:
            raise SweepError(
                f"cannot write {path}: {error.strerror or error}; make room or give another "
                "folder with --out; cases that are done are kept"
            ) from error
        return path


def table_rows(outcomes: Iterable[tuple[Case, Outcome]]) -> list[dict[str, object]]:
    """The rows of the table: a done case has one a repetition, any other case one.

    Args:
        outcomes: in the order of the table.
    """
    return [
        {"case": case.identity, "status": outcome.status, "error": outcome.error, **case.factors(), **row}
        for case, outcome in outcomes
        for row in outcome.rows or ({},)
    ]


def _case_file(case: Case) -> str:
    return f"cases/{case.identity}.json"


def _recordings(case: Case) -> str:
    return f"recordings/{case.identity}"
