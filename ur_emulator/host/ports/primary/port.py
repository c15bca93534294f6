"""Ports 30001, 30002 and their read-only twins: greeting, states at 10 Hz, messages; script text comes in.

A change of the robot or safety mode leaves in one write with its message and a state that shows it: live
tests of the maker's client library ask for the mode once the message is there.

The first state to a new client, and the first after the brakes have opened, also have kinematics and
configuration.

The primary port also reports the running program: its global variables at the rate of the states, and where
its threads stand in PolyScope's tree.
"""

from protocol.primary import messages, packages
from protocol.primary.framing import NO_TIME
from protocol.ur_types import RobotMode
from ur_emulator.host.ports.primary.program_reports import LabelReporter, VariableReporter
from ur_emulator.host.ports.primary.robot_state import StateEncoder
from ur_emulator.host.ports.script_intake import ProgramIntake, ScriptPort
from ur_emulator.host.runtime.connection import Connection
from ur_emulator.machine.controller import events
from ur_emulator.machine.controller.controller import Controller
from ur_emulator.machine.controller.snapshot import Snapshot
from ur_emulator.machine.models.robot_generation import Software
from urscript import RunningProgram

# --- Controller events as robot messages of the primary port

SECONDARY_EXCEPTION_TITLE = "SECONDARY_PROGRAM_EXCEPTION_XXX"


def message_for(event: events.Event, timestamp: int) -> messages.RobotMessage | None:
    """Return the message for an event, with a time stamp [us]; None for events that stand only in the log."""
    match event:
        case events.ProgramStarted(name):
            return messages.KeyMessage(timestamp=timestamp, title=messages.KeyMessage.STARTED, text=name)
        case events.ProgramStopped(name):
            return messages.KeyMessage(timestamp=timestamp, title=messages.KeyMessage.STOPPED, text=name)
        case events.ProgramPaused(name):
            return messages.KeyMessage(timestamp=timestamp, title=messages.KeyMessage.PAUSED, text=name)
        case events.ProgramResumed() | events.RobotModeChanged() | events.LogAdded():
            return None  # no client knows a message for the first; the states show the second
        case events.TextPrinted(text):
            return messages.TextMessage(timestamp=timestamp, text=text)
        case events.ScriptFailed(line, column, text, secondary):
            if secondary:
                return messages.KeyMessage(timestamp=timestamp, title=SECONDARY_EXCEPTION_TITLE, text=text)
            # A capture shows "no time" on these.
            return messages.RuntimeExceptionMessage(timestamp=NO_TIME, line=line, column=column, text=text)
        case events.ErrorReported(code, argument, level, text):
            return messages.ErrorCodeMessage(
                timestamp=timestamp,
                source=messages.MessageSource.CONTROLLER,
                code=code,
                argument=argument,
                report_level=level,
                text=text,
            )
        case events.SafetyModeChanged(safety_mode):
            return messages.SafetyModeMessage(
                timestamp=timestamp, source=messages.MessageSource.CONTROLLER, safety_mode=safety_mode
            )
        case events.ValueRequested(request_id, kind, text):
            return messages.RequestValueMessage(
                timestamp=timestamp, request_id=request_id, requested_type=kind, text=text
            )
        case events.PopupShown(title, text, warning, error, blocking, request_id):
            return messages.PopupMessage(
                timestamp=timestamp,
                request_id=request_id,
                is_warning=warning,
                is_error=error,
                is_blocking=blocking,
                title=title[: messages.LONGEST_TITLE],
                text=text,
            )


STATE_RATE = 10  # states per second


class PrimaryPort(ScriptPort):
    """Publishes robot states and, on the primary port, messages."""

    def __init__(
        self,
        software: Software,
        controller: Controller,
        intake: ProgramIntake | None,
        states: StateEncoder,
        *,
        all_messages: bool,
    ) -> None:
        """Prepare the greeting.

        Args:
            intake: takes script text; None makes the port read-only.
            states: encodes the states, shared by the ports of a box.
            all_messages: True on the primary port; the secondary one only sends the greeting.
        """
        super().__init__(intake)
        version = self._version = software.version
        self._controller = controller
        self._states = states
        self._all_messages = all_messages
        self._phase = 0
        self._variables = VariableReporter(version)
        self._labels = LabelReporter(version)
        self._was_running = controller.snapshot.robot_mode == RobotMode.RUNNING
        self._greeting = packages.encode_message_package(
            messages.version_message(version, software.built), version
        )
        self._second_greeting = packages.encode_message_package(messages.StartupMessage(), version)
        if packages.sends_safety_tolerances(version):
            self._second_greeting += packages.encode_safety_tolerances()
        if all_messages and messages.HardwareInfoMessage.SINCE.covers(version):
            self._second_greeting += self._package(
                messages.HardwareInfoMessage(robot_type=controller.state.robot.robot_type)
            )

    def opened(self, connection: Connection) -> None:
        """Greet: the version message in a segment of its own, the first, long state, then variables."""
        connection.send(self._greeting)
        connection.send(self._second_greeting)
        connection.send(self._states.encode_first(self._controller.snapshot))
        if self._all_messages:
            programs = self._controller.programs
            if not self._clients:  # the first client: nobody has looked at the program so far
                self._begin_report(programs.latest if programs.is_running else None)
            for package in self._variables.greeting(self._now, is_first=not self._clients):
                connection.send(package)
        super().opened(connection)

    def publish(self, snapshot: Snapshot) -> None:
        """Send a state and what has changed of the variables if they are due in this cycle."""
        if self._clients and (message := self._labels.message(self._now)) is not None:
            self._send(self._package(message))
        cycle_rate = self._controller.generation.cycle_rate
        self._phase += STATE_RATE
        if self._phase < cycle_rate:
            return
        self._phase -= cycle_rate
        state = self._state()
        if self._clients:
            self._send(state, *self._variables.changes(self._now))

    def _state(self) -> bytes:
        """Return the state of the present cycle; the first after the brakes have opened is a long one."""
        snapshot = self._controller.snapshot
        running = snapshot.robot_mode == RobotMode.RUNNING
        has_started, self._was_running = running and not self._was_running, running
        return (self._states.encode_first if has_started else self._states.encode)(snapshot)

    def send_message(self, event: events.Event) -> None:
        """Send the message for an event, on the primary port; with a state if it changes a mode."""
        if isinstance(event, events.ProgramStopped):
            if self._all_messages and self._clients:
                self._send(*self._variables.changes(self._now, at_once=True))
            self._begin_report(None)  # also without clients: it holds the values
        if not self._clients:
            return
        message = message_for(event, self._now) if self._all_messages else None
        package = b"" if message is None else self._package(message)
        if isinstance(event, events.RobotModeChanged | events.SafetyModeChanged):
            package += self._state()
        if package:
            self._send(package)
        if self._all_messages and isinstance(event, events.ProgramStarted):
            self._begin_report(event.run)
            self._send(*self._variables.names(self._now))

    @property
    def _now(self) -> int:
        """Time stamp of the present cycle."""
        return round(self._controller.snapshot.timestamp * 1e6)

    def _package(self, message: messages.RobotMessage) -> bytes:
        return packages.encode_message_package(message, self._version)

    def _begin_report(self, run: RunningProgram | None) -> None:
        """Turn to the variables and labels of a run, or to none."""
        self._variables.begin(run)
        self._labels.begin(run)
