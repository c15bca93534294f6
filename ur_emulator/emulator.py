"""The control box for users: assembles controller, loop and ports, and runs them.

    with ControlBox(robot="ur3", pace="lockstep", seed=7) as box:
        print(box.host, box.ports.realtime)

`with` runs the loop in a thread of its own; `serve_forever` runs it in the calling thread, as the command
line does.
"""

from __future__ import annotations

import dataclasses
import math
import sys
import threading
from collections.abc import Callable
from types import TracebackType
from typing import Self

from protocol.ur_types import Ports, RobotMode, SoftwareVersion, simulated_serial
from ur_emulator.box_log import LogEntry
from ur_emulator.controller.commands import Command
from ur_emulator.controller.controller import Controller
from ur_emulator.errors import EmulatorError, PortPermissionError
from ur_emulator.models.fidelity import fidelity_by_name
from ur_emulator.models.robots import robot_by_name
from ur_emulator.realtime.event_loop import EventLoop
from ur_emulator.realtime.pacing import Pace, make_pacer
from ur_emulator.realtime.served_box import ServedBox
from ur_emulator.servers.dashboard_port import BUILD, BoxIdentity, DashboardPort
from ur_emulator.servers.listener import Listener, Port
from ur_emulator.servers.modbus_loading import CodecLoader
from ur_emulator.servers.modbus_server import ModbusPort
from ur_emulator.servers.primary_port import PrimaryPort
from ur_emulator.servers.program_intake import ProgramIntake
from ur_emulator.servers.realtime_port import RealtimePort
from ur_emulator.servers.robot_state import StateEncoder
from ur_emulator.servers.rtde_port import RtdePort
from ur_emulator.servers.script_sockets import LoopNetwork

DEFAULT_VERSION = "3.15.8"
# The compile worker shares the interpreter with the loop; short turns keep the loop on time.
_SWITCH_INTERVAL = 1e-4  # s
_JOIN_TIMEOUT = 10.0  # s


