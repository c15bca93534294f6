"""Which cases of a sweep are settled, and which are still to run."""

from __future__ import annotations

from collections.abc import Sequence

from pc_client.sweep.case import Case
from pc_client.sweep.folder import SweepFolder, table_rows
from pc_client.sweep.outcome import Outcome


class ResultStore:
    """The cases of one sweep and what came of them, in memory and on disk.

    Args:
        cases: all of them, in the order of the table.
        folder: where outcomes are kept; those of earlier calls count.
        keep_recordings: whether recordings are to be there too.
    """

    def __init__(self, cases: Sequence[Case], folder: SweepFolder, keep_recordings: bool) -> None:
        self._cases = {case.identity: case for case in cases}
        self._folder = folder
        self._outcomes: dict[str, Outcome] = {}
        for identity, case in self._cases.items():
            outcome = folder.load(case, keep_recordings)
            if outcome is not None:
                self._outcomes[identity] = outcome

    def __len__(self) -> int:
        """All cases."""
        return len(self._cases)

    @property
    def n_settled(self) -> int:
        """Cases with an outcome."""
        return len(self._outcomes)

    def waiting(self) -> list[Case]:
        """Cases without an outcome."""
        return [case for identity, case in self._cases.items() if identity not in self._outcomes]

    def settle(self, case: Case, outcome: Outcome) -> None:
        """Keep what came of a case.

        Raises:
            SweepError: the folder cannot be written.
        """
        self._folder.store(case, outcome)
        self._outcomes[case.identity] = outcome

    def rows(self) -> list[dict[str, object]]:
        """The rows of the table, as far as it is known."""
        return table_rows(
            (case, self._outcomes[identity])
            for identity, case in self._cases.items()
            if identity in self._outcomes
        )
