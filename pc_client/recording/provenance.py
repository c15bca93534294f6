"""What a reader must know to trust a recording and to repeat the run.

Only facts of the experiment belong here. Host names, ports, dates and paths do not: two runs of the same
experiment must give the same bytes. Everything that shows data takes the words for simulated, real and not
known from here. Only data of an arm that is known to be real bear no mark.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from math import inf
from typing import Annotated, TypeAlias, get_type_hints

from pc_client.errors import RecordingError
from ur_hil.records import Finite, Flag, Items, checked, record, text, whole

Source: TypeAlias = Mapping[str, str | bool | None]
"""Columns of a table that say whose data it holds: `robot`, `software`, `serial`, `simulated`."""


def source_of(robot: str, software: str, serial: str, simulated: bool | None) -> Source:
    """The columns of a table of data of a robot."""
    return {"robot": robot, "software": software, "serial": serial, "simulated": simulated}


@dataclass(frozen=True, slots=True)
class Origin:
    """The words for simulated, real or not known.

    `name` is a phrase, `mark` stands on every figure (empty for a real arm), `prefix` before a robot in
    titles; `says` is a sentence for the page.
    """

    name: str
    mark: str
    prefix: str
    says: str


_UNKNOWN = "NOT KNOWN whether real or simulated"
_ORIGINS = {
    True: Origin("SIMULATED", "SIMULATED", "SIMULATED ", "SIMULATED: an emulated arm, no real robot moved"),
    False: Origin("real arm", "", "", "measured on a real arm"),
    None: Origin(
        _UNKNOWN,
        _UNKNOWN,
        f"{_UNKNOWN}: ",
        f"{_UNKNOWN}: the robot reported neither a serial number nor that it is simulated",
    ),
}


def origin_of(simulated: bool | None) -> Origin:
    """Return the words for `Provenance.simulated`: True, False, or None where it is not known."""
    return _ORIGINS[simulated]


_MOST_LETTERS = 200
"""Longest name in a provenance: movement, controller, robot."""

_Word = Annotated[str, text(_MOST_LETTERS)]


@record
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

    movement: _Word
    kind: _Word
    repetition: Annotated[int, whole(1, 1 << 31)]
    controller: _Word
    robot_model: _Word
    firmware: _Word
    serial: _Word
    simulated: Flag | None
    seed: Annotated[int, whole(-(1 << 63), (1 << 63) - 1)] | None
    pace: _Word
    client_version: _Word
    cycle_time_s: Finite = 0.008
    identified_delay_s: Finite | None = None
    controller_config: Mapping[str, Finite | Flag | str | None] = field(default_factory=dict)
    loop: Mapping[str, float | str] = field(default_factory=dict)
    movement_text: str = ""
    target_points: Annotated[tuple[tuple[Finite, Finite, Finite], ...], Items(0)] = ()
    cell_text: str = ""

    @property
    def robot(self) -> str:
        """Model and firmware in one phrase, e.g. "UR3 3.15.8"."""
        return f"{self.robot_model} {self.firmware}"

    @property
    def source(self) -> Source:
        """Columns of a table of the data: robot, software, serial, simulated."""
        return source_of(self.robot_model, self.firmware, self.serial, self.simulated)

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
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        return {
            name: value if isinstance(value, str) else json.dumps(value) for name, value in values.items()
        }

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, str]) -> Provenance:
        """Read back what `to_metadata` wrote; unknown keys of later versions are passed over.

        Raises:
            RecordingError: a key without default is missing, or a value cannot be read.
        """
        values: dict[str, object] = {}
        for name, kind in get_type_hints(cls).items():
            if (value := metadata.get(name)) is not None:
                try:
                    values[name] = value if kind is str else json.loads(value)
                except (ValueError, RecursionError) as error:
                    raise RecordingError(f"provenance {name}: {value[:60]!r} is not JSON") from error
        provenance = checked(cls, values, "provenance", RecordingError)
        for name, fact in provenance.loop.items():
            if not _is_fact(name, fact):
                raise RecordingError(
                    f"provenance: loop.{name}: {str(fact)[:60]!r} is nothing that is identified"
                )
        return provenance


def _is_fact(name: str, value: float | str) -> bool:
    if isinstance(value, str) or name == "learning_limited_by":
        return isinstance(value, str) and name == "learning_limited_by"
    if name in ("dead_time_s", "lag_s", "joint_spread_s"):
        return 0.0 <= value <= 1.0
    return value > -inf  # margins may be endless
