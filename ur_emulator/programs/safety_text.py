"""The safety settings in an installation: text with `[Section]` lines and `key = value` lines."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from ur_emulator.errors import ProgramFileError
from ur_emulator.models.robot_model import Vector6, six
from ur_emulator.programs.installation import SafetySettings

_NORMAL, _REDUCED, _SETUP = "SafetyLimits Normal Joints", "SafetyLimits Reduced Joints", "SafetySetup"
_SECTION = re.compile(r"\[(.*)\]")


def safety_settings(file_name: str, texts: Iterable[str]) -> SafetySettings:
    """Return the limits in a text; those that it does not give are None.

    Args:
        file_name: for messages.
        texts: the text, in parts.

    Raises:
        ProgramFileError: a list of a joint limit is not one of six numbers.
    """
    values = _values("".join(texts))

    def six_of(section: str, key: str) -> Vector6 | None:
        text = values.get((section, key))
        if text is None:
            return None
        try:
            given = [float(part) for part in text.strip("[]").split(",")]
        except ValueError:
            given = []
        if len(given) != 6 or not all(map(math.isfinite, given)):
            raise ProgramFileError(f"{file_name}: {key} of the safety settings has not six numbers")
        return six(given)

    flags = values.get((_SETUP, "withPositionLimits"), "").strip("[]").split(",")
    is_limited = [flag.strip() != "false" for flag in flags] if len(flags) == 6 else [True] * 6

    def ends(which: str, unlimited: float) -> Vector6 | None:
        angle = six_of(_NORMAL, f"{which}JointPosition")
        turns = six_of(_NORMAL, f"{which}JointRevolutions")
        if angle is None or turns is None:
            return None
        return six(
            [
                turn * math.tau + part if limited else unlimited
                for turn, part, limited in zip(turns, angle, is_limited, strict=True)
            ]
        )

    return SafetySettings(
        six_of(_NORMAL, "maxJointSpeed"),
        six_of(_REDUCED, "maxJointSpeed"),
        ends("min", -math.inf),
        ends("max", math.inf),
    )


def _values(text: str) -> dict[tuple[str, str], str]:
    """Return the values by section and key."""
    values: dict[tuple[str, str], str] = {}
    section = ""
    for line in map(str.strip, text.splitlines()):
        if match := _SECTION.fullmatch(line):
            section = match[1]
            continue
        key, is_pair, value = line.partition("=")
        if is_pair:
            values[section, key.strip()] = value.strip()
    return values
