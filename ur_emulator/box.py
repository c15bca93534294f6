"""One control box, assembled: controller, ports and operations. `emulator` and `rack` run it on a loop."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Collection, Mapping
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

from protocol.primary.messages import ReportLevel
from protocol.serial_numbers import simulated_serial
from protocol.ur_types import Ports, RobotMode, RobotType
from ur_emulator.box_log import LogEntry
from ur_emulator.box_options import check_options, parse_pace, standard_ports
from ur_emulator.control.operations import BoxOperations, make
from ur_emulator.control.runner import ENDED, OperationRunner
from ur_emulator.control.step_operation import Context
from ur_emulator.controller.command import Command, Done
from ur_emulator.controller.controller import Controller
from ur_emulator.errors import EmulatorError, NotRunningError
from ur_emulator.models.robot_generation import RobotGeneration
from ur_emulator.models.robots import robot_by_name
from ur_emulator.programs.folder import ProgramFolder
from ur_emulator.realtime.event_loop import WAKE_UP, EventLoop
from ur_emulator.realtime.pacing import Pace, make_pacer
from ur_emulator.realtime.served_box import ServedBox
from ur_emulator.realtime.worker_process import prestart_process
from ur_emulator.scripting.program_slot import ProgramSlot
from ur_emulator.servers.box_access import BoxAccess, BoxIdentity
from ur_emulator.servers.box_ports import SendingPorts, answering_ports
from ur_emulator.servers.port_set import CONTROL, PortSet
from ur_emulator.servers.programs.intake import ProgramIntake
from ur_emulator.servers.programs.player import ProgramPlayer
from ur_emulator.servers.programs.start_up import start_up
from ur_emulator.servers.reports.report_writer import ReportWriter
from ur_emulator.servers.scripts.closed_ports import close_to_scripts, give_back
from ur_emulator.servers.scripts.loop_network import LoopNetwork


class Box(BoxOperations):
    """An emulated control box, powered on with its brakes released.

    Its operations stand in `BoxOperations`.

    Attributes:
        generation: that of its arm: control cycle, software and what comes with it.
        host: address that it listens on.
        ports: numbers of its ports; 0 for one that it does not have.
        title: arm, generation and software.
        control_port: number of the port for the control API over HTTP, 0 if it is not open.
        port_base: what was added to the standard ones.
        serial_number: as the dashboard gives it; simulated boxes are recognisable by it.
        is_shut_down: a dashboard client has switched the box off: its ports are closed.
        failure: the error that has ended the box, None while there is none.
        on_end: called in the loop's thread when the box was switched off or an error has ended it.
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
        control_token: str | None = None,
        skip_unknown_nodes: bool = False,
        remote_control: bool = True,
        services: Collection[str] = (),
        *,
        loop: EventLoop | None = None,
        phase: float = 0.0,
        lead: float = WAKE_UP,
        generation: RobotGeneration | None = None,
    ) -> None:
        """Assemble the box; nothing listens before it is started.

        Args:
            robot: type of the arm, such as "ur3" or "ur5e".
            version: software that the box pretends to run; decides layouts and builtins. None: the usual one.
            host: address to listen on; other machines can reach the box only through an address of theirs.
            pace: "realtime" or "lockstep".
            speed: how many times as fast as real time (realtime pace only).
            seed: of calibration, phases and noise; the same seed is the same arm.
            fidelity: "exact" (no physics: measured equals asked), "ideal", "typical", "poor", or a file
                that ends in .toml (docs/fidelity.md).
            port_base: offset added to all standard ports; None takes free ports.
            programs: folder of programs and installations, for the dashboard's `load`; None for none.
            control_port: number of the port for the control API over HTTP (docs/control.md); 0: a free one,
                None: none.
            control_token: what requests on that port must show; None: nothing, on a loopback address only.
            skip_unknown_nodes: run programs of PolyScope without the nodes that are not known, those of
                URCaps above all; the log names each.
            remote_control: clients may command the box; False: it starts in local control (e-Series).
            services: of a PolyScope X box, whose ports stay closed until they are enabled: "primary" and
                "rtde".
            loop: shared with other boxes; None gives the box its own.
            phase: which part of a period its cycles lie after those of the first box of the loop.
            lead: how long before its deadline a cycle may be computed [s] (realtime pace only).
            generation: in place of that of the arm.

        Raises:
            EmulatorError: an argument is not among the allowed ones.
        """
        model = robot_by_name(robot, version)
        if generation is not None:
            model = dataclasses.replace(model, generation=generation)
        self.generation = generation = model.generation
        asked = model.software_version(version)
        software = generation.software(asked)
        imperfections = generation.fidelity(fidelity)
        closed = generation.closed_ports(services)
        named_pace = parse_pace(pace)
        check_options(host, speed, seed, programs, control_port, control_token)
        if not (remote_control or generation.has_remote_control):
            raise EmulatorError(
                f"local control given: a box of the {generation.name} has none, "
                "its clients may always command it"
            )
        prestart_process()  # it loads the compiler while the box is assembled
        self.title = f"{model.title} {generation.name} {asked}"
        self.host = host
        self.port_base = port_base or 0
        self.ports = standard_ports(self.port_base)
        self.serial_number = simulated_serial(model.robot_type, seed)
        self._free_ports = port_base is None
        self._loop = loop or EventLoop(precise=named_pace is Pace.REALTIME)
        self._network = LoopNetwork(self._loop, generation.period_s, self._report, host)
        controller = Controller(
            model,
            imperfections,
            seed,
            partial(ProgramSlot, network=self._network),
            mode=RobotMode.RUNNING,
            version=(asked.major, asked.minor),
        )
        controller.state.operator.set_remote_control(remote_control)
        self._box = ServedBox(
            controller,
            make_pacer(named_pace, controller.period_s, speed, phase, lead),
            self._loop.expect_soon,
            self._fail,
        )
        self._intake = ProgramIntake(self._loop.tasks, software.catalogue, self._box, controller.period_s)
        identity = BoxIdentity(software, model.title, RobotType(model.robot_type).name, self.serial_number)
        self._access = BoxAccess(identity, self._box, self._loop, self._network)
        folder = ProgramFolder(None if programs is None else Path(programs))
        self._player = player = ProgramPlayer(self._access, folder, skip_unknown=skip_unknown_nodes)
        self._reports = ReportWriter(self._access, player)
        sending = SendingPorts.make(self._access, self._intake)
        self._box.attach(
            (*sending.in_order, self._intake, self._access.steps),
            [port.send_message for port in sending.messengers],
        )
        ports = sending.by_name | answering_ports(self._access, player, self._reports, self._shut_down, host)
        self.ports = Ports.of({name: getattr(self.ports, name) for name in ports if name not in closed})
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
        context = Context(self._access, player, time.monotonic, self._identity_now, make)
        self._operations = OperationRunner(self._loop, context)
        self._wanted_control_port = control_port
        if control_port is not None:
            from ur_emulator.control.http_answers import ControlAnswers
            from ur_emulator.servers.http.port import HttpPort

            answers = ControlAnswers(self._operations, host, control_token)
            ports[CONTROL] = HttpPort(self._access, answers)
        self._port_set = PortSet(self._loop, host, self._box, ports)
        if closed:
            self._port_set.notices.append(
                f"{len(closed)} ports stay closed, as on a new {generation.name} box: "
                f"--services {','.join(generation.services)} enables them"
            )
        self.is_shut_down = False
        self.failure: Exception | None = None
        self.on_end: Callable[[], None] = self._loop.stop if loop is None else self.close

    # --- log and commands

    @property
    def notices(self) -> list[str]:
        """Warnings for the user, one line each; the box runs all the same."""
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
            done: called in that cycle, in the thread of the box: with its result and None, or with
                None and the error, a `RefusedError` if it was refused.
        """
        self._loop.call_soon_threadsafe(lambda: self._box.submit(command, done), self._fail)

    def _perform(self, name: str, arguments: Mapping[str, Any]) -> Any:
        return self._operations.perform(name, arguments)

    def _identity_now(self) -> dict[str, Any]:
        ports = {**dataclasses.asdict(self.ports), "control": self.control_port}
        return {**self._facts, "host": self.host, "ports": {name: n for name, n in ports.items() if n}}

    # --- life

    def listen(self) -> None:
        """Open all ports; harmless if they are open.

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
        if self.control_port:
            close_to_scripts(self, self.control_port)
        self.ports = Ports.of(numbers)
        self._loop.keep_pace(self._box.controller.period_s)
        self._loop.add(self._box)
        self._loop.tasks.start()
        begin = start_up(self._access, self._player)
        self._loop.call_soon_threadsafe(lambda: self._access.start_alone(begin), self._fail)

    def _wanted_numbers(self) -> dict[str, int]:
        """Numbers of the ports to open by name; 0 takes a free one."""
        numbers = {name: number for name, number in dataclasses.asdict(self.ports).items() if number}
        if self._free_ports:
            numbers = dict.fromkeys(numbers, 0)
        if self._wanted_control_port is not None:
            numbers[CONTROL] = self._wanted_control_port
        return numbers

    def _shut_down(self) -> None:
        """Close the box as one that was switched off, after the present turn of the loop."""
        self.is_shut_down = True
        self._loop.call_soon_threadsafe(lambda: self.on_end(), self._fail)

    def _fail(self, error: Exception) -> None:
        """End the box because of an error in a cycle."""
        self.failure = error
        text = f"the box has ended: {type(error).__name__}: {error}"
        self._box.log.write(self._access.snapshot.tick, "Controller", text, ReportLevel.FAULT)
        self.on_end()

    def _report(self, what: str, error: Exception) -> None:
        self._box.report(what, error)

    def close(self) -> None:
        """Close all ports and connections, in the loop's thread or after it; harmless if closed already."""
        self._loop.remove(self._box)
        self._access.close(NotRunningError(ENDED))
        self._operations.close()
        self._intake.close()
        self._reports.close()
        self._network.close()
        self._port_set.close()
        give_back(self)
