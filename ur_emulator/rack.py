"""Several control boxes in one process, on one loop in one thread.

    with ControlBox.many(20, host="127.0.0.2") as boxes:
        for box in boxes:
            print(box.host, box.serial_number)      # 127.0.0.2, 127.0.0.3, ... with the standard ports

    with BoxRack([{"host": "127.0.0.2"}, {"host": "127.0.0.3", "fidelity": "poor"}]) as boxes:
        ...

The boxes are independent; an error in a cycle ends its box, the others go on. In real time their
cycles are spread over the period.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Iterable, Sequence
from functools import partial
from typing import overload

from ur_emulator.box import Box
from ur_emulator.box_options import BoxOptions
from ur_emulator.errors import EmulatorError
from ur_emulator.realtime.event_loop import WAKE_UP, EventLoop
from ur_emulator.realtime.loop_runner import LoopRunner
from ur_emulator.realtime.pacing import Pace

# A typing error must not fill the memory: each box takes some 15 MB.
MAX_BOXES = 200
_LOCKSTEP = (Pace.LOCKSTEP, Pace.LOCKSTEP.value)


class BoxRack(Sequence[Box], LoopRunner):
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
        # Several boxes would compute at each other's deadlines.
        lead = WAKE_UP if len(every) == 1 else 0.0
        try:
            self._boxes = tuple(
                Box(**o, loop=self._loop, phase=k / len(every), lead=lead) for k, o in enumerate(every)
            )
        except BaseException:
            self._loop.close()
            raise
        for box in self._boxes:
            box.on_end = partial(self._end, box)

    @overload
    def __getitem__(self, index: int) -> Box: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Box]: ...
    def __getitem__(self, index: int | slice) -> Box | Sequence[Box]:
        return self._boxes[index]

    def __len__(self) -> int:
        return len(self._boxes)

    def listen(self) -> None:
        """Open all ports of all boxes.

        Raises:
            PortError: one of them is taken; none stays open then and the rack cannot be used any more.
        """
        try:
            for box in self._boxes:
                box.listen()
        except EmulatorError:
            self.close()
            raise

    def close(self) -> None:
        """Close all boxes and the loop."""
        for box in self._boxes:
            box.close()
        self._loop.close()

    def _failure(self) -> Exception | None:
        return next((box.failure for box in self._boxes if box.failure is not None), None)

    def _end(self, box: Box) -> None:
        """Close a box that was switched off or has failed; after the last one the rack has nothing to do."""
        box.close()
        if all(other.is_shut_down or other.failure is not None for other in self._boxes):
            self.stop()


def counted_up(count: int, options: BoxOptions) -> list[BoxOptions]:
    """Return the options of `count` boxes: hosts and seeds are counted up from those given.

    With free ports (`port_base` None) one host is enough for all.

    Raises:
        EmulatorError: the host is not an address from which `count` can be counted.
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
