"""Several control boxes in one process, on one loop in one thread.

    with ControlBox.many(20, host="127.0.0.2") as boxes:
        for box in boxes:
            print(box.host, box.serial_number)      # 127.0.0.2, 127.0.0.3, ... with the standard ports

    with BoxRack([{"host": "127.0.0.2"}, {"host": "127.0.0.3", "fidelity": "poor"}]) as boxes:
        ...

The boxes know nothing of each other; an error ends the box in which it came up, the
others go on. In real time they take turns: their cycles are spread over the period.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Iterable, Sequence
from functools import partial
from os import PathLike
from types import TracebackType
from typing import Self, TypedDict, overload

from ur_emulator.emulator import ControlBox
from ur_emulator.errors import EmulatorError
from ur_emulator.realtime.event_loop import EventLoop
from ur_emulator.realtime.loop_runner import LoopRunner
from ur_emulator.realtime.pacing import Pace

# A slip of the keyboard must not fill the memory: each box takes some 15 MB.
MAX_BOXES = 200


class BoxOptions(TypedDict, total=False):
    """Arguments of one `ControlBox`."""

    robot: str
    version: str | None
    host: str
    pace: str | Pace
    speed: float
    seed: int
    fidelity: str
    port_base: int | None
    programs: str | PathLike[str] | None
    control_port: int | None


class BoxRack(Sequence[ControlBox]):
    """Boxes that share a loop; a sequence of them."""

    def __init__(self, options: Iterable[BoxOptions]) -> None:
        """Assemble the boxes; nothing listens before the rack is started.

        Args:
            options: arguments of each box. Two boxes need two addresses, or a `port_base` each.

        Raises:
            EmulatorError: an argument is not among the allowed ones, or there are no boxes, or too many.
        """
        every = list(options)
        if not 1 <= len(every) <= MAX_BOXES:
            raise EmulatorError(f"{len(every)} boxes asked for: a rack holds 1 to {MAX_BOXES}")
        self._loop = EventLoop(precise=any(o.get("pace") not in _LOCKSTEP for o in every))
        self._runner = LoopRunner(self._loop, self._close)
        try:
            self._boxes = tuple(
                ControlBox(**o, loop=self._loop, phase=k / len(every)) for k, o in enumerate(every)
            )
        except BaseException:
            self._loop.close()
            raise
        for box in self._boxes:
            box.on_shut_down = partial(self._end, box)
            box.fail_alone(partial(self._end, box))

    @overload
    def __getitem__(self, index: int) -> ControlBox: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[ControlBox]: ...
    def __getitem__(self, index: int | slice) -> ControlBox | Sequence[ControlBox]:
        return self._boxes[index]

    def __len__(self) -> int:
        return len(self._boxes)

    def listen(self) -> None:
        """Open all ports of all boxes; once they are open, nothing happens.

        Raises:
            PortError: one of them is taken; none stays open then and the rack cannot be used any more.
        """
        try:
            for box in self._boxes:
                box.listen()
        except EmulatorError:
            self._close()
            raise

    def serve_forever(self) -> None:
        """Run in the calling thread until `stop`; the ports must be open.

        An error that ended one of the boxes is raised after the others have ended.
        """
        self._runner.run()
        failure = self._failure_of_a_box()
        if failure is not None:
            raise failure

    def stop(self) -> None:
        """Let the loop end, from any thread."""
        self._runner.stop()

    def __enter__(self) -> Self:
        """Open the ports and run the loop in a thread."""
        self.listen()
        self._runner.start("box-rack")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the loop; an error that ended it or one of the boxes earlier is raised here."""
        failure = self._runner.finish() or self._failure_of_a_box()
        if failure is not None and error is None:
            raise failure

    def _failure_of_a_box(self) -> Exception | None:
        return next((box.failure for box in self._boxes if box.failure is not None), None)

    def _end(self, box: ControlBox) -> None:
        """Close a box that was switched off or has failed; after the last one the rack has nothing to do."""
        box.close()
        if all(other.is_shut_down or other.failure is not None for other in self._boxes):
            self.stop()

    def _close(self) -> None:
        for box in self._boxes:
            box.close()
        self._loop.close()


_LOCKSTEP = (Pace.LOCKSTEP, Pace.LOCKSTEP.value)


def counted_up(count: int, options: BoxOptions) -> list[BoxOptions]:
    """Return the options of `count` boxes: hosts and seeds are counted up from those given.

    With free ports (`port_base` None) one host is enough for all.

    Raises:
        EmulatorError: the host is no address from which `count` can be counted.
    """
    if not 1 <= count <= MAX_BOXES:
        raise EmulatorError(f"{count} boxes asked for: 1 to {MAX_BOXES} are possible")
    host, seed = options.get("host", "127.0.0.1"), options.get("seed", 0)
    one_host = count == 1 or options.get("port_base", 0) is None
    hosts = [host] * count if one_host else _hosts_from(host, count)
    return [{**options, "host": h, "seed": seed + k} for k, h in enumerate(hosts)]


def _hosts_from(host: str, count: int) -> list[str]:
    try:
        first = ipaddress.ip_address(host)
        if first.is_unspecified:
            raise ValueError
        return [str(first + k) for k in range(count)]
    except ValueError:
        raise EmulatorError(
            f"host {host!r} given for {count} boxes: name the address of the first one, such as 127.0.0.2; "
            "the others get the next ones"
        ) from None
