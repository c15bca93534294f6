"""One control box, assembled: controller, ports and operations. `rack` runs it on a loop."""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Callable, Collection
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from typing import Any
from weakref import WeakSet

from protocol.errors import ProtocolError
from protocol.primary.messages import ReportLevel
from protocol.serial_numbers import simulated_serial
from protocol.ur_types import LOCKSTEP_MASTERBOARD, SIMULATED_MASTERBOARD, Ports, RobotType, SoftwareVersion
from ur_emulator.errors import ControlError, EmulatorError, ModelError, NotRunningError
from ur_emulator.host.box_options import BoxOptions, ServedAt
from ur_emulator.host.control_api.operations import make
from ur_emulator.host.control_api.step_operations import Context, StepOperation
from ur_emulator.host.journal import Journal
from ur_emulator.host.memory import MemoryWatch
from ur_emulator.host.pacing import LockstepPacer, Pace, RealtimePacer
from ur_emulator.host.player.player import ProgramPlayer, start_up
from ur_emulator.host.ports.port_set import CONTROL, SOFTWARE_OF, PortSet, answering_ports, sending_ports
from ur_emulator.host.ports.primary.port import PrimaryPort
from ur_emulator.host.ports.script_intake import ProgramIntake
from ur_emulator.host.reports.report_writer import ReportWriter
from ur_emulator.host.runtime.event_loop import WAKE_UP
from ur_emulator.host.runtime.listener import Port
from ur_emulator.host.runtime.processes import prepare_workers
from ur_emulator.host.runtime.worker import TaskQueue
from ur_emulator.host.script_network.addresses import close_to_scripts, give_back
from ur_emulator.host.script_network.loop_network import LoopNetwork
from ur_emulator.host.served_box import BoxIdentity, ServedBox
from ur_emulator.host.steps import Finished, Steps, result_of, settle
from ur_emulator.machine.commands.operation import CommandOperation, Operation
from ur_emulator.machine.controller.command import Command, Done
from ur_emulator.machine.controller.events import LogAdded
from ur_emulator.machine.machine import Machine
from ur_emulator.machine.models.fidelity import Fidelity
from ur_emulator.machine.models.robot_model import RobotModel
from ur_emulator.machine.models.robots import robot_by_name
from ur_emulator.machine.plant.scene import load_scene
from ur_emulator.program_files.folder import ProgramFolder
from ur_hil.cell import Cell
from ur_hil.tools import ToolModel, tools_by_name

# Longest value of an argument in the log, in characters.
_MAX_SHOWN = 60


@dataclasses.dataclass(frozen=True, slots=True)
class Choice:
    """What the arguments of a box amount to; the ports in `closed` stay closed."""

    model: RobotModel
    version: SoftwareVersion
    fidelity: Fidelity
    closed: Collection[str]
    identity: BoxIdentity
    tools: tuple[ToolModel, ...]
    scene: Cell | Path | None

    @classmethod
    def of(cls, options: BoxOptions) -> Choice:
        """Check the arguments, and look up what they name; EmulatorError for one that is not allowed."""
        model = robot_by_name(str(options.robot), options.version)
        if options.generation is not None:
            model = dataclasses.replace(model, generation=options.generation)
        generation = model.generation
        version = model.software_version(options.version)
        software = generation.software(version)
        fidelity = generation.fidelity(options.fidelity)
        closed = generation.closed_ports(options.services)
        options.check()
        if not (options.remote_control or generation.has_remote_control):
            raise EmulatorError(
                f"local control given: a box of the {generation.name} has none, "
                "its clients may always command it"
            )
        identity = BoxIdentity(
            software,
            model=model.title,
            wire_model=RobotType(model.robot_type).name,
            serial_number=simulated_serial(model.robot_type, options.seed),
            masterboard=LOCKSTEP_MASTERBOARD if options.pace == Pace.LOCKSTEP else SIMULATED_MASTERBOARD,
        )
        tools = tools_by_name(str(options.tool), ModelError)
        scene = None if options.scene is None else load_scene(Path(options.scene))
        return cls(model, version, fidelity, closed, identity, tools, scene)

    @property
    def notices(self) -> tuple[str, ...]:
        """Warnings for the user, one line each."""
        if not self.closed:
            return ()
        generation = self.model.generation
        return (
            f"{len(self.closed)} ports stay closed, as on a new {generation.name} box: "
            f"--services {','.join(generation.services)} enables them",
        )

    def make_machine(self, options: BoxOptions) -> Machine:
        """Return the box without its ports."""
        return Machine(
            self.model,
            self.fidelity,
            options.seed,
            version=(self.version.major, self.version.minor),
            tools=self.tools,
            scene=self.scene,
            remote_control=options.remote_control,
        )

    def served_at(self, options: BoxOptions, ports: Collection[str]) -> ServedAt:
        """Return where a box with these ports is to be found; they are not open yet.

        EmulatorError if the numbers of its ports are not all numbers of TCP.
        """
        try:
            standard = Ports.standard(options.port_base or 0)
        except ProtocolError as error:
            raise EmulatorError(str(error)) from None
        without = {CONTROL, *self.closed}
        return ServedAt(
            title=f"{self.model.title} {self.model.generation.name} {self.version}",
            serial_number=self.identity.serial_number,
            host=options.host,
            ports=Ports.of({name: getattr(standard, name) for name in ports if name not in without}),
            port_base=options.port_base or 0,
        )


