"""The control box for users: assembles controller, loop and ports, and runs them.

    with ControlBox(robot="ur3", pace="lockstep", seed=7) as box:
        print(box.host, box.ports.realtime)

`with` runs the loop in a thread of its own; `serve_forever` runs it in the calling thread, as the command
line does.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Mapping
from functools import partial
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, Unpack

from protocol.errors import LocalProtocolError
from protocol.primary.messages import ReportLevel
from protocol.ur_types import Ports, RobotMode, simulated_serial
from ur_emulator.box_log import LogEntry
from ur_emulator.control.operations import BoxOperations
from ur_emulator.control.runner import ENDED, OperationRunner
from ur_emulator.control.step_operation import Context
from ur_emulator.controller.command import Command, Done
from ur_emulator.controller.controller import Controller
from ur_emulator.errors import EmulatorError, NotRunningError
from ur_emulator.models.fidelity import fidelity_by_name
from ur_emulator.models.robot_generation import RobotGeneration
from ur_emulator.models.robots import robot_by_name
from ur_emulator.programs.folder import ProgramFolder
from ur_emulator.realtime.event_loop import WAKE_UP, EventLoop
from ur_emulator.realtime.loop_runner import LoopRunner
from ur_emulator.realtime.pacing import Pace, make_pacer
from ur_emulator.realtime.served_box import ServedBox
from ur_emulator.scripting.program_slot import ProgramSlot
from ur_emulator.servers.box_access import BoxAccess, BoxIdentity
from ur_emulator.servers.dashboard.answers import DashboardAnswers
from ur_emulator.servers.dashboard.port import DashboardPort
from ur_emulator.servers.dashboard.reports import BoxReports
from ur_emulator.servers.modbus.server import ModbusPort
from ur_emulator.servers.port_set import CONTROL, MODBUS, PortSet
from ur_emulator.servers.primary.port import PrimaryPort
from ur_emulator.servers.primary.robot_state import StateEncoder
from ur_emulator.servers.programs.intake import ProgramIntake
from ur_emulator.servers.programs.player import ProgramPlayer
from ur_emulator.servers.realtime_port import RealtimePort
from ur_emulator.servers.rtde_port import RtdePort
from ur_emulator.servers.scripts.sockets import LoopNetwork
from ur_emulator.servers.tcp.listener import Port

if TYPE_CHECKING:
    from ur_emulator.rack import BoxOptions, BoxRack

MAX_PORT = 65535


class ControlBox(BoxOperations):
    """An emulated control box, powered on with its brakes released.

    What can be done to it beside connecting a client stands in `BoxOperations`.

    Attributes:
        generation: that of its arm: control cycle, software and what comes with it.
        host: address that it listens on.
        ports: numbers of its ports; that for Modbus is 0 if it is not open.
        control_port: number of the port for the control API over HTTP, 0 if it is not open.
        port_base: what was added to the standard ones.
        serial_number: as the dashboard gives it; simulated boxes are recognisable by it.
        is_shut_down: a dashboard client has switched the box off: its ports are closed.
        failure: the error that has ended this box of a rack, None while it runs.
    """

    def __init__(
        self,
        robot: str = "ur3",
        version: str | None = None,
        host: str = "127.0.0.1",
        pace: str | Pace = Pace.REALTIME,
        speed: float = 1.0,
        seed: int = 0,
        fidelity: str = "typical",
        port_base: int | None = 0,
        programs: str | PathLike[str] | None = None,
        control_port: int | None = None,
        *,
        loop: EventLoop | None = None,
        phase: float = 0.0,
        generation: RobotGeneration | None = None,
    ) -> None:
        """Assemble the box; nothing listens before it is started.

        Args:
            robot: type of the arm, "ur3".
            version: software that the box pretends to run; decides layouts and builtins. None: the usual one.
            host: address to listen on; other machines can reach the box only through an address of theirs.
            pace: "realtime" or "lockstep".
            speed: how many times as fast as real time (realtime pace only).
            seed: of calibration, phases and noise; the same seed is the same arm.
            fidelity: "exact" (no physics: measured equals asked), "ideal", "typical" or "poor".
            port_base: offset added to all standard ports; None takes free ports.
            programs: folder of programs and installations, for the dashboard's `load`; None for none.
            control_port: number of the port for the control API over HTTP (docs/control.md); 0: a free one,
                None: none.
            loop: shared with other boxes, see `BoxRack`, which runs it; None gives the box its own.
            phase: which part of a period its cycles lie after those of the first box of the loop.
            generation: in place of that of the arm.

        Raises:
            EmulatorError: an argument is not among the allowed ones.
        """
        model = robot_by_name(robot)
        if generation is not None:
            model = dataclasses.replace(model, generation=generation)
        self.generation = generation = model.generation
        asked = generation.parse_version(generation.default_version if version is None else version)
        software = generation.software(asked)
        imperfections = fidelity_by_name(fidelity)
        named_pace = _parse_pace(pace)
        if not 0.0 < speed < math.inf:
            raise EmulatorError(f"speed {speed:g} given: it must be above 0 and finite, 1 is real time")
        if seed < 0:
            raise EmulatorError(f"seed {seed} given: it must be 0 or above")
        if not host:
            raise EmulatorError("no host given: name an address, 127.0.0.1 keeps other machines out")
        if programs is not None and not Path(programs).is_dir():
            raise EmulatorError(f"programs folder {programs} given: there is no such folder, make it first")
        if not 0 <= (control_port or 0) <= MAX_PORT:
            raise EmulatorError(
                f"control port {control_port} given: 1 to {MAX_PORT} are ports, 0 takes a free one"
            )
        self.host = host
        self.port_base = port_base or 0
        self.ports = _standard_ports(self.port_base)
        self.serial_number = simulated_serial(model.robot_type, seed)
        self._free_ports = port_base is None
        self._owns_loop = loop is None
        self._loop = loop or EventLoop(precise=named_pace is Pace.REALTIME)
        self._runner = LoopRunner(self._loop, self.close)
        self._network = LoopNetwork(self._loop, generation.period_s, host)
        controller = Controller(
            model,
            imperfections,
            seed,
            partial(ProgramSlot, network=self._network),
            mode=RobotMode.RUNNING,
            generation=generation,
            version=(asked.major, asked.minor),
        )
        self._box = ServedBox(
            controller,
            make_pacer(named_pace, controller.period_s, speed, phase, WAKE_UP if self._owns_loop else 0.0),
            self._loop.expect_soon,
        )
        self._intake = ProgramIntake(self._loop, software.catalogue, self._box.submit, self._box.announce)
        identity = BoxIdentity(software, model.title, self.serial_number)
        self._access = BoxAccess(identity, self._box, self._loop, self._network)
        player = ProgramPlayer(self._access, ProgramFolder(None if programs is None else Path(programs)))
        self._reports = BoxReports(player.folder)
        states = StateEncoder(software, controller.state.arm)
        realtime, realtime_ro = (RealtimePort(software.realtime, intake) for intake in (self._intake, None))
        rtde = RtdePort(software, controller, self._box.submit, self._box.announce)
        modbus = ModbusPort(controller, self._box.submit)
        dashboard = DashboardPort(
            self._access, DashboardAnswers(self._access, player, self._reports, self._shut_down)
        )
        primary, secondary, primary_ro, secondary_ro = messengers = tuple(
            PrimaryPort(software, controller, intake, states, all_messages=all_messages)
            for intake in (self._intake, None)
            for all_messages in (True, False)
        )
        read_only = (realtime_ro, primary_ro, secondary_ro)
        self._box.attach(  # first those whose clients act on a cycle
            (realtime, rtde, primary, secondary, modbus, *read_only, self._access.steps),
            [port.send_message for port in messengers],
        )
        ports: dict[str, Port] = {
            "realtime": realtime,
            "rtde": rtde,
            "primary": primary,
            "secondary": secondary,
            "dashboard": dashboard,
            MODBUS: modbus,
            "realtime_ro": realtime_ro,
            "primary_ro": primary_ro,
            "secondary_ro": secondary_ro,
        }
        self.control_port = 0
        self._facts = {
            "software": str(asked),
            "robot": identity.model,
            "serial_number": identity.serial_number,
            "pace": named_pace.value,
            "speed": speed,
            "seed": seed,
            "fidelity": fidelity,
        }
        context = Context(self._access, player, time.monotonic, self._identity_now)
        self._operations = OperationRunner(self._loop, context)
        self._wanted_control_port = control_port
        if control_port is not None:
            from ur_emulator.control.http_port import HttpPort

            ports[CONTROL] = HttpPort(self._access, self._operations, host)
        self._port_set = PortSet(self._loop, host, self._box, ports)
        self.is_shut_down = False
        self.failure: Exception | None = None
        self.on_shut_down: Callable[[], None] = self._loop.stop if self._owns_loop else self.close

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
        from ur_emulator.rack import BoxRack, counted_up

        return BoxRack(counted_up(count, options))

    # --- what is going on, and what shall happen

    @property
    def notices(self) -> list[str]:
        """What a user should know although the box runs, one line each."""
        return self._port_set.notices

    def _log_entries(self) -> tuple[LogEntry, ...]:
        return self._box.log.entries

    def follow_log(self, follower: Callable[[LogEntry], None]) -> None:
        """Call `follower` with every entry of the log from now on, in the thread of the loop.

        It must not block and must not raise. To be called before the box runs.
        """
        self._box.log.follow(follower)

    def submit(self, command: Command, done: Done | None = None) -> None:
        """Ask for something as a client of the box would, from any thread; it acts in the next cycle.

        Args:
            command: one of `ur_emulator.commands`, such as `operator.ClosePopup()` or `power.PowerOff()`.
            done: told in that cycle, in the thread of the box, what has come of it: its result and None, or
                None and the `RefusedError`.
        """
        self._loop.call_soon_threadsafe(lambda: self._box.submit(command, done))

    def _perform(self, name: str, arguments: Mapping[str, Any]) -> Any:
        return self._operations.perform(name, arguments)

    def _identity_now(self) -> dict[str, Any]:
        ports = {**dataclasses.asdict(self.ports), "control": self.control_port}
        return {**self._facts, "host": self.host, "ports": {name: n for name, n in ports.items() if n}}

    # --- life

    def listen(self) -> None:
        """Open all ports; once they are open, nothing happens.

        Raises:
            PortError: one of them is taken; none stays open then and the box cannot be used any more.
        """
        if self._port_set.is_open:
            return
        try:
            numbers = self._port_set.open(self._wanted_numbers())
        except EmulatorError:
            self.close()
            raise
        self.control_port = numbers.pop(CONTROL, 0)
        self.ports = dataclasses.replace(self.ports, **{MODBUS: 0, **numbers})
        self._loop.add(self._box)

    def _wanted_numbers(self) -> dict[str, int]:
        """Numbers of the ports to open by name; 0 takes a free one."""
        numbers = dataclasses.asdict(self.ports)
        if self._free_ports:
            numbers = dict.fromkeys(numbers, 0)
        elif not numbers[MODBUS]:
            del numbers[MODBUS]
        if self._wanted_control_port is not None:
            numbers[CONTROL] = self._wanted_control_port
        return numbers

    def serve_forever(self) -> None:
        """Run in the calling thread until `stop`; the ports must be open."""
        self._must_be_alone()
        self._runner.run()

    def stop(self) -> None:
        """Let the loop end, from any thread; in a rack that is the loop of all its boxes."""
        self._runner.stop()

    def __enter__(self) -> Self:
        """Open the ports and run the loop in a thread."""
        self._must_be_alone()
        self.listen()
        self._runner.start("control-box")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the loop; an error that ended it earlier is raised here."""
        failure = self._runner.finish()
        if failure is not None and error is None:
            raise failure

    def _shut_down(self) -> None:
        """Close the box as one that was switched off, after what is under way in the loop."""
        self.is_shut_down = True
        self._loop.call_soon_threadsafe(self.on_shut_down)

    def fail_alone(self, then: Callable[[], None]) -> None:
        """Let an error in a cycle end this box and not the loop, for a rack; `then` is called afterwards."""

        def note(error: Exception) -> None:
            self.failure = error
            text = f"the box has ended: {type(error).__name__}: {error}"
            self._box.log.write(self._access.snapshot.tick, "Controller", text, ReportLevel.FAULT)
            then()

        self._box.on_failure = note

    def _must_be_alone(self) -> None:
        if not self._owns_loop:
            raise EmulatorError("this box is one of several in a rack: start the rack, it runs them all")

    def close(self) -> None:
        """Close all ports and connections, in the loop's thread or after it; harmless if closed already."""
        self._loop.remove(self._box)
        self._access.close(NotRunningError(ENDED))
        self._operations.close()
        self._intake.close()
        self._reports.close()
        self._network.close()
        self._port_set.close()
        if self._owns_loop:
            self._loop.close()


def _standard_ports(base: int) -> Ports:
    try:
        return Ports.standard(base)
    except LocalProtocolError as error:
        raise EmulatorError(str(error)) from None


def _parse_pace(pace: str | Pace) -> Pace:
    try:
        return Pace(pace)
    except ValueError:
        raise EmulatorError(
            f"unknown pace {pace!r}: choose one of {', '.join(p.value for p in Pace)}"
        ) from None
