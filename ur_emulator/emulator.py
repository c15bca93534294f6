"""Control boxes for users.

    with ControlBox(robot="ur3", pace="lockstep", seed=7) as box:
        print(box.host, box.ports.realtime)

    with ControlBox.many(20, host="127.0.0.2") as boxes:
        for box in boxes:
            print(box.host, box.serial_number)      # 127.0.0.2, 127.0.0.3, ... with the standard ports

A box runs in a process of its own: a client in the user's process may hold Python's lock as long as it likes.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from os import PathLike
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TypeAlias, overload

from protocol.ur_types import Ports
from ur_emulator.errors import EmulatorError
from ur_emulator.host.box_log import LogEntry
from ur_emulator.host.box_options import BoxOptions, ServedAt, check_count, counted_up
from ur_emulator.host.control_api.http_client import DEFAULT_HOST, DEFAULT_PORT, AttachedBox
from ur_emulator.host.control_api.operations import BoxOperations
from ur_emulator.host.control_api.step_operations import ReadLog

if TYPE_CHECKING:
    from ur_emulator.host.box_process import ProcessRack
    from ur_emulator.host.pacing import Pace
    from ur_emulator.host.rack import LoopRack
    from ur_emulator.machine.commands.operation import Operation
    from ur_emulator.machine.controller.command import Command, Done
    from ur_emulator.machine.models.robot_generation import RobotGeneration

# Boxes that run together; in their methods a number says which one is meant.
OwnRack: TypeAlias = "LoopRack | ProcessRack"


def _make_rack(options: Sequence[BoxOptions], *, in_process: bool) -> OwnRack:
    check_count(len(options))
    if in_process:
        from ur_emulator.host.rack import LoopRack

        return LoopRack(options)
    from ur_emulator.host.box_process import ProcessRack

    return ProcessRack(options)


class BoxControl(BoxOperations):
    """A box that runs somewhere: what can be done to it is on docs/control.md.

    `push`, `wait_until`, `state`, `log` and so on may be called from any thread.
    """

    def __init__(self, rack: OwnRack | AttachedBox, index: int = 0) -> None:
        self._rack = rack
        self._index = index

    @property
    def title(self) -> str:
        """Arm, generation and software."""
        return self._served_at.title

    @property
    def serial_number(self) -> str:
        """As the dashboard gives it; simulated boxes are recognisable by it."""
        return self._served_at.serial_number

    @property
    def host(self) -> str:
        """Address that it listens on."""
        return self._served_at.host

    @property
    def ports(self) -> Ports:
        """Numbers of its ports; 0 for one that it does not have."""
        return self._served_at.ports

    @property
    def port_base(self) -> int:
        """What was added to the standard numbers."""
        return self._served_at.port_base

    @property
    def control_port(self) -> int:
        """Number of the port for the control API over HTTP, 0 if it is not open."""
        return self._served_at.control_port

    @property
    def notices(self) -> tuple[str, ...]:
        """Warnings for the user, one line each; the box runs all the same."""
        return self._served_at.notices

    @property
    def is_shut_down(self) -> bool:
        """A client has switched the box off: its ports are closed."""
        return self._rack.end_of(self._index)[0]

    @property
    def failure(self) -> Exception | None:
        """The error that has ended the box, None while there is none."""
        return self._rack.end_of(self._index)[1]

    def submit(self, command: Command, done: Done | None = None) -> None:
        """Ask for something as a client of the box would; it acts in the next cycle.

        Args:
            command: one of `machine.commands`, such as `programs.ClosePopup()` or `power.PowerOff()`.
            done: called when it was applied, in another thread: with its result and None, or with None and
                the error, a `RefusedError` if it was refused.

        Raises:
            NotRunningError: the box does not run.
        """
        self._rack.submit(self._index, command, done)

    def follow_log(self, follower: Callable[[LogEntry], None]) -> None:
        """Call `follower` with every entry of the log from now on, in another thread; before the box runs.

        It must not block and must not raise, and it cannot use the box.
        """
        self._rack.follow_log(self._index, follower)

    @property
    def _served_at(self) -> ServedAt:
        return self._rack.served[self._index]

    def _perform(self, operation: Operation[Any]) -> Any:
        __tracebackhide__ = True
        if isinstance(operation, ReadLog):  # also after the end
            return self._rack.log(self._index)
        try:
            return self._rack.perform(self._index, operation)
        except EmulatorError as error:
            raise error.with_traceback(None) from None  # pytest shows the line of the test only


class _Running:
    """Boxes for one `with`."""

    _own: OwnRack

    def stop(self) -> None:
        """Let the boxes end, soon; from any thread."""
        self._own.stop()

    def close(self) -> None:
        """End, and close all ports and connections; harmless if that has been done."""
        self._own.join()

    def __enter__(self) -> Self:
        """Open the ports and run."""
        __tracebackhide__ = True
        self._own.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End; an error that ended a box earlier is raised here."""
        failure = self._own.join()
        if failure is not None and error is None:
            raise failure


