"""Port 30003 and its read-only twin 30013: one frame per cycle to every client; script text comes in."""

from __future__ import annotations

from protocol.realtime.layout import RealtimeLayout
from protocol.script_channel import ScriptChannel
from ur_emulator.controller.snapshot import Snapshot
from ur_emulator.servers.programs.intake import ProgramIntake
from ur_emulator.servers.tcp.connection import Connection


class RealtimePort:
    """Streams realtime frames."""

    def __init__(self, layout: RealtimeLayout, intake: ProgramIntake | None) -> None:
        """Prepare the encoder.

        Args:
            layout: of the frames.
            intake: takes script text; None makes the port read-only.
        """
        self._encode = layout.encoder()
        self._intake = intake
        self._channels: dict[Connection, ScriptChannel] = {}

    def opened(self, connection: Connection) -> None:
        """The stream to this client starts with the next frame; there is no greeting."""
        self._channels[connection] = ScriptChannel()

    def received(self, connection: Connection, data: bytes) -> None:
        """Take script text."""
        if self._intake is not None:
            self._intake.take(connection, self._channels[connection].feed(data))

    def closed(self, connection: Connection) -> None:
        """Forget the client; a program it sent goes on."""
        self._channels.pop(connection, None)

    def publish(self, snapshot: Snapshot) -> None:
        """Send the frame of this cycle."""
        if self._channels:
            frame = self._encode(snapshot)
            for connection in tuple(self._channels):
                connection.send(frame)
