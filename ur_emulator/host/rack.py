"""Control boxes on one loop in one thread of this process.

The boxes are independent; an error in a cycle ends its box, the others go on. In real time their cycles are
spread over the period.
"""

import threading
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from ur_emulator.errors import ControlError, EmulatorError
from ur_emulator.host.box import Box
from ur_emulator.host.box_log import LogEntry
from ur_emulator.host.box_options import BoxOptions, ServedAt
from ur_emulator.host.memory import MemoryWatch, own_process
from ur_emulator.host.pacing import Pace
from ur_emulator.host.runtime.event_loop import WAKE_UP, EventLoop
from ur_emulator.host.runtime.worker import TaskQueue
from ur_emulator.machine.commands.operation import Operation
from ur_emulator.machine.controller.command import Command, Done

_JOIN_TIMEOUT = 10.0  # s


class LoopRack:
    """Boxes that share a loop: it runs once, in the calling thread or in one of its own; then all are closed.

    Attributes:
        boxes: in the order of their options.
    """

    def __init__(self, options: Sequence[BoxOptions]) -> None:
        """Assemble the boxes; nothing listens yet. Two boxes need two addresses, or a `port_base` each."""
        self.loop = EventLoop(precise=any(one.pace != Pace.LOCKSTEP for one in options))
        self.tasks = TaskQueue(self.loop)
        # Several boxes would compute at each other's deadlines.
        lead = WAKE_UP if len(options) == 1 else 0.0
        self._thread: threading.Thread | None = None
        self._loop_failure: BaseException | None = None
        try:
            self.boxes = tuple(
                Box(one, tasks=self.tasks, phase=k / len(options), lead=lead) for k, one in enumerate(options)
            )
        except BaseException:
            self.loop.close()
            raise
        for box in self.boxes:
            box.on_end = partial(self._end, box)

    # --- life

    def listen(self) -> None:
        """Open all ports of all boxes.

        PortError if one is taken; none stays open then and the rack cannot be used any more.
        """
        try:
            for box in self.boxes:
                box.listen()
        except EmulatorError:
            self.close()
            raise

    def serve_forever(self) -> None:
        """Run in the calling thread, of a process that only serves, until `stop`; the ports must be open.

        An error that has ended the loop or a box is raised at the end.
        """
        own_process()
        watch = MemoryWatch(self.tasks)
        for box in self.boxes:
            box.watch_memory(watch)
        try:
            self.loop.run()
        finally:
            self.close()
        if self._failure is not None:
            raise self._failure

    def start(self) -> None:
        """Open the ports and run in a thread; PortError if one is taken."""
        self.listen()
        self.loop.is_running = True
        self._thread = threading.Thread(target=self._run_in_thread, name="control-box", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Let the loop end, from any thread."""
        self.loop.stop()

    def join(self) -> BaseException | None:
        """End the loop and wait for that; return the error that has ended it or a box, if there is one."""
        self.stop()
        if self._thread is not None:
            self._thread.join(_JOIN_TIMEOUT)
            if self._thread.is_alive():
                return EmulatorError(
                    f"the loop of the box did not end within {_JOIN_TIMEOUT:g} s: its ports are still open; "
                    "end the process"
                )
        else:
            self.close()
        return self._loop_failure or self._failure

    def close(self) -> None:
        """Close all boxes and the loop; in its thread after its last turn."""
        for box in self.boxes:
            box.close()
        self.tasks.close()
        self.loop.close()

    @property
    def _failure(self) -> Exception | None:
        return next((box.failure for box in self.boxes if box.failure is not None), None)

    def _run_in_thread(self) -> None:
        try:
            self.loop.run()
        except BaseException as failure:
            self._loop_failure = failure
        finally:
            self.close()

    def _end(self, box: Box) -> None:
        """Close a box that was switched off or has failed; after the last one there is nothing to do."""
        box.close()
        if all(other.is_shut_down or other.failure is not None for other in self.boxes):
            self.stop()

    # --- what a user asks of the box with a number

    @property
    def served(self) -> list[ServedAt]:
        """Where the boxes are served, and as what."""
        return [box.served_at for box in self.boxes]

    def perform(self, index: int, operation: Operation[Any]) -> Any:
        """Have an operation done, from any thread but that of the loop; return its result."""
        return self.boxes[index].perform(operation)

    def submit(self, index: int, command: Command, done: Done | None) -> None:
        """Submit a command for the next cycle, from any thread."""
        self.boxes[index].submit(command, done)

    def log(self, index: int) -> tuple[LogEntry, ...]:
        """Return the last entries of the log, the oldest first."""
        return self.boxes[index].log.entries

    def follow_log(self, index: int, follower: Callable[[LogEntry], None]) -> None:
        """Call `follower` with every entry from now on, in the thread of the loop; before the box runs."""
        if self.loop.is_running:
            raise ControlError("follow_log called while the box runs: call it before")
        self.boxes[index].log.follow(follower)

    def end_of(self, index: int) -> tuple[bool, Exception | None]:
        """Return whether a client has switched the box off, and the error that has ended it."""
        return self.boxes[index].is_shut_down, self.boxes[index].failure
