"""Shows on the terminal how far a sweep is."""

from __future__ import annotations

from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from pc_client.sweep.outcome import Outcome, Status


class SweepProgress:
    """One bar for all cases; on leaving, one line that stays.

    Args:
        console: where.
        n_cases: cases in all.
        n_settled: those that are done before.
        live: True: the clock ticks. False: redrawn when a case is done; the thread that lets it tick would
            take the interpreter from a control loop in this process.
    """

    def __init__(self, console: Console, n_cases: int, n_settled: int, *, live: bool) -> None:
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
            auto_refresh=live,
            transient=True,
        )
        self._console = console
        self._task = self._bar.add_task("running", total=n_cases, completed=n_settled)
        self._counts: dict[Status, int] = {"done": 0, "refused": 0, "failed": 0}
        self._n_runs = 0

    def __enter__(self) -> Self:
        self._bar.start()
        self._bar.refresh()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        elapsed = self._bar.tasks[0].elapsed or 0.0
        self._bar.stop()
        if any(self._counts.values()):
            counts = ", ".join(f"{n} {status}" for status, n in self._counts.items() if n)
            rate = f"{60.0 * self._n_runs / elapsed:.0f} runs a minute" if elapsed > 0.0 else "at once"
            self._console.print(f"{counts} in {elapsed:.0f} s, {rate}", soft_wrap=True)

    def finished(self, outcome: Outcome) -> None:
        """Count one case."""
        self._counts[outcome.status] += 1
        self._n_runs += len(outcome.rows) if outcome.status == "done" else 0
        troubles = "".join(f", {n} {status}" for status, n in self._counts.items() if n and status != "done")
        self._bar.update(self._task, advance=1, description=f"running{troubles}")
        self._bar.refresh()
