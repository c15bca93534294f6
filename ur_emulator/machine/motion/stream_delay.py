"""The dead time of a streamed command: it moves the target of the arm some cycles after it was given.

Recordings of a real UR3 of the CB3 show its joints half a millisecond behind their target, so what users
measure from a streamed command to the motion, 20 to 35 ms, lies before the target. Chosen: whatever moves
the path passes the same queue, the stream, the ramp after a lost command or the end of a program, and the
stop that a program commands; a stop of the safety system and a pause act at once. Moves have no dead time:
it could not be told from that of the program. A recording of `speedj` with the times of its commands would
decide it.
"""

from collections import deque
from collections.abc import Sequence
from itertools import cycle

from ur_emulator.machine.motion.generators import Generator, Kind, Streamed


class StreamDelay:
    """Generators that have been asked to move the path and do not yet.

    Args:
        cycles: dead time in control cycles; several values take turns, one a cycle. Where it grows a command
            acts twice, where it shrinks one is left out.
    """

    def __init__(self, cycles: Sequence[int]) -> None:
        self._cycles = cycle(cycles)
        self._waiting: deque[Generator] = deque()
        self._acting: Generator | None = None

    def clear(self) -> None:
        """Forget what waits."""
        self._waiting.clear()
        self._acting = None

    def pass_on(self, asked: Generator, ramp: Generator) -> Generator:
        """Take what is asked for in this cycle; return what moves the path in it.

        Until the first streamed command acts the arm goes on with `ramp`. A ramp that no stream precedes acts
        at once.
        """
        n, waiting = next(self._cycles), self._waiting
        if not waiting:
            if asked.kind is not Kind.STREAM:
                return asked
            waiting.extend([ramp] * n)
        waiting.append(asked)
        acting = waiting[0]
        while len(waiting) > n:
            acting = waiting.popleft()
        last, self._acting = self._acting, acting
        if acting is not last and isinstance(acting, Streamed):
            acting.scale = last.scale if isinstance(last, Streamed) else 0.0
        return acting