class ControlBox:
    """An emulated control box, powered on with its brakes released.

    Attributes:
        host: address that it listens on.
        ports: numbers of its ports; that for Modbus is 0 if it is not open.
        port_base: what was added to the standard ones.
        serial_number: as the dashboard gives it; simulated boxes are recognisable by it.
        notices: what a user should know although the box runs, one line each.
    """

    def __init__(
        self,
        robot: str = "ur3",
        version: str = DEFAULT_VERSION,
        host: str = "127.0.0.1",
        pace: str | Pace = Pace.REALTIME,
        speed: float = 1.0,
        seed: int = 0,
        fidelity: str = "typical",
        port_base: int | None = 0,
    ) -> None:
        """Assemble the box; nothing listens before it is started.

        Args:
            robot: type of the arm, "ur3".
            version: software that the box pretends to run; decides layouts and builtins.
            host: address to listen on; other machines can reach the box only through an address of theirs.
            pace: "realtime" or "lockstep".
            speed: how many times as fast as real time (realtime pace only).
            seed: of calibration, phases and noise; the same seed is the same arm.
            fidelity: "ideal", "typical" or "poor".
            port_base: offset added to all standard ports; None takes free ports.

        Raises:
            EmulatorError: an argument is not among the allowed ones.
        """
        model = robot_by_name(robot)
        software = _parse_version(version)
        imperfections = fidelity_by_name(fidelity)
        named_pace = _parse_pace(pace)
        if not 0.0 < speed < math.inf:
            raise EmulatorError(f"speed {speed:g} given: it must be above 0 and finite, 1 is real time")
        if seed < 0:
            raise EmulatorError(f"seed {seed} given: it must be 0 or above")
        if not host:
            raise EmulatorError("no host given: name an address, 127.0.0.1 keeps other machines out")
        self.host = host
        self.port_base = port_base or 0
        self.ports = Ports.standard(self.port_base)
        self.serial_number = simulated_serial(model.robot_type, seed)
        self._free_ports = port_base is None
        self._loop = EventLoop(precise=named_pace is Pace.REALTIME)
        modbus = CodecLoader(self._loop)
        self._network = LoopNetwork(self._loop, modbus)
        controller = Controller(model, imperfections, seed, self._network, mode=RobotMode.RUNNING)
        controller.state.ports.version = (software.major, software.minor)
        self._box = ServedBox(
            controller, make_pacer(named_pace, controller.period_s, speed), self._loop.expect_soon
        )
        self._intake = ProgramIntake(self._loop, software, self._box.submit, self._box.announce)
        identity = BoxIdentity(software, model.title, self.serial_number)
        states = StateEncoder(software)
        # In the order in which they hear of a cycle: first those whose clients act on it.
        self._port_objects: dict[str, Port] = {
            "realtime": RealtimePort(software, self._intake),
            "rtde": RtdePort(identity.version._replace(build=BUILD), controller, self._box.submit),
            "primary": PrimaryPort(software, controller, self._intake, states, all_messages=True),
            "secondary": PrimaryPort(software, controller, self._intake, states, all_messages=False),
            "dashboard": DashboardPort(identity, controller, self._box.submit),
            "modbus": ModbusPort(controller, self._box.submit, modbus),
            "realtime_ro": RealtimePort(software, None),
            "primary_ro": PrimaryPort(software, controller, None, states, all_messages=True),
            "secondary_ro": PrimaryPort(software, controller, None, states, all_messages=False),
        }
        self._listeners: dict[str, Listener] = {}
        self.notices: list[str] = []
        self._thread: threading.Thread | None = None
        self._failure: BaseException | None = None

    # --- what is going on, and what shall happen

    @property
    def log(self) -> tuple[LogEntry, ...]:
        """The last entries of the log, the oldest first; may be asked from any thread."""
        return self._box.log.entries

    def follow_log(self, follower: Callable[[LogEntry], None]) -> None:
        """Call `follower` with every entry of the log from now on, in the thread of the loop.

        It must not block and must not raise. To be called before the box runs.
        """
        self._box.log.follow(follower)

    def submit(self, command: Command) -> None:
        """Ask for something as a client of the box would, from any thread; it acts in the next cycle.

        Args:
            command: one of `ur_emulator.controller.commands`, such as `ClosePopup()` or `AnswerRequest(5)`.
        """
        self._loop.call_soon_threadsafe(lambda: self._box.submit(command))

    # --- life

    def listen(self) -> None:
        """Open all ports; once they are open, nothing happens.

        Raises:
            PortError: one of them is taken; none stays open then and the box cannot be used any more.
        """
        if self._listeners:
            return
        try:
            for name, port in self._port_objects.items():
                self._listen_on(name, port)
        except EmulatorError:
            self._close()
            raise
        numbers = {name: item.number for name, item in self._listeners.items()}
        self.ports = dataclasses.replace(self.ports, **{"modbus": 0, **numbers})
        for port in self._port_objects.values():
            self._box.attach(port)  # type: ignore[arg-type]
        self._loop.add(self._box)

    def _listen_on(self, name: str, port: Port) -> None:
        """Open one port; of all, only Modbus may be missing: its number is one that needs privileges."""
        number = 0 if self._free_ports else getattr(self.ports, name)
        if name == "modbus" and not (number or self._free_ports):
            return
        try:
            self._listeners[name] = Listener(
                self._loop, self.host, number, port, self._box.backlog, self._box.notice, name
            )
        except PortPermissionError as error:
            if name != "modbus":
                raise
            self.notices.append(f"no Modbus server: {error}")

    def serve_forever(self) -> None:
        """Run in the calling thread until `stop`; the ports must be open."""
        sys.setswitchinterval(_SWITCH_INTERVAL)
        try:
            self._loop.run()
        finally:
            self._close()

    def stop(self) -> None:
        """Let the loop end, from any thread."""
        self._loop.stop()

    def __enter__(self) -> Self:
        """Open the ports and run the loop in a thread."""
        self.listen()
        self._thread = threading.Thread(target=self._run_in_thread, name="control-box", daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the loop; an error that ended it earlier is raised here."""
        self.stop()
        if self._thread is not None:
            self._thread.join(_JOIN_TIMEOUT)
        if self._failure is not None and error is None:
            raise self._failure

    def _run_in_thread(self) -> None:
        try:
            self.serve_forever()
        except BaseException as failure:  # kept for the thread that leaves the `with` block
            self._failure = failure

    def _close(self) -> None:
        self._intake.close()
        self._network.close()
        for listener in self._listeners.values():
            listener.close()
        for port in self._port_objects.values():
            for connection in tuple(port.clients):  # type: ignore[attr-defined]
                connection.close()
        self._loop.close()


def _parse_version(text: str) -> SoftwareVersion:
    try:
        version = SoftwareVersion.parse(text)
    except Exception as error:
        raise EmulatorError(str(error)) from None
    if version.major != 3:
        raise EmulatorError(
            f"version {text} given: this box is a CB3, its software is 3.x, for example {DEFAULT_VERSION}"
        )
    return version


def _parse_pace(pace: str | Pace) -> Pace:
    try:
        return Pace(pace)
    except ValueError:
        raise EmulatorError(
            f"unknown pace {pace!r}: choose one of {', '.join(p.value for p in Pace)}"
        ) from None