class ControlBox(_Running, BoxControl):
    """A control box for one `with`.

    Args:
        robot: type of the arm, such as "ur3" or "ur5e", or a file of one (docs/fidelity.md).
        version: software, such as "3.4.0"; None is the usual one of the arm's generation.
        pace: "realtime", or "lockstep": as fast as the processor allows, and repeatable.
        speed: times as fast as real time, in pace "realtime" only.
        seed: which specimen of the arm: calibration, gear phases, delays, noise.
        fidelity: "exact", "ideal", "typical" or "poor", or a file (docs/fidelity.md).
        port_base: added to all standard ports; None takes free ports.
        programs: folder that the dashboard loads programs from; None has none.
        control_port: port of the control API over HTTP; 0 is any free one, None opens none.
        control_token: what a client of the control API must show.
        skip_unknown_nodes: run programs of PolyScope without the nodes that are not known; it names them.
        remote_control: clients may command the box; False: it starts in local control (e-Series).
        services: of a PolyScope X box, closed until they are enabled: "primary" and "rtde".
        tool: on the flange, such as "robotiq-2f85", or a file (docs/grippers.md).
        scene: what stands around the arm, and things to grip: a cell file (TOML) or a fragment of MJCF.
        journal: file for the inputs of each cycle, to be replayed (docs/journal.md).
        in_process: run in a thread of this process. A client that holds Python's lock while it waits for the
            box then waits for ever.

    Raises:
        EmulatorError: an argument is not among the allowed ones, or a port is taken.
    """

    def __init__(
        self,
        robot: str | PathLike[str] = "ur3",
        version: str | None = None,
        host: str = "127.0.0.1",
        pace: str | Pace = "realtime",
        speed: float = 1.0,
        seed: int = 0,
        fidelity: str = "typical",
        port_base: int | None = 0,
        programs: str | PathLike[str] | None = None,
        control_port: int | None = None,
        control_token: str | None = None,
        skip_unknown_nodes: bool = False,
        remote_control: bool = True,
        services: Collection[str] = (),
        tool: str | PathLike[str] = "none",
        scene: str | PathLike[str] | None = None,
        journal: str | PathLike[str] | None = None,
        *,
        in_process: bool = False,
        generation: RobotGeneration | None = None,
    ) -> None:
        __tracebackhide__ = True
        options = BoxOptions(
            robot,
            version,
            host,
            pace,
            speed,
            seed,
            fidelity,
            port_base,
            programs,
            control_port,
            control_token,
            skip_unknown_nodes,
            remote_control,
            services,
            generation,
            tool,
            scene,
            journal,
        )
        self._own = _make_rack([options], in_process=in_process)
        super().__init__(self._own)

    @staticmethod
    def many(count: int, *, in_process: bool = False, **options: Any) -> BoxRack:
        """Return `count` boxes that share a process, for one `with`; hosts and seeds are counted up.

        Args:
            count: how many.
            in_process: run in a thread of this process.
            options: as for one box; `host` and `seed` are those of the first. With `port_base=None` all boxes
                listen on that host, each on free ports of its own.

        Raises:
            EmulatorError: an argument is not among the allowed ones.
        """
        return BoxRack(counted_up(count, BoxOptions(**options)), in_process=in_process)

    @staticmethod
    def attach(host: str = DEFAULT_HOST, port: int = DEFAULT_PORT, token: str | None = None) -> BoxControl:
        """Return a box that somebody else serves, `ur-emulator serve --control-port N` for example.

        It goes on when this process ends. Operations are asked for over the control API (docs/control.md).

        Args:
            token: of that port, None if it has none.

        Raises:
            ControlError: no box answers there, or not without its token.
        """
        return BoxControl(AttachedBox(host, port, token))


class BoxRack(_Running, Sequence[BoxControl]):
    """Boxes that share a process; a sequence of them, for one `with`.

    An error in a cycle ends its box, the others go on.

        with BoxRack([{"host": "127.0.0.2"}, {"host": "127.0.0.3", "fidelity": "poor"}]) as boxes:
            ...
    """

    def __init__(
        self, options: Iterable[BoxOptions | Mapping[str, Any]], *, in_process: bool = False
    ) -> None:
        """Assemble the boxes; nothing listens before the rack is started.

        Args:
            options: arguments of each box, as for `ControlBox`. Two boxes need two addresses, or a
                `port_base` each.
            in_process: run in a thread of this process.

        Raises:
            EmulatorError: an argument is not among the allowed ones, or there are no boxes, or too many.
        """
        every = [one if isinstance(one, BoxOptions) else BoxOptions(**one) for one in options]
        self._own = _make_rack(every, in_process=in_process)
        self._boxes = tuple(BoxControl(self._own, index) for index in range(len(every)))

    @overload
    def __getitem__(self, index: int) -> BoxControl: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[BoxControl]: ...
    def __getitem__(self, index: int | slice) -> BoxControl | Sequence[BoxControl]:
        return self._boxes[index]

    def __len__(self) -> int:
        return len(self._boxes)
