"""What the runner reports while it works; the terminal shows it, tests and programs may ignore it."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from pc_client.driver.report import RobotInfo
from pc_client.driver.velocity_stream import StreamReport
from pc_client.experiment.identification import Identification
from pc_client.planning.approach import Approach


class Observer(Protocol):
    """Takes notes; raises nothing."""

    def connected(self, info: RobotInfo) -> None:
        """A session is open."""
        ...

    def approaching(self, approach: Approach) -> None:
        """The arm begins to move to the start of a movement."""
        ...

    def identified(self, found: Identification) -> None:
        """The loop is known."""
        ...

    def running(self, name: str, repetition: int) -> None:
        """A run begins."""
        ...

    def finished(self, name: str, repetition: int, path: Path, report: StreamReport) -> None:
        """A run is recorded."""
        ...


class Silent:
    """Says nothing."""

    def connected(self, info: RobotInfo) -> None:
        """Say nothing."""

    def approaching(self, approach: Approach) -> None:
        """Say nothing."""

    def identified(self, found: Identification) -> None:
        """Say nothing."""

    def running(self, name: str, repetition: int) -> None:
        """Say nothing."""

    def finished(self, name: str, repetition: int, path: Path, report: StreamReport) -> None:
        """Say nothing."""
