"""What a reader must know to trust a recording and to repeat the run.

Only facts of the experiment belong here. Host names, ports, dates and paths do not: two runs of the same
experiment must give the same bytes.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from pc_client.errors import RecordingError
from pc_client.recording.origin import Origin, origin_of


@dataclass(frozen=True, slots=True)
class Provenance:
    """Where a recording comes from.

    Attributes:
        movement: name of the movement, e.g. "lognorm_4_1".
        kind: which model made it: "lognormal", "uniform", "minimum_jerk", "power_law" or "samples".
        repetition: 1, 2, 3 ...
        controller: name of the controller configuration, e.g. "preview".
        controller_config: its numbers (gains, limits), by name.
        robot_model: e.g. "UR3".
        firmware: controller software as it reports itself, e.g. "3.15.8".
        serial: serial number of the arm, or "unknown".
        simulated: True for an emulated arm, False for one that is known to be real, None where the robot did
            not report it.
        seed: seed of the emulated arm; None for a real arm, and where the robot did not report it.
        pace: "realtime" or "lockstep".
        cycle_time_s: control cycle of the robot in s.
        identified_delay_s: loop delay that the client measured, in s; None when it did not.
        loop: what the client identified of the loop, and its margins, by name; empty in old recordings.
        client_version: version of this package.
        movement_text: the movement file, as it was read.
        target_points: the movement's target points in the base frame, (x, y, z) in m.
        cell_text: the file of the surroundings and the tool, as it was read; empty where none was given.
    """

    movement: str
    kind: str
    repetition: int
    controller: str
    robot_model: str
    firmware: str
    serial: str
    simulated: bool | None
    seed: int | None
    pace: str
    client_version: str
    cycle_time_s: float = 0.008
    identified_delay_s: float | None = None
    controller_config: Mapping[str, float | int | bool | str | None] = field(default_factory=dict)
    loop: Mapping[str, float | str] = field(default_factory=dict)
    movement_text: str = ""
    target_points: tuple[tuple[float, float, float], ...] = ()
    cell_text: str = ""

    @property
    def robot(self) -> str:
        """Model and firmware in one phrase, e.g. "UR3 3.15.8"."""
        return f"{self.robot_model} {self.firmware}"

    @property
    def origin(self) -> Origin:
        """The words for simulated, real, or not known."""
        return origin_of(self.simulated)

    @property
    def arm(self) -> str:
        """The robot behind its mark, for titles, e.g. "SIMULATED UR3 3.15.8, seed 7"."""
        return self.origin.prefix + self.robot + ("" if self.seed is None else f", seed {self.seed}")

    def to_metadata(self) -> dict[str, str]:
        """Return the flat string map that goes into the file: texts as they are, all else as JSON."""
        metadata = {}
        for item in dataclasses.fields(self):
            value = getattr(self, item.name)
            if isinstance(value, Mapping):
                value = dict(value)
            metadata[item.name] = value if isinstance(value, str) else json.dumps(value)
        return metadata

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, str]) -> Provenance:
        """Read back what `to_metadata` wrote; unknown keys of later versions are passed over.

        Raises:
            RecordingError: a key without default is missing, or a value cannot be read.
        """
        values: dict[str, object] = {}
        for item in dataclasses.fields(cls):
            text = metadata.get(item.name)
            if text is None:
                continue
            try:
                values[item.name] = value = text if item.type == "str" else json.loads(text)
            except (ValueError, RecursionError) as error:
                raise RecordingError(
                    f"provenance {item.name!r} cannot be read: {text[:60]!r} is not JSON"
                ) from error
            if not _HOLDS[str(item.type)](value) or (item.name in _WORDS and not _is_word(text)):
                raise RecordingError(f"provenance {item.name!r} is {text[:60]!r}, must be {item.type}")
        if "target_points" in values:
            points: list[list[float]] = values["target_points"]  # type: ignore[assignment]
            values["target_points"] = tuple((p[0], p[1], p[2]) for p in points)
        try:
            return cls(**values)  # type: ignore[arg-type]
        except TypeError as error:
            raise RecordingError(f"the recording's provenance is incomplete: {error}") from error


def _is_number(value: object) -> bool:
    return not isinstance(value, bool) and (
        (isinstance(value, int) and abs(value) < 1 << 63)
        or (isinstance(value, float) and math.isfinite(value))
    )


def _is_plain(value: object) -> bool:
    return value is None or isinstance(value, bool | str) or _is_number(value)


def _is_fact(item: tuple[str, object]) -> bool:
    name, value = item
    if name == "learning_limited_by":
        return isinstance(value, str)
    if name in ("dead_time_s", "lag_s", "joint_spread_s"):
        return _is_number(value) and 0.0 <= value <= 1.0  # type: ignore[operator]
    return _is_number(value) or value == math.inf  # margins may be endless


def _is_point(value: object) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(map(_is_number, value))


def _is_word(text: str) -> bool:
    return len(text) <= MOST_LETTERS and text.isprintable()


MOST_LETTERS = 200
"""Longest name in a provenance: movement, controller, robot."""

_WORDS = ("movement", "kind", "controller", "robot_model", "firmware", "serial", "pace", "client_version")

_HOLDS: Mapping[str, Callable[[object], bool]] = {
    "str": lambda value: True,
    "int": lambda value: isinstance(value, int) and _is_number(value),
    "int | None": lambda value: value is None or (isinstance(value, int) and _is_number(value)),
    "bool | None": lambda value: value is None or isinstance(value, bool),
    "float": _is_number,
    "float | None": lambda value: value is None or _is_number(value),
    "Mapping[str, float | int | bool | str | None]": lambda value: (
        isinstance(value, dict) and all(map(_is_plain, value.values()))
    ),
    "Mapping[str, float | str]": lambda value: isinstance(value, dict) and all(map(_is_fact, value.items())),
    "tuple[tuple[float, float, float], ...]": lambda value: (
        isinstance(value, list) and all(map(_is_point, value))
    ),
}
"""What a value of each type in `Provenance` may be, as JSON."""
