"""Where the threads of the running program stand in PolyScope's tree, as messages of the primary port.

A `$ 12 "Move"` line is only noted by the thread that passes it; clients get a message in each
cycle in which a thread has passed on. `"breakAfter"` and `"noBreak"` behind the text mean nothing to the box.
"""

from __future__ import annotations

import re
from functools import lru_cache
from itertools import islice

from protocol.primary.messages import ProgramLabelMessage, ProgramThreadsMessage, RobotMessage, ThreadLabel
from protocol.ur_types import SoftwareVersion
from urscript import RunningProgram

# Characters of a label or a name, and threads, that a message names: clients hold packages of 4096 bytes.
MAX_TEXT = 60
MAX_THREADS = 30

_LABEL = re.compile(r'\s*(-?\d{1,9})\s*"([^"]*)"')


@lru_cache(maxsize=1024)
def parse_label(line: str) -> tuple[int, str] | None:
    """Return number and text of a label line, given without its `$`; None for one that is malformed."""
    found = _LABEL.match(line)
    return (int(found[1]), found[2][:MAX_TEXT]) if found else None


class LabelReporter:
    """What one port has sent of the positions of the threads of one run."""

    def __init__(self, version: SoftwareVersion) -> None:
        self._tells_of_threads = ProgramThreadsMessage.SINCE.covers(version)
        self._run: RunningProgram | None = None
        self._sent: tuple[ThreadLabel, ...] = ()

    @property
    def is_watching(self) -> bool:
        """True while a program with labels runs."""
        return self._run is not None

    def begin(self, run: RunningProgram) -> None:
        """Turn to a run; one without labels is not watched."""
        self._run = run if "$" in run.program.source.text else None
        self._sent = ()

    def end(self) -> None:
        """Forget the run."""
        self._run = None

    def message(self, timestamp: int) -> RobotMessage | None:
        """Return the message of this cycle, or None if nothing has changed.

        Args:
            timestamp: microseconds since controller start.
        """
        if self._run is None:
            return None
        found = (
            ThreadLabel(label_id=label[0], text=label[1], thread_name=thread.name[:MAX_TEXT])
            for thread in self._run.threads[: None if self._tells_of_threads else 1]
            if thread.label and (label := parse_label(thread.label)) is not None
        )
        labels = tuple(islice(found, MAX_THREADS))
        if labels == self._sent:
            return None
        self._sent = labels
        if self._tells_of_threads:
            return ProgramThreadsMessage(timestamp=timestamp, threads=labels)
        if not labels:
            return None
        return ProgramLabelMessage(timestamp=timestamp, label_id=labels[0].label_id, text=labels[0].text)
