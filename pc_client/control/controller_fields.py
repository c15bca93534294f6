"""What the fields of a controller may hold, in one table: for the command line, files and sweeps alike."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from pc_client.errors import ControllerError

Value = float | bool


@dataclass(frozen=True, slots=True)
class Number:
    """A field that holds a number.

    Attributes:
        least: smallest value.
        most: largest value.
        unit: of both; empty for a share.
    """

    least: float
    most: float
    unit: str

    @property
    def kind(self) -> type:
        """The type of its values."""
        return float

    @property
    def text(self) -> str:
        """What is allowed."""
        return f"a number from {self.least:g} to {self.most:g}{self.unit and f' {self.unit}'}"

    def accepts(self, value: object) -> bool:
        """Whether the field may hold this; infinity and NaN are in no range."""
        return (
            isinstance(value, int | float)
            and not isinstance(value, bool)
            and self.least <= value <= self.most
        )


@dataclass(frozen=True, slots=True)
class Switch:
    """A field that is on or off."""

    @property
    def kind(self) -> type:
        """The type of its values."""
        return bool

    @property
    def text(self) -> str:
        """What is allowed."""
        return "true or false"

    def accepts(self, value: object) -> bool:
        """Whether the field may hold this."""
        return isinstance(value, bool)


# The ranges hold slips of the pen off (a factor of a thousand, a wrong sign); whether gains suit a loop is
# judged on the identified one. Gains: 200 1/s is unstable with a dead time of one cycle.
FIELDS: Mapping[str, Number | Switch] = MappingProxyType(
    {
        "gain_p": Number(0.0, 200.0, "1/s"),
        "gain_i": Number(0.0, 2000.0, "1/s2"),
        "uses_preview": Switch(),
        "speedj_acceleration": Number(0.1, 100.0, "rad/s2"),
        "slew_limit": Number(0.1, 200.0, "rad/s2"),
        "integral_limit": Number(0.0, 3.0, "rad/s"),
        "speed_share": Number(0.1, 1.0, ""),
        "path_tolerance": Number(0.0005, 0.05, "m"),
        "angle_tolerance": Number(0.005, 0.5, "rad"),
        "compensates_lag": Switch(),
        "compensates_gear": Switch(),
        "uses_ilc": Switch(),
        "learning_gain": Number(0.0, 1.0, ""),
        "learning_speed": Number(0.0, 1.0, "rad/s"),
        "learning_acceleration": Number(0.0, 200.0, "rad/s2"),
    }
)
"""All fields of `Controller` but its name."""


def checked(name: str, value: object, where: str) -> Value:
    """Check a value of one field.

    Args:
        name: of `FIELDS`.
        value: what was given.
        where: file and key, or option, for the message.

    Raises:
        ControllerError: the field cannot hold it.
    """
    field = FIELDS[name]
    if not field.accepts(value):
        raise ControllerError(f"{where}: {value!r}; give {field.text}")
    kept: Value = field.kind(value)
    return kept
