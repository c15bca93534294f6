"""The safety settings in an installation: text with `[Section]` lines and `key = value` lines."""

import math
import re
from collections.abc import Iterable, Iterator

from ur_emulator.errors import ProgramFileError
from ur_emulator.machine.controller.safety.boundaries import (
    Boundaries,
    BoundaryMode,
    SafetyPlane,
    ToolDirection,
)
from ur_emulator.machine.controller.safety.inputs import N_INPUT_PAIRS, SafetyInput
from ur_emulator.machine.controller.safety.safety_state import SafetySettings
from ur_emulator.machine.models.robot_model import Vector3, Vector6, six
from ur_emulator.machine.models.safety_limits import ArmLimits

_NORMAL, _REDUCED = "SafetyLimits Normal Values", "SafetyLimits Reduced Values"
_NORMAL_JOINTS, _REDUCED_JOINTS = "SafetyLimits Normal Joints", "SafetyLimits Reduced Joints"
_SETUP, _PLANE, _TOOL = "SafetySetup", "SafetyLimits BoundaryPlane", "SafetyLimits ToolOrientation"
# Modes of a boundary. DISABLED is in a public reader of installations; the numbers are those of a maker of
# other robots who has the same keys; the other words are chosen.
_BOUNDARY_MODES = {
    word: mode
    for mode, words in (
        (BoundaryMode.DISABLED, "disabled 0 off none"),
        (BoundaryMode.NORMAL, "normal 1"),
        (BoundaryMode.REDUCED, "reduced 2"),
        (BoundaryMode.BOTH, "both 3 normal_and_reduced normal_reduced"),
        (BoundaryMode.TRIGGER, "trigger 4 trigger_reduced trigger_reduced_mode"),
    )
    for word in words.split()
}
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
_COUNTS = {1: "one number", 3: "three numbers", 6: "six numbers"}
_LEAST_LENGTH = 1e-6
_SECTION = re.compile(r"\[(.*)\]")


def safety_settings(file_name: str, texts: Iterable[str]) -> SafetySettings:
    """Return the limits in a text; those that it does not give are None.

    ProgramFileError if a limit is not a number or a list of six, or a speed or a force is not above 0.
    """
    text = _SafetyText(file_name, _values("".join(texts)))
    return SafetySettings(
        text.ends("min", -math.inf),
        text.ends("max", math.inf),
        text.speeds(_NORMAL_JOINTS),
        text.speeds(_REDUCED_JOINTS),
        text.arm_limits(_NORMAL),
        text.arm_limits(_REDUCED),
        Boundaries(tuple(text.planes()), text.tool_direction()),
        tuple(text.unwatched()),
        dict(text.inputs()),
    )


class _SafetyText:
    """Looks up the parts of one text; values by section and key."""

    def __init__(self, file_name: str, values: dict[tuple[str, str], str]) -> None:
        self._file_name = file_name
        self._values = values
        self._planes = sorted({section for section, _ in values if section.startswith(_PLANE)})

    def speeds(self, section: str) -> Vector6 | None:
        """Return the joint speeds of a section [rad/s]."""
        given = self._numbers(section, "maxJointSpeed", 6)
        if given is None:
            return None
        if min(given) <= 0.0:
            raise self._error("maxJointSpeed", f"is {min(given):g}, it must be above 0")
        return six(given)

    def ends(self, which: str, unlimited: float) -> Vector6 | None:
        """Return the ends of the joint ranges [rad]."""
        angle = self._numbers(_NORMAL_JOINTS, f"{which}JointPosition", 6)
        turns = self._numbers(_NORMAL_JOINTS, f"{which}JointRevolutions", 6)
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
        for section in (*self._planes, _TOOL):
            if self._mode(section) is None:
                yield f"{section} with the unknown mode {self._values[section, 'mode'][:40]} is"

    def planes(self) -> Iterator[SafetyPlane]:
        for section in self._planes:
            mode = self._mode(section)
            if mode is None or mode is BoundaryMode.DISABLED:
                continue
            normal = self._direction(section, "planeNormal")
            distance = self._numbers(section, "distanceToOrigin", 1)
            if distance is None:
                raise self._error("distanceToOrigin", f"is missing for {section}")
            # Chosen: the points x of the plane have normal * x = distanceToOrigin.
            x, y, z = (distance[0] * part for part in normal)
            name = self._values.get((section, "name"), "").strip("\"'") or section.rpartition(" ")[2]
            elbow = self._values.get((section, "elbowRestricted")) == "true"
            yield SafetyPlane(name, (x, y, z), normal, mode, elbow)

    def tool_direction(self) -> ToolDirection | None:
        """Return the limit of the tool's direction; None where there is none."""
        mode = self._mode(_TOOL)
        deviation = self._values.get((_TOOL, "maximumTcpOrientationDeviation"))
        if mode in (None, BoundaryMode.DISABLED, BoundaryMode.TRIGGER) or deviation is None:
            return None
        angle = self._positive("maximumTcpOrientationDeviation", deviation)
        if angle >= math.pi:
            return None
        return ToolDirection(self._direction(_TOOL, "tcpOrientationVector"), angle, mode)

    def _mode(self, section: str) -> BoundaryMode | None:
        """Return the mode of a boundary; None for one that is not known."""
        word = self._values.get((section, "mode"), "disabled").strip("\"'").lower().replace(" ", "_")
        return _BOUNDARY_MODES.get(word)

    def _direction(self, section: str, key: str) -> Vector3:
        """Return a vector with the length 1."""
        given = self._numbers(section, key, 3)
        length = math.hypot(*given or ())
        if given is None or length < _LEAST_LENGTH:
            raise self._error(key, f"of {section} is missing or has no length")
        x, y, z = (part / length for part in given)
        return x, y, z

    def _numbers(self, section: str, key: str, count: int) -> list[float] | None:
        text = self._values.get((section, key))
        if text is None:
            return None
        try:
            given = [float(part) for part in text.strip("[]").split(",")]
        except ValueError:
            given = []
        if len(given) != count or not all(map(math.isfinite, given)):
            raise self._error(key, f"has not {_COUNTS[count]}")
        return given

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
