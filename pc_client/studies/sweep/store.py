"""The result store: what came of the cases of a sweep, in memory and on disk.

    DIR/cases/<identity>.json            what the case is and what came of it
    DIR/recordings/<identity>/*.mcap     its recordings, when they are kept
    DIR/incidents/<identity>/*.mcap      recordings of a case that failed
    DIR/sweep.parquet, DIR/sweep.csv     the table

Each file is written in one step: a file that is there is whole, whatever ended the sweep. The name of a
case's file is the identity of the case, so a sweep with another configuration finds the cases that it shares
with this one, and a search that is repeated finds all of them.
"""

import io
import json
import os
import time
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Literal

import polars as pl

from pc_client.errors import SweepError
from pc_client.files import FILE_KINDS
from pc_client.results.tables import frame_of, to_csv
from pc_client.studies.sweep.case import COLUMNS, Case, Outcome

# A part of a file that is older [s] belongs to a sweep that was killed.
_LONGEST_WRITE = 60.0


class ResultStore:
    """The cases of one sweep and their outcomes.

    Args:
        keep_recordings: whether a case that is done must have its recordings there.
    """

    def __init__(self, path: Path, keep_recordings: bool) -> None:
        self.path = path
        self._keep_recordings = keep_recordings
        self._cases: dict[str, Case] = {}
        self._outcomes: dict[str, Outcome] = {}

    @property
    def n_settled(self) -> int:
        """Cases with an outcome."""
        return len(self._outcomes)

    def prepare(self) -> None:
        """Make the folder, find out now whether it can be written, and remove what a killed sweep has left.

        Raises:
            SweepError: it cannot.
        """
        self.write("cases/.writable", b"").unlink(missing_ok=True)
        for folder in ("cases", "recordings", "incidents"):
            for partial in (self.path / folder).rglob("*.part"):
                with suppress(OSError):  # another sweep into this folder has removed it
                    if time.time() - partial.stat().st_mtime > _LONGEST_WRITE:
                        partial.unlink()

    def waiting(self, cases: Sequence[Case]) -> list[Case]:
        """Add cases to the table, in this order; returns those of which no outcome is known.

        A case that failed in an earlier call is tried again: the robot may answer now. So is one whose
        recordings shall stay now.
        """
        for case in cases:
            self._cases[case.identity] = case
            if case.identity not in self._outcomes and (outcome := self._load(case)) is not None:
                self._outcomes[case.identity] = outcome
        return [case for case in cases if case.identity not in self._outcomes]

    def settle(self, case: Case, outcome: Outcome) -> None:
        """Keep what came of a case; its own file comes last and makes it count.

        Raises:
            SweepError: the disk is full, the folder has gone.
        """
        folder = case.incidents if outcome.status == "failed" else f"recordings/{case.identity}"
        for name, content in outcome.recordings:
            self.write(f"{folder}/{name}", content)
        facts = {
            "case": case.content(),
            "status": outcome.status,
            "error": outcome.error,
            "rows": [dict(row) for row in outcome.rows],
        }
        self.write(_case_file(case), (json.dumps(facts, indent=1, allow_nan=False) + "\n").encode())
        self._outcomes[case.identity] = replace(outcome, recordings=())

    def table(self, cases: Iterable[Case] | None = None) -> pl.DataFrame:
        """The table of some cases, or of all, as far as it is known.

        A case that is done has a row for each repetition, any other case has one.
        """
        return frame_of(
            (
                {"case": case.identity, "status": known.status, "error": known.error, **case.factors(), **row}
                for case in (self._cases.values() if cases is None else cases)
                if (known := self._outcomes.get(case.identity)) is not None
                for row in known.rows or ({},)
            ),
            COLUMNS,
        )

    def write_table(self, format: Literal["parquet", "csv"]) -> Path:
        """Write the table; the same rows give the same bytes. Parquet has the texts of `COLUMNS` as metadata.

        Raises:
            SweepError: it cannot be written.
        """
        table = self.table()
        if format == "csv":
            return self.write("sweep.csv", to_csv(table).encode())
        page = io.BytesIO()
        table.write_parquet(page, metadata={column.name: column.text for column in COLUMNS})
        return self.write("sweep.parquet", page.getvalue())

    def write(self, name: str, content: bytes) -> Path:
        """Write one file of the folder in one step; returns its path, SweepError if it cannot be written."""
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

    def _load(self, case: Case) -> Outcome | None:
        """What came of a case in an earlier call; None when it has to run (again)."""
        try:
            stored = json.loads(FILE_KINDS["outcome"].read_bytes(self.path / _case_file(case)))
            outcome = Outcome(stored["status"], stored["error"], tuple(stored["rows"]))
        except (SweepError, ValueError, KeyError, TypeError, RecursionError):  # not there, or not ours
            return None
        if outcome.status == "failed":
            return None
        if self._keep_recordings and outcome.status == "done":
            folder = self.path / "recordings" / case.identity
            if len(list(folder.glob("*.mcap"))) < case.repeat:
                return None
        return outcome


def _case_file(case: Case) -> str:
    return f"cases/{case.identity}.json"
