"""From bytes on a script port to commands: split, compile in a worker, hand over in the order of arrival.

Compiling a long script takes longer than a cycle, so it happens in one worker thread. Everything that
arrives on a script port goes through that thread's queue, also what needs no compiling: a `stop program`
sent after a program must stop it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor

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
from ur_emulator.realtime.event_loop import EventLoop
from ur_emulator.realtime.interpreter import collection_put_off
from urscript import compile_program
from urscript.catalogue import Catalogue
from urscript.courtesy import giving_way
from urscript.errors import ScriptError, ScriptTypeError
from urscript.syntax.parser import prepare

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
        loop: EventLoop,
        catalogue: Catalogue,
        submit: Callable[[Command], None],
        announce: Callable[[Event], None],
    ) -> None:
        """Start the worker.

        Args:
            loop: results come back in its thread.
            catalogue: the builtins of the software.
            submit: takes a command for the next cycle.
            announce: takes an event that needs no cycle, such as a syntax error.
        """
        self._loop = loop
        self._catalogue = catalogue
        self._submit = submit
        self._announce = announce
        prepare()  # now, so that the first program does not pay for it in the middle of a stream
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="compile")
        self._waiting: Counter[object] = Counter()
        self._flooding: set[object] = set()
        self._is_closed = False

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
            self._worker.submit(self._process, item, sender, cost)

    def close(self) -> None:
        """Take nothing more; what is queued is dropped, what is being compiled comes to nothing."""
        self._is_closed = True
        self._worker.shutdown(wait=False, cancel_futures=True)

    def _process(self, item: ScriptItem, sender: object, cost: int) -> None:
        """Compile or translate one item; runs in the worker, hands the result to the loop."""
        try:
            with collection_put_off(), self._loop.guests.working() as give_way, giving_way(give_way):
                result = self._translate(item)
        except Exception as error:  # a defect of ours must not swallow the program without a word
            result = ScriptFailed(1, 1, f"the program cannot be compiled: {error!r}")
        self._loop.call_soon_threadsafe(lambda: self._finish(result, sender, cost))

    def _finish(self, result: Command | Event | None, sender: object, cost: int) -> None:
        """Hand on a result; runs in the loop."""
        if self._is_closed:
            return
        self._waiting[sender] -= cost
        if not self._waiting[sender]:
            del self._waiting[sender]
            self._flooding.discard(sender)
        if isinstance(result, Command):
            self._submit(result)
        elif result is not None:
            self._announce(result)

    def _translate(self, item: ScriptItem) -> Command | Event | None:
        match item:
            case ProgramText(text, _, kind):
                try:
                    return StartProgram(compile_program(text, catalogue=self._catalogue))
                except ScriptError as error:
                    # Arguments are counted when the call runs, so that of a `sec` is one of its exceptions.
                    secondary = kind == "sec" and isinstance(error, ScriptTypeError)
                    return ScriptFailed(error.line, error.column, error.wire_text, secondary, error.log_text)
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
