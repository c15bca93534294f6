"""Shows on the terminal how far an experiment is."""

from pathlib import Path
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as RichProgress

from pc_client.driver.report import RobotInfo
from pc_client.driver.velocity_stream import StreamReport
from pc_client.experiment.identification import Identification
from pc_client.experiment.runner import Observer
from pc_client.planning.approach import Approach


class Progress(Observer):
    """An observer that draws one progress bar."""

    def __init__(self, console: Console, n_runs: int) -> None:
        # Redrawn by hand: rich's own refresh thread would take the interpreter from the control loop.
        self._bar = RichProgress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=console,
            auto_refresh=False,
            transient=True,
        )
        self._console = console
        self._task = self._bar.add_task("connecting", total=n_runs)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def connected(self, info: RobotInfo) -> None:
        """Name the robot; the bar begins here, after all that is asked."""
        self._bar.start()
        self._console.print(f"robot: {info}", soft_wrap=True)

    def approaching(self, approach: Approach) -> None:
        """Say that the arm moves to a start."""
        self._show(f"{approach.plan.name}: to the start")

    def identified(self, found: Identification) -> None:
        """Say what the loop is, and how far from oscillating."""
        margins = found.margins
        self._console.print(
            f"loop delay: {found.delay * 1e3:.1f} ms; gain margin {margins.gain:.1f}, phase margin "
            f"{margins.phase_deg:.0f} deg, delay margin {margins.delay * 1e3:.0f} ms",
            soft_wrap=True,
        )
        if found.learning is not None:
            self._console.print(
                f"learning: {found.loop}; up to {found.learning.cut_off:.0f} Hz "
                f"(set by the {found.learning.limited_by}), contraction {found.learning.contraction:.2f}",
                soft_wrap=True,
            )

    def running(self, name: str, repetition: int) -> None:
        """Say what runs."""
        self._show(f"{name}, run {repetition}")

    def finished(self, name: str, repetition: int, path: Path, report: StreamReport) -> None:
        """Count one run."""
        self._bar.advance(self._task)
        self._bar.refresh()

    def _show(self, text: str) -> None:
        self._bar.update(self._task, description=text)
        self._bar.refresh()
