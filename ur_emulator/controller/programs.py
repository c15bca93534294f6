"""Programs: the interface of the controller to the programs that run on it. `scripting` implements it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from protocol.ur_types import ProgramState

if TYPE_CHECKING:
    from urscript import CompiledProgram, RunningProgram


class Programs(Protocol):
    """The primary program of the box, and the secondary programs beside it.

    Attributes:
        name: of the primary program, or of the last one.
        latest: the primary program or the last one, whose variables can still be read; None before the first.
        reports_line: a client reads the line that the program executes.
        work: units that all programs have used in this cycle (`urscript.run.metering`).
    """

    name: str
    latest: RunningProgram | None
    reports_line: bool
    work: float

    @property
    def is_running(self) -> bool:
        """True while there is a primary program, paused or not."""
        ...

    @property
    def is_paused(self) -> bool:
        """True while the primary program is paused, or about to be."""
        ...

    @property
    def is_any_running(self) -> bool:
        """True while there is a program, primary or secondary."""
        ...

    @property
    def has_work(self) -> bool:
        """True while any program needs cycles, and in the cycle in which one ended."""
        ...

    @property
    def waits_outside(self) -> bool:
        """True when a program waits for data from outside the box."""
        ...

    @property
    def runtime_state(self) -> ProgramState:
        """Program state as published."""
        ...

    @property
    def line(self) -> int:
        """Line of the primary program's main thread as sent, 1 being the first; 0 without a program."""
        ...

    def start(self, program: CompiledProgram, *, loaded: bool = False) -> None:
        """Start a program; a primary one replaces the one that runs. `loaded`: it is played from a file."""
        ...

    def stop(self, *, unscheduled: bool = False) -> None:
        """End the primary program, if one runs, and stop the arm.

        Args:
            unscheduled: nobody wanted it; see `run_states.level`.
        """
        ...

    def pause(self, deceleration: float = 0.0) -> None:
        """Pause the primary program; the arm comes to rest on its path, at least this fast [rad/s^2]."""
        ...

    def interrupt(self) -> None:
        """Stop the arm without regard for its path.

        A program that was loaded is paused, one that came through a socket ends.
        """
        ...

    def resume(self) -> None:
        """Let a paused program go on."""
        ...

    def end_for_memory(self, text: str) -> None:
        """End the secondary programs with an error, or, if there is none, the primary program."""
        ...

    def forget(self) -> None:
        """Drop the variables of the last program if it has ended."""
        ...

    def step(self) -> None:
        """Run all programs for one cycle."""
        ...
