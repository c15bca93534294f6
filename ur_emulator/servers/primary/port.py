"""Ports 30001, 30002 and their read-only twins: greeting, states at 10 Hz, messages; script text comes in.

The first state to a new client, and the first after the brakes have opened, also have kinematics and
configuration.

The primary port also reports the running program: its global variables at the rate of the states, and where
its threads stand in PolyScope's tree.
"""

from __future__ import annotations

from protocol.primary.message_codec import version_message
from protocol.primary.messages import HardwareInfoMessage, RobotMessage, StartupMessage
from protocol.primary.packages import (
    encode_message_package,
    encode_safety_tolerances,
    sends_safety_tolerances,
)
from protocol.ur_types import RobotMode
from ur_emulator.controller.controller import Controller
from ur_emulator.controller.events import Event, ProgramStarted, ProgramStopped
from ur_emulator.controller.snapshot import Snapshot
from ur_emulator.models.software import Software
from ur_emulator.servers.primary.event_messages import message_for
from ur_emulator.servers.primary.label_reporter import LabelReporter
from ur_emulator.servers.primary.robot_state import StateEncoder
from ur_emulator.servers.primary.variable_reporter import VariableReporter
from ur_emulator.servers.programs.intake import ProgramIntake
from ur_emulator.servers.programs.script_port import ScriptPort
from ur_emulator.servers.tcp.connection import Connection
from urscript import RunningProgram

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
            software: decides sizes and contents, and stands in the greeting.
            controller: its snapshot greets new clients.
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
        self._greeting = encode_message_package(version_message(version, software.built), version)
        self._second_greeting = encode_message_package(StartupMessage(), version)
        if sends_safety_tolerances(version):
            self._second_greeting += encode_safety_tolerances()
        if all_messages and HardwareInfoMessage.SINCE.covers(version):
            self._second_greeting += self._package(
                HardwareInfoMessage(robot_type=controller.state.robot.robot_type)
            )

    def opened(self, connection: Connection) -> None:
        """Greet: the version message in a segment of its own, the first, long state, then variables."""
        connection.send(self._greeting)
        connection.send(self._second_greeting)
        connection.send(self._states.encode_first(self._controller.snapshot))
        if self._all_messages:
            programs = self._controller.programs
            if not self._clients:  # the first client: what was sent before does not count
                self._begin_report(programs.latest if programs.is_running else None)
                self._variables.changes(self._now, at_once=True)
            for package in (*self._variables.names(self._now), *self._variables.values(self._now)):
                connection.send(package)
        super().opened(connection)

    def publish(self, snapshot: Snapshot) -> None:
        """Send a state and what has changed of the variables if they are due in this cycle."""
        if self._clients and self._labels.is_watching:
            message = self._labels.message(self._now)
            if message is not None:
                self._send(self._package(message))
        cycle_rate = self._controller.generation.cycle_rate
        self._phase += STATE_RATE
        if self._phase < cycle_rate:
            return
        self._phase -= cycle_rate
        running = snapshot.robot_mode == RobotMode.RUNNING
        has_started, self._was_running = running and not self._was_running, running
        if self._clients:
            encode = self._states.encode_first if has_started else self._states.encode
            self._send(encode(snapshot), *self._variables.changes(self._now))

    def send_message(self, event: Event) -> None:
        """Send the message for an event, on the primary port."""
        if not (self._all_messages and self._clients):
            return
        if isinstance(event, ProgramStopped):
            self._send(*self._variables.changes(self._now, at_once=True))
            self._begin_report(None)
        message = message_for(event, self._now)
        if message is not None:
            self._send(self._package(message))
        if isinstance(event, ProgramStarted):
            self._begin_report(event.run)
            self._send(*self._variables.names(self._now))

    @property
    def _now(self) -> int:
        """Time stamp of the present cycle."""
        return round(self._controller.snapshot.timestamp * 1e6)

    def _package(self, message: RobotMessage) -> bytes:
        return encode_message_package(message, self._version)

    def _begin_report(self, run: RunningProgram | None) -> None:
        """Turn to the variables and labels of a run, or to none."""
        if run is None:
            self._variables.end()
            self._labels.end()
        else:
            self._variables.begin(run)
            self._labels.begin(run)
