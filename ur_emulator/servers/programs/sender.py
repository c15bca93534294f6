"""A client that sends scripts, and its programs that have not begun."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from protocol.script_channel import ScriptChannel
from ur_emulator.budgets import KIB
from ur_emulator.program_files.compiling import Outcome
from ur_emulator.realtime.tasks import Place, Task

# A program costs so much beside its text [bytes].
_PROGRAM_COST = 2 * KIB


# Without a text of their own: each holds all others.
@dataclass(eq=False, repr=False, slots=True)
class Sender:
    """A client that sends scripts.

    Attributes:
        remote_period: number of the period of remote control in which it has connected, see `Pendant`.
        channel: what it has sent of a program that is not complete.
        waiting: its programs that wait, in order.
        compiling: its program that is being compiled, or whose result waits for the next cycle.
        n_sent: how many programs it has sent since none of its waited.
        held: script of it that the box keeps, as `BUDGETS` counts it [bytes].
        is_open: its connection is open.
        is_told: it was informed that it sends too much.
    """

    remote_period: int = 1
    channel: ScriptChannel = field(default_factory=ScriptChannel)
    waiting: deque[Program] = field(default_factory=deque)
    compiling: Program | None = None
    n_sent: int = 0
    held: int = 0
    is_open: bool = True
    is_told: bool = False

    @property
    def programs(self) -> tuple[Program, ...]:
        """All its programs that have not begun."""
        return (*self.waiting, *(() if self.compiling is None else (self.compiling,)))


@dataclass(eq=False, repr=False, slots=True)
class Program:
    """A program that waits.

    Attributes:
        sender: who has sent it.
        text: of it.
        place: among all that wait for the compiler.
        stops: how often the program had been stopped when it arrived.
        is_secondary: it is a `sec` program; it cannot be stopped.
        task: compiles it.
        outcome: what has come of it.
    """

    sender: Sender
    text: str
    place: Place
    stops: int
    is_secondary: bool
    task: Task | None = None
    outcome: Outcome | None = None

    @property
    def cost(self) -> int:
        """What it is counted with [bytes]."""
        return _PROGRAM_COST + len(self.text)