class Box:
    """An emulated control box, powered on with its brakes released.

    Attributes:
        served_at: where clients find it, and as what.
        log: programs, errors, modes, text messages, clients.
        is_shut_down: a dashboard client has switched the box off: its ports are closed.
        failure: the error that has ended the box, None while there is none.
        on_end: called in the loop's thread when the box was switched off or an error has ended it.
    """

    def __init__(
        self, options: BoxOptions, *, tasks: TaskQueue, phase: float = 0.0, lead: float = WAKE_UP
    ) -> None:
        """Assemble the box; nothing listens before `listen`. EmulatorError if an argument is not allowed.

        Args:
            tasks: with their loop perhaps shared with other boxes.
            phase: which part of a period its cycles lie after those of the first box of the loop.
            lead: how long before its deadline a cycle may be computed [s] (realtime pace only).
        """
        choice = Choice.of(options)
        prepare_workers()  # the compiler is loaded while the box is assembled
        period = choice.model.generation.period_s
        folder = ProgramFolder(None if options.programs is None else Path(options.programs))
        self._options = options
        self._choice = choice
        self._loop = loop = tasks.loop
        self._tasks = tasks
        machine = choice.make_machine(options)
        self._box = ServedBox(
            machine,
            choice.identity,
            LockstepPacer(period)
            if options.pace == Pace.LOCKSTEP
            else RealtimePacer(period, options.speed, phase, lead),
            tasks,
            self._fail,
        )
        self.log = self._box.log
        self._network = self._box.network = LoopNetwork(
            loop, machine.network, period, self._box.arrive, self._box.report, options.host
        )
        self._intake = ProgramIntake(tasks, self._box)
        self._player = ProgramPlayer(
            self._box, folder, self._network, skip_unknown=options.skip_unknown_nodes
        )
        self._reports = ReportWriter(self._box, self._player)
        self._journal: Journal | None = None
        if options.journal is not None:
            self._journal = Journal(Path(options.journal), options, self._box.notice)
            self._box.keep = self._journal.write
        self._context = Context(self._box, self._player, self._identity_now, make)
        self._lock = threading.Lock()
        self._awaited: WeakSet[Future[Any]] = WeakSet()
        self._is_closed = False
        sending = sending_ports(self._box, self._intake)
        ports: dict[str, Port] = {
            **sending,
            **answering_ports(self._box, self._player, self._reports, self._shut_down, options.host),
            **self._control_port(),
        }
        self._port_set = PortSet(loop, options.host, self._box, ports)
        self._box.attach(
            (*sending.values(), self._intake, self._box.steps),
            [port.send_message for port in sending.values() if isinstance(port, PrimaryPort)],
        )
        self.served_at = choice.served_at(options, ports)
        self.is_shut_down = False
        self.failure: Exception | None = None
        self.on_end: Callable[[], None] = self.close

    # --- what users ask of it

    def submit(self, command: Command, done: Done | None = None) -> None:
        """Take a command for the next cycle, from any thread; `done` is called then, in that of the loop."""
        self._loop.call_soon_threadsafe(lambda: self._box.submit(command, done), self._fail)

    def perform(self, operation: Operation[Any]) -> Any:
        """Do an operation, from any thread but the loop's; return its result, or raise ControlError."""
        if self._loop.is_own_thread:
            raise ControlError(
                f"{operation.api_name} called in the thread of the box, which cannot wait: use `submit`"
            )
        future: Future[Any] = Future()
        with self._lock:
            if self._is_closed or not self._loop.is_running:
                raise NotRunningError(
                    NotRunningError.ENDED if self._is_closed else "the box does not run: start it first"
                )
            self._awaited.add(future)

        def start() -> None:
            if not self._is_closed:
                self.begin(operation, settle(future))

        self._loop.call_soon_threadsafe(start, future.set_exception)
        return future.result()

    def begin(self, operation: Operation[Any], finished: Finished) -> None:
        """Begin with an operation, in the thread of the loop; `finished` gets its result or its error."""
        self._box.steps.start(self.operate(operation), finished)

    def operate(self, operation: Operation[Any]) -> Steps[Any]:
        """Write an operation into the log, do it, and return its result; in the thread of the loop."""
        if operation.is_logged and not operation.only_reads:
            self._box.announce(LogAdded("Control", _shown(operation)))
        if isinstance(operation, StepOperation):
            return (yield from result_of(operation.steps(self._context)))
        assert isinstance(operation, CommandOperation)
        result = yield from self._box.apply(operation)
        return {**(result or {}), "tick": self._box.snapshot.tick}

    # --- what it is made of

    def watch_memory(self, watch: MemoryWatch) -> None:
        """Have the memory of the process measured after each cycle; before the box runs."""
        self._box.watch = partial(watch.look, self._box)

    def _identity_now(self) -> dict[str, Any]:
        options, identity, at = self._options, self._choice.identity, self.served_at
        ports = {**dataclasses.asdict(at.ports), "control": at.control_port}
        return {
            "software": str(self._choice.version),
            "robot": identity.model,
            "serial_number": identity.serial_number,
            "pace": str(options.pace),
            "speed": options.speed,
            "seed": options.seed,
            "fidelity": options.fidelity,
            "host": at.host,
            "ports": {name: n for name, n in ports.items() if n},
        }

    def _control_port(self) -> dict[str, Port]:
        """Make the port for the control API, if it is wanted; a box without HTTP does not load it."""
        if self._options.control_port is None:
            return {}
        from ur_emulator.host.control_api.http_answers import ControlAnswers
        from ur_emulator.host.ports.http import HttpPort

        answers = ControlAnswers(self.operate, self._options.host, self._options.control_token)
        return {CONTROL: HttpPort(self._box, answers.answer)}

    # --- life

    def listen(self) -> None:
        """Open all ports; harmless if they are open.

        PortError if one is taken; none stays open then and the box cannot be used any more.
        """
        if self._port_set.is_open:
            return
        try:
            numbers = self._port_set.open(self._wanted_numbers())
        except EmulatorError:
            self.close()
            raise
        if control_port := numbers.pop(CONTROL, 0):
            close_to_scripts(self, control_port)
        for name, number in numbers.items():
            self._network.own_ports[getattr(Ports(), name)] = (self._options.host, number)
        self.served_at = dataclasses.replace(
            self.served_at,
            ports=Ports.of(numbers),
            control_port=control_port,
            notices=(*self._choice.notices, *self._port_set.notices),
        )
        self._loop.keep_pace(self._box.controller.period_s)
        self._loop.add(self._box)
        self._tasks.start()
        begin = start_up(self._box, self._player)
        self._loop.call_soon_threadsafe(lambda: self._box.start_alone(begin), self._fail)

    def _wanted_numbers(self) -> dict[str, int]:
        """Numbers of the ports to open by name; 0 takes a free one."""
        ports = dataclasses.asdict(self.served_at.ports)
        numbers = {name: number for name, number in ports.items() if number}
        for tool in self._choice.tools:
            if tool.kind in SOFTWARE_OF:
                numbers.setdefault(SOFTWARE_OF[tool.kind][0], 0)  # moved beyond the ports of TCP
        if self._options.port_base is None:
            numbers = dict.fromkeys(numbers, 0)
        if self._options.control_port is not None:
            numbers[CONTROL] = self._options.control_port
        return numbers

    def _shut_down(self) -> None:
        """Close the box as one that was switched off, after the present turn of the loop."""
        self.is_shut_down = True
        self._loop.call_soon_threadsafe(lambda: self.on_end(), self._fail)

    def _fail(self, error: Exception) -> None:
        self.failure = error
        text = f"the box has ended: {type(error).__name__}: {error}"
        self._box.log.write(self._box.snapshot.tick, "Controller", text, ReportLevel.FAULT)
        self.on_end()

    def close(self) -> None:
        """Close all ports and connections, in the loop's thread or after it; harmless if closed already."""
        self._loop.remove(self._box)
        self._box.steps.close(NotRunningError())
        with self._lock:
            self._is_closed = True
            awaited = tuple(self._awaited)
        for future in awaited:
            if not future.done():
                future.set_exception(NotRunningError())
        self._intake.close()
        self._reports.close()
        self._network.close()
        self._port_set.close()
        if self._journal is not None:
            self._journal.close()
        give_back(self)


def _shown(operation: Operation[Any]) -> str:
    """Return an operation as one line for the log."""
    words = [operation.api_name]
    for key, value in operation.as_given.items():
        if value is not None:
            text = " ".join(str(value).split())
            words.append(f"{key}={text if len(text) <= _MAX_SHOWN else text[: _MAX_SHOWN - 3] + '...'}")
    return " ".join(words)
