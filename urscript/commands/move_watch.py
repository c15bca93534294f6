"""Records the moves of a program: start, arguments, duration.

The program runs on a host whose motion builtins are wrapped; everything else runs at its usual speed.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, fields
from functools import partial
from typing import Any, Final

from urscript.catalogue import TimeClass
from urscript.program import CompiledProgram, RunningProgram
from urscript.run.host import Host, HostFunction
from urscript.run.metering import WorkBudget
from urscript.run.threads import ScriptThread
from urscript.run.waits import Wait

STREAMS: Final = frozenset({"speedj", "speedl", "servoj", "servoc"})
"""Builtins that are called again every few cycles: consecutive calls are one move."""


@dataclass(slots=True)
class WatchedMove:
    """A move, or a stream of calls.

    Attributes:
        name: Of the builtin.
        arguments: By parameter, of the last call.
        thread: Name of the thread.
        line: Of its first call, from 1.
        start: Seconds of robot time at which it began.
        end: Seconds at which its instruction ended.
        calls: How many calls it is.
        completed: False when something ended it before it was done.
        in_main: The thread is the body of the program.
    """

    name: str
    arguments: dict[str, Any]
    thread: str
    line: int
    start: float
    end: float
    calls: int = 1
    completed: bool = True
    in_main: bool = True

    @property
    def duration(self) -> float:
        """Seconds from its start to its end."""
        return self.end - self.start


class MoveWatch:
    """Watches one run of a program.

    Attributes:
        program: Run this instead of the one that was given.
    """

    def __init__(
        self,
        program: CompiledProgram,
        step_time: float,
        clock: Callable[[], float],
        on_move: Callable[[WatchedMove], None],
    ) -> None:
        """Watch a program.

        Args:
            program: the compiled program.
            step_time: length of a cycle [s].
            clock: returns the robot time [s].
            on_move: called with each move that has ended.
        """
        inherited = {item.name: getattr(program, item.name) for item in fields(program)}
        self.program: CompiledProgram = _WatchedProgram(**inherited, watch=self)
        self._clock = clock
        self._gap = 1.5 * step_time
        self._on_move = on_move
        self._streams: dict[ScriptThread, WatchedMove] = {}

    def flush(self, *, all_streams: bool = True) -> None:
        """Report the streams that have ended, or all of them."""
        for thread, stream in list(self._streams.items()):
            if all_streams or self._clock() - stream.end > self._gap:
                del self._streams[thread]
                self._on_move(stream)

    def function(self, name: str, function: HostFunction) -> HostFunction:
        """`function`, watched, if the builtin of that name moves the arm."""
        builtin = self.program.catalogue.lookup(name)
        if builtin is None or builtin.time is not TimeClass.MOTION:
            return function
        return partial(self._move, name, [parameter.name for parameter in builtin.params], function)

    def _move(
        self, name: str, parameters: list[str], function: HostFunction, thread: ScriptThread, *values: Any
    ) -> Generator[Wait, None, Any]:
        # The generator is first resumed by the frame of the script that calls the builtin.
        line = sys._getframe(1).f_lineno
        start = self._clock()
        arguments = dict(zip(parameters, values, strict=False))
        move = WatchedMove(
            name, arguments, thread.name, line, start, start, completed=False, in_main=thread.parent is None
        )
        try:
            result = yield from function(thread, *values)
            move.completed = True
        finally:
            move.end = self._clock()
            self._ended(thread, move)
        return result

    def _ended(self, thread: ScriptThread, move: WatchedMove) -> None:
        earlier = self._streams.pop(thread, None)
        if earlier is not None and earlier.name == move.name and move.start - earlier.end < self._gap:
            move.line, move.start, move.calls = earlier.line, earlier.start, earlier.calls + 1
        elif earlier is not None:
            self._on_move(earlier)
        if move.name in STREAMS and move.completed:
            self._streams[thread] = move
        elif move.completed or move.duration > 0:
            self._on_move(move)


@dataclass(frozen=True, slots=True)
class _WatchedProgram(CompiledProgram):
    """A program that runs on a watched host."""

    watch: MoveWatch

    def start(self, host: Host, work: WorkBudget | None = None) -> RunningProgram:
        return RunningProgram(self, _WatchedHost(host, self.watch), work)


class _WatchedHost:
    """A host whose motion builtins are watched."""

    def __init__(self, host: Host, watch: MoveWatch) -> None:
        self.step_time = host.step_time
        self.textmsg = host.textmsg
        self.thread_ended = host.thread_ended
        self.program_ended = host.program_ended
        self._builtins = {name: watch.function(name, f) for name, f in host.builtins().items()}

    def builtins(self) -> Mapping[str, HostFunction]:
        return self._builtins
