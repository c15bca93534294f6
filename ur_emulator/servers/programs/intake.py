"""From bytes on a script port to commands: split, compile in the worker process, hand over.

The order of arrival stays. What needs no compiling waits for the programs before it: a `stop program` sent
after a program must stop it. A program is compiled also when its sender has closed the connection meanwhile,
as many do.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from protocol.primary.messages import ReportLevel
from protocol.script_channel import ControlLine, Overflow, ProgramText, ScriptItem
from ur_emulator.commands.power import PowerOff, PowerOn, ReleaseBrakes, StartFreedrive
from ur_emulator.commands.programs import (
    PauseProgram,
    ResumeProgram,
    SetSpeedSlider,
    StartProgram,
    StopProgram,
)
from ur_emulator.commands.safety import ConfirmSafety, UnlockProtectiveStop
from ur_emulator.controller.command import Command
from ur_emulator.controller.events import ErrorReported, Event, ScriptFailed
from ur_emulator.errors import ArgumentError
from ur_emulator.programs.compiling import compile_text
from ur_emulator.realtime.barrier import place_of
from ur_emulator.realtime.tasks import Task, TaskQueue
from urscript.catalogue import Catalogue

# The controller's own words and the command each stands for; words that change nothing here map to None.
# Source: what PolyScope and public clients send on the script ports (protocol.controller_words).
WORDS: dict[str, Command | None] = {
    "power on": PowerOn(),
    "power off": PowerOff(),
    "set robotmode run": ReleaseBrakes(),
    "set robotmode freedrive": StartFreedrive(),
    "set unlock protective stop": UnlockProtectiveStop(),
    "stop program": StopProgram(),
    "pause program": PauseProgram(),
    "resume program": ResumeProgram(),
    "set real": None,
    "set sim": None,
    "confirm user safety parameters": ConfirmSafety(),
}
SPEED_WORD = "set speed"
# Script of one sender that may wait for the compiler, each program counted with its cost beside its text
# [bytes]; what comes on top is dropped: who floods the port must neither fill the memory nor delay others.
MAX_WAITING = 4 << 20
_PROGRAM_COST = 1 << 10


class ProgramIntake:
    """Turns script items into commands for one box."""

    def __init__(
        self,
        tasks: TaskQueue,
        catalogue: Catalogue,
        submit: Callable[[Command], None],
        announce: Callable[[Event], None],
    ) -> None:
        """Prepare.

        Args:
            tasks: where programs are compiled.
            catalogue: the builtins of the software.
            submit: takes a command for the next cycle.
            announce: takes an event that needs no cycle, such as a syntax error.
        """
        self._tasks = tasks
        self._catalogue = catalogue
        self._submit = submit
        self._announce = announce
        self._queue: deque[tuple[ScriptItem, object, int]] = deque()
        self._compiling: Task | None = None
        self._waiting: Counter[object] = Counter()
        self._flooding: set[object] = set()

    def take(self, sender: object, items: Iterable[ScriptItem]) -> None:
        """Queue what one connection has sent: words always, programs as long as not too much waits."""
        for item in items:
            cost = _PROGRAM_COST + len(item.text) if isinstance(item, ProgramText) else 0
            waiting = self._waiting[sender]
            if cost and waiting and waiting + cost > MAX_WAITING:
                if sender not in self._flooding:
                    self._announce(_warning("programs come faster than they compile, some were dropped"))
                self._flooding.add(sender)
                continue
            self._waiting[sender] += cost
            self._queue.append((item, sender, cost))
        self._go_on()

    def close(self) -> None:
        """Forget what is queued and what is being compiled."""
        self._queue.clear()
        if self._compiling is not None:
            self._tasks.drop(self._compiling)

    def _go_on(self) -> None:
        """Hand on all that stands before the next program, and have that compiled."""
        while self._queue and self._compiling is None:
            item, sender, cost = self._queue.popleft()
            if isinstance(item, ProgramText):
                done = partial(self._compiled, sender, cost)
                is_secondary = item.kind == "sec"
                self._compiling = self._tasks.submit(
                    done, self._failed, compile_text, item.text, self._catalogue, "<program>", is_secondary
                )
            else:
                self._finish(_translate(item), sender, cost)

    def _compiled(self, sender: object, cost: int, outcome: Any, error: Exception | None) -> None:
        self._compiling = None
        if error is not None:
            outcome = ScriptFailed(1, 1, f"the program cannot be compiled: {error}")
        self._finish(outcome if isinstance(outcome, ScriptFailed) else StartProgram(outcome), sender, cost)
        self._go_on()

    def _failed(self, error: Exception) -> None:
        self._announce(_warning(f"a program is lost: {place_of(error)}"))

    def _finish(self, result: Command | Event | None, sender: object, cost: int) -> None:
        """Hand on a result."""
        self._waiting[sender] -= cost
        if not self._waiting[sender]:
            del self._waiting[sender]
            self._flooding.discard(sender)
        if isinstance(result, Command):
            self._submit(result)
        elif result is not None:
            self._announce(result)


def _translate(item: ControlLine | Overflow) -> Command | Event | None:
    match item:
        case ControlLine(text, word, argument):
            if word == SPEED_WORD:
                return _speed_command(text, argument)
            if word in WORDS:
                return WORDS[word]
            return _warning(f"'{text}' is declared only: this box does not model it yet")
        case Overflow(what, limit):
            return _warning(f"a script {what} of more than {limit} bytes was dropped")


def _speed_command(text: str, argument: str) -> Command | Event:
    try:
        return SetSpeedSlider(float(argument))
    except (ValueError, ArgumentError):
        return _warning(f"'{text}' was ignored: the speed slider takes 0 to 1")


def _warning(text: str) -> Event:
    return ErrorReported(0, 0, ReportLevel.WARNING, text)
