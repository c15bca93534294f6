"""Ports 30001, 30002 and their read-only twins: greeting, states at 10 Hz, messages; script text comes in."""

from __future__ import annotations

import zlib

from protocol.primary_messages import StartupMessage, version_message
from protocol.primary_packages import encode_message_package, encode_safety_tolerances, encode_state
from protocol.script_channel import ScriptChannel
from protocol.ur_types import SoftwareVersion
from ur_emulator.controller.controller import Controller
from ur_emulator.controller.cycle import PERIOD_US
from ur_emulator.controller.events import Event
from ur_emulator.controller.snapshot import Snapshot
from ur_emulator.models.calibration import calibrated_dh
from ur_emulator.servers.connection import Connection
from ur_emulator.servers.event_messages import message_for
from ur_emulator.servers.program_intake import ProgramIntake
from ur_emulator.servers.robot_state import StateEncoder, setup_records, state_records

STATE_RATE = 10  # states per second
_CYCLE_RATE = 1_000_000 // PERIOD_US
# The first software seen to send the tolerances package. Source: captures of 3.3 (absent) and 3.10 (present).
_TOLERANCES_SINCE = SoftwareVersion(3, 10)


class PrimaryPort:
    """Publishes robot states and, on the primary port, messages."""

    def __init__(
        self,
        version: SoftwareVersion,
        controller: Controller,
        intake: ProgramIntake | None,
        states: StateEncoder,
        *,
        all_messages: bool,
    ) -> None:
        """Prepare the greeting.

        Args:
            version: decides sizes and contents.
            controller: its snapshot greets new clients.
            intake: takes script text; None makes the port read-only.
            states: encodes the states, shared by the ports of a box.
            all_messages: True on the primary port; the secondary one only sends the greeting.
        """
        self._version = version
        self._controller = controller
        self._intake = intake
        self._states = states
        self._all_messages = all_messages
        self._channels: dict[Connection, ScriptChannel] = {}
        self._phase = 0
        arm = controller.state.arm
        dh = calibrated_dh(arm.robot, arm.calibration)
        self._setup = setup_records(arm.robot, dh, zlib.crc32(repr(dh).encode()))
        self._greeting = encode_message_package(version_message(version), version)
        self._second_greeting = encode_message_package(StartupMessage(), version)
        if version >= _TOLERANCES_SINCE:
            self._second_greeting += encode_safety_tolerances()

    @property
    def clients(self) -> tuple[Connection, ...]:
        """Connected clients."""
        return tuple(self._channels)

    def opened(self, connection: Connection) -> None:
        """Greet: the version message in a segment of its own, then the first, long state."""
        self._channels[connection] = ScriptChannel()
        connection.send(self._greeting)
        connection.send(self._second_greeting)
        records = (*state_records(self._controller.snapshot), *self._setup)
        connection.send(encode_state(records, self._version))

    def received(self, connection: Connection, data: bytes) -> None:
        """Take script text."""
        if self._intake is not None:
            self._intake.take(connection, self._channels[connection].feed(data))

    def closed(self, connection: Connection) -> None:
        """Forget the client; a program it sent goes on."""
        self._channels.pop(connection, None)

    def publish(self, snapshot: Snapshot) -> None:
        """Send a state if one is due in this cycle."""
        self._phase += STATE_RATE
        if self._phase < _CYCLE_RATE:
            return
        self._phase -= _CYCLE_RATE
        if self._channels:
            package = self._states.encode(snapshot)
            for connection in tuple(self._channels):
                connection.send(package)

    def say(self, event: Event) -> None:
        """Send a message for an event."""
        if not (self._all_messages and self._channels):
            return
        message = message_for(event, self._controller.snapshot.tick * PERIOD_US)
        if message is not None:
            package = encode_message_package(message, self._version)
            for connection in tuple(self._channels):
                connection.send(package)
