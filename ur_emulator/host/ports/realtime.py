"""Port 30003 and its read-only twin 30013: one frame per cycle to every client; script text comes in."""

from protocol.realtime.layout import RealtimeLayout
from ur_emulator.host.ports.script_intake import ProgramIntake, ScriptPort
from ur_emulator.machine.controller.snapshot import Snapshot


class RealtimePort(ScriptPort):
    """Streams realtime frames; there is no greeting."""

    def __init__(self, layout: RealtimeLayout, intake: ProgramIntake | None) -> None:
        super().__init__(intake)
        self._encode = layout.encoder()

    def publish(self, snapshot: Snapshot) -> None:
        """Send the frame of this cycle."""
        if self._clients:
            self._send(self._encode(snapshot))
