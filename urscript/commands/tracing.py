"""Line by line what a program executes: `urscript run --trace`.

Compiled programs carry the lines of their script, so Python's own tracing shows them; without it nothing is
slower. One tracer a process at a time.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import FrameType
from typing import Any, NamedTuple, Self

from urscript.program import CompiledProgram


class TracedLine(NamedTuple):
    """A line about to be executed.

    Attributes:
        thread: Name of the thread that executes it.
        line: From 1.
        text: The line without surrounding spaces.
    """

    thread: str
    line: int
    text: str


class LineTracer:
    """While its `with` block lasts, reports every line of `program` before it is executed.

    A line with two statements is reported once, the head of a loop once a round, that of a function once a
    call. After `limit` lines it calls `on_limit` and is silent: an endless loop would fill any disk.
    """

    def __init__(
        self,
        program: CompiledProgram,
        on_line: Callable[[TracedLine], None],
        on_limit: Callable[[], None],
        limit: int,
    ) -> None:
        self._program = program
        self._on_line = on_line
        self._on_limit = on_limit
        self._left = limit
        self._earlier: Any = None
        self._last: tuple[int, int] | None = None

    def __enter__(self) -> Self:
        self._earlier = sys.gettrace()
        sys.settrace(self._enter_frame)
        return self

    def __exit__(self, *_: object) -> None:
        sys.settrace(self._earlier)

    def _enter_frame(self, frame: FrameType, event: str, argument: Any) -> Any:
        """Called by Python for every frame that is entered or resumed: only the script's are followed."""
        if frame.f_code.co_filename != self._program.compiled.file_name:
            return None
        self._last = None
        return self._line

    def _line(self, frame: FrameType, event: str, argument: Any) -> Any:
        # The module itself only defines the functions.
        if event != "line" or frame.f_code.co_name == "<module>":
            return self._line
        # The code of one line comes in pieces.
        place = id(frame), frame.f_lineno
        if place == self._last:
            return self._line
        self._last = place
        if self._left <= 0:
            self._on_limit()
            sys.settrace(self._earlier)
            return None
        self._left -= 1
        text = self._program.source.line(frame.f_lineno).strip()
        self._on_line(TracedLine(frame.f_globals["_T"].name, frame.f_lineno, text))
        return self._line
