"""Lines that the script ports accept although they are not URScript.

PolyScope itself drives the controller with them and clients copied them. The box implements the words;
this table lists them, so that they are not compiled.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

__all__ = ["CONTROLLER_WORDS", "ControllerWord", "match_controller_word"]


@dataclass(frozen=True, slots=True)
class ControllerWord:
    """One row.

    Attributes:
        text: the fixed words, with one space between.
        takes_number: whether one number follows.
        effect: what a controller does, for documentation.
        source: who sends it.
    """

    text: str
    takes_number: bool
    effect: str
    source: str


_W = ControllerWord
CONTROLLER_WORDS: tuple[ControllerWord, ...] = (
    _W("power on", False, "as the dashboard command", "UR client library"),
    _W("power off", False, "as the dashboard command", "UR client library"),
    _W("set robotmode run", False, "release the brakes; powers on if needed", "UR client library, SAW"),
    _W("set robotmode freedrive", False, "freedrive, until `set robotmode run`; CB2", "SAW"),
    _W("set unlock protective stop", False, "leave a protective stop", "UR client library"),
    _W("stop program", False, "stop the running program", "UR client library"),
    _W("pause program", False, "pause the running program", "UnderAutomation; wording inferred"),
    _W("resume program", False, "resume the paused program", "UnderAutomation; wording inferred"),
    _W("set speed", True, "speed slider, 0.01 to 1", "pharmbio/robotlab; UnderAutomation"),
    _W("set real", False, "drive the real arm", "python-urx"),
    _W("set sim", False, "drive a simulated arm", "python-urx"),
    _W("confirm user safety parameters", False, "confirm the safety settings", "seen in the field"),
)  # fmt: skip

_BY_TEXT = {word.text: word for word in CONTROLLER_WORDS}
_LONGEST = 64  # characters; a longer line is not a word
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


def match_controller_word(line: str) -> tuple[ControllerWord, str] | None:
    """The row of a line, and its number as text ("" without one); None for any other line.

    Words are lower case; spaces around and between them are ignored.
    """
    if len(line) > _LONGEST:
        return None
    words = line.split()
    row = _BY_TEXT.get(" ".join(words))
    if row is not None:
        return None if row.takes_number else (row, "")
    row = _BY_TEXT.get(" ".join(words[:-1]))
    if row is not None and row.takes_number and _NUMBER.fullmatch(words[-1]):
        return row, words[-1]
    return None
