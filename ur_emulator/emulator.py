"""The control box for users.

    with ControlBox(robot="ur3", pace="lockstep", seed=7) as box:
        print(box.host, box.ports.realtime)

`with` runs the loop in a thread of its own; `serve_forever` runs it in the calling thread, as the command
line does.
"""

from __future__ import annotations

from typing import Unpack

from ur_emulator.box import Box
from ur_emulator.box_options import BoxOptions
from ur_emulator.rack import BoxRack, counted_up
from ur_emulator.realtime.loop_runner import LoopRunner


class ControlBox(Box, LoopRunner):
    """A control box on a loop of its own, for one `with`.

    What can be done to it while it runs is on docs/control.md: `push`, `wait_until`, `state`, `log` ...

    Args:
        robot: type of the arm, such as "ur3" or "ur5e".
        version: software, such as "3.4.0"; None is the usual one of the arm's generation.
        host: address to listen on.
        pace: "realtime", or "lockstep": as fast as the processor allows, and repeatable.
        speed: times as fast as real time, in pace "realtime" only.
        seed: which specimen of the arm: calibration, gear phases, delays, noise.
        fidelity: "exact", "ideal", "typical" or "poor", or a file (docs/fidelity.md).
        port_base: added to all standard ports; None takes free ports.
        programs: folder that the dashboard loads programs from; None has none.
        control_port: port of the control API over HTTP; 0 is any free one, None opens none.
        control_token: what a client of the control API must show.

    Raises:
        EmulatorError: an argument is not among the allowed ones, or a port is taken.
    """

    @staticmethod
    def many(count: int, **options: Unpack[BoxOptions]) -> BoxRack:
        """Return `count` boxes that share a thread, for one `with`; hosts and seeds are counted up.

        Args:
            count: how many.
            options: as for one box; `host` and `seed` are those of the first. With `port_base=None` all boxes
                listen on that host, each on free ports of its own.

        Raises:
            EmulatorError: an argument is not among the allowed ones.
        """
        return BoxRack(counted_up(count, options))

    def close(self) -> None:
        """Close all ports and connections, and the loop; harmless if closed already."""
        super().close()
        self._loop.close()

    def _failure(self) -> Exception | None:
        return self.failure
