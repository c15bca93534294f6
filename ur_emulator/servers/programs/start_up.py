"""What the box does when it is switched on: the default installation of its folder says it."""

from __future__ import annotations

import re
from contextlib import suppress

from ur_emulator.controller.io.lines import CONFIGURABLE, STANDARD, TOOL
from ur_emulator.errors import RefusedError
from ur_emulator.program_files.installation_reader import DEFAULT_NAME
from ur_emulator.servers.box_access import BoxAccess
from ur_emulator.servers.programs.player import THIS_MACHINE, ProgramPlayer
from ur_emulator.servers.steps import Steps

_LINE = re.compile(r"([a-z_]+)\[(\d)\]")
_GROUPS = {"digital_in": STANDARD, "config_in": CONFIGURABLE, "tool_in": TOOL}


def start_up(access: BoxAccess, player: ProgramPlayer) -> Steps[None]:
    """Load the default installation and the program that it names, and start that when its line changes.

    What cannot be done is in the log. That the line starts the program once: chosen.

    Args:
        access: to the box.
        player: loads and plays.
    """
    if not player.folder.exists or not player.folder.has(DEFAULT_NAME):
        return
    with suppress(RefusedError):
        start = yield from player.load_default()
        program = player.loaded
        if program is None or not start.start_line:
            return
        bit = _input_bit(player.installation.lines.get(start.start_line, start.start_line))
        if bit is None:
            access.note(f"{start.program} is not started by {start.start_line!r}: it is no digital input")
            return
        lines = access.controller.state.io
        before = lines.read_digital_in(bit)
        while lines.read_digital_in(bit) is before or before is start.start_level:
            before = lines.read_digital_in(bit)
            yield
        if player.loaded is not None and player.loaded.wire_path == program.wire_path:
            yield from player.play(THIS_MACHINE)


def _input_bit(line: str) -> int | None:
    """Return the bit of a digital input in the word of all; None for a line that is none."""
    match = _LINE.fullmatch(line)
    group = _GROUPS.get(match[1]) if match else None
    if match is None or group is None or int(match[2]) >= group.count:
        return None
    return group.bits[int(match[2])]
