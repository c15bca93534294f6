"""The controller's own words on the script ports, and the commands that they stand for."""

from __future__ import annotations

from protocol.script_channel import ControlLine
from ur_emulator.commands.power import PowerOff, PowerOn, ReleaseBrakes, StartFreedrive
from ur_emulator.commands.programs import PauseProgram, ResumeProgram, SetSpeedSlider, StopProgram
from ur_emulator.commands.safety import ConfirmSafety, UnlockProtectiveStop
from ur_emulator.controller.command import Command
from ur_emulator.errors import ArgumentError

# Words that change nothing here map to None.
# Source: what PolyScope and public clients send on the script ports (protocol.script_channel).
WORDS: dict[str, Command | None] = {
    "power on": PowerOn(),
    "power off": PowerOff(),
    "set robotmode run": ReleaseBrakes(),
    "set robotmode freedrive": StartFreedrive(),
    "set unlock protective stop": UnlockProtectiveStop(),
    "stop program": StopProgram(),
    "pause program": PauseProgram(),
    "resume program": ResumeProgram(),
    "set real": None,
    "set sim": None,
    "confirm user safety parameters": ConfirmSafety(),
}
SPEED_WORD = "set speed"


def word_command(item: ControlLine) -> Command | str | None:
    """Return the command that a word stands for, None if it changes nothing, or why there is none."""
    if item.word != SPEED_WORD:
        return WORDS.get(item.word, f"'{item.text}' is declared only: this box does not model it yet")
    try:
        return SetSpeedSlider(float(item.argument))
    except (ValueError, ArgumentError):
        return f"'{item.text}' was ignored: the speed slider takes 0 to 1"
