"""The safety settings in an installation: text with `[Section]` lines and `key = value` lines."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator

from ur_emulator.controller.safety.configured_limits import SafetySettings
from ur_emulator.controller.safety.inputs import N_INPUT_PAIRS, SafetyInput
from ur_emulator.errors import ProgramFileError
from ur_emulator.models.robot_model import Vector6, six
from ur_emulator.models.safety_limits import ArmLimits

_NORMAL, _REDUCED = "SafetyLimits Normal Values", "SafetyLimits Reduced Values"
_NORMAL_JOINTS, _REDUCED_JOINTS = "SafetyLimits Normal Joints", "SafetyLimits Reduced Joints"
_SETUP, _PLANE, _TOOL = "SafetySetup", "SafetyLimits BoundaryPlane", "SafetyLimits ToolOrientation"
# Modes of a plane that limits nothing; the words are chosen.
_OFF = frozenset({"", "0", "disabled", "off", "none"})
# Key -> the limit that the safety system watches.
_ARM_LIMITS = {
    "maxTcpSpeed": "tool_speed",
    "maxElbowSpeed": "tool_speed",
    "maxForce": "force",
    "maxElbowForce": "force",
    "maxPower": "power",
    "maxMomentum": "momentum",
}
_INPUTS = "SafetyIOConfiguration Inputs"
# Keys of the functions that need an operational mode, without the A or B of their two lines.
_FUNCTIONS = {
    "operationalModeInput": SafetyInput.OPERATIONAL_MODE,
    "threePositionEnablingInput": SafetyInput.ENABLING_DEVICE,
    "automaticModeSafeguardStopInput": SafetyInput.AUTOMATIC_SAFEGUARD,
    "automaticModeSafeguardStopResetInput": SafetyInput.AUTOMATIC_RESET,
}
# Indices of the two lines of a pair; others, such as 255, set up nothing.
_PAIRS: dict[tuple[str | None, ...], int] = {
    (str(2 * pair), str(2 * pair + 1)): pair for pair in range(N_INPUT_PAIRS)
}
_SECTION = re.compile(r"\[(.*)\]")


def safety_settings(file_name: str, texts: Iterable[str]) -> SafetySettings:
    """Return the limits in a text; those that it does not give are None.

    Args:
        file_name: for messages.
        texts: the text, in parts.

    Raises:
        ProgramFileError: a limit is not a number or a list of six, or a speed or a force is not above 0.
    """
    text = _SafetyText(file_name, _values("".join(texts)))
    return SafetySettings(
        text.ends("min", -math.inf),
        text.ends("max", math.inf),
        text.speeds(_NORMAL_JOINTS),
        text.speeds(_REDUCED_JOINTS),
        text.arm_limits(_NORMAL),
        text.arm_limits(_REDUCED),
        tuple(text.unwatched()),
        dict(text.inputs()),
    )


class _SafetyText:
    """Looks up the parts of one text; values by section and key."""

    def __init__(self, file_name: str, values: dict[tuple[str, str], str]) -> None:
        self._file_name = file_name
        self._values = values

    def speeds(self, section: str) -> Vector6 | None:
        """Return the joint speeds of a section [rad/s]."""
        given = self._six(section, "maxJointSpeed")
        if given is not None and min(given) <= 0.0:
            raise self._error("maxJointSpeed", f"is {min(given):g}, it must be above 0")
        return given

    def ends(self, which: str, unlimited: float) -> Vector6 | None:
        """Return the ends of the joint ranges [rad]."""
        angle = self._six(_NORMAL_JOINTS, f"{which}JointPosition")
        turns = self._six(_NORMAL_JOINTS, f"{which}JointRevolutions")
        if angle is None or turns is None:
            return None
        flags = self._values.get((_SETUP, "withPositionLimits"), "").strip("[]").split(",")
        is_limited = [flag.strip() != "false" for flag in flags] if len(flags) == 6 else [True] * 6
        return six(
            [
                turn * math.tau + part if limited else unlimited
                for turn, part, limited in zip(turns, angle, is_limited, strict=True)
            ]
        )

    def arm_limits(self, section: str) -> ArmLimits | None:
        """Return the other limits of a section: TCP and elbow have the stricter one of both."""
        found: dict[str, float] = {}
        for key, name in _ARM_LIMITS.items():
            if (text := self._values.get((section, key))) is not None:
                found[name] = min(found.get(name, math.inf), self._positive(key, text))
        return ArmLimits(**found) if found else None

    def inputs(self) -> Iterator[tuple[int, SafetyInput]]:
        """Yield the pairs of configurable inputs that have a function, and the function."""
        for key, function in _FUNCTIONS.items():
            pair = _PAIRS.get(tuple(self._values.get((_INPUTS, key + channel)) for channel in "AB"))
            if pair is not None:
                yield pair, function

    def unwatched(self) -> Iterator[str]:
        """Yield what is set up and not watched."""
        sections = {section for section, _ in self._values}
        n_planes = sum(
            self._values.get((section, "mode"), "").strip('"').lower() not in _OFF
            for section in sections
            if section.startswith(_PLANE)
        )
        if n_planes:
            yield "1 safety plane is" if n_planes == 1 else f"{n_planes} safety planes are"
        deviation = self._values.get((_TOOL, "maximumTcpOrientationDeviation"))
        if deviation is not None and self._positive("maximumTcpOrientationDeviation", deviation) < math.pi:
            yield "the limit of the tool's direction is"

    def _six(self, section: str, key: str) -> Vector6 | None:
        text = self._values.get((section, key))
        if text is None:
            return None
        try:
            given = [float(part) for part in text.strip("[]").split(",")]
        except ValueError:
            given = []
        if len(given) != 6 or not all(map(math.isfinite, given)):
            raise self._error(key, "has not six numbers")
        return six(given)

    def _positive(self, key: str, text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not 0.0 < value < math.inf:
            raise self._error(key, f"is {text[:20]!r}, it must be a number above 0")
        return value

    def _error(self, key: str, what: str) -> ProgramFileError:
        return ProgramFileError(f"{self._file_name}: {key} of the safety settings {what}")


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
