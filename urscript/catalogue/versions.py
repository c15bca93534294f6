"""Software versions and robot generations: when a builtin exists.

A row of the catalogue says for each generation from which release on a name is known, and, where it was
dropped or its signature changed, until which. This module only compares; it knows no names.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple


class Generation(Enum):
    """The controller families whose URScript differs."""

    CB3 = "CB3"
    E_SERIES = "e-Series"
    POLYSCOPE_X = "PolyScope X"


STEP_TIME: Mapping[Generation, float] = {
    Generation.CB3: 0.008,
    Generation.E_SERIES: 0.002,
    Generation.POLYSCOPE_X: 0.002,
}
"""Length of a control cycle [s]. Source: script manuals, get_steptime."""


class Version(NamedTuple):
    """A release of the controller software.

    Without bug-fix numbers: one release is known whose bug fix changed the builtins, 5.25.1 (direct_torque).
    """

    major: int
    minor: int

    @property
    def generation(self) -> Generation:
        """The family this release runs on.

        Raises:
            ValueError: for a major number that no supported controller carries.
        """
        if self.major == 3:
            if self > LAST_CB3:
                raise ValueError(f"no software {self} is known: that of CB3 ends with {LAST_CB3}")
            return Generation.CB3
        if self.major == 5:
            return Generation.E_SERIES
        if self.major >= 10:
            return Generation.POLYSCOPE_X
        raise ValueError(f"no URScript catalogue for software {self}: use 3.x (CB3), 5.x (e-Series) or 10.x")

    @classmethod
    def of(cls, version: str | Sequence[int]) -> Version:
        """Read `"3.15"`, `"3.15.8"`, `(3, 15)` or any longer version tuple.

        Raises:
            ValueError: if there are no two leading numbers.
        """
        parts = version.split(".") if isinstance(version, str) else version
        try:
            return cls(int(parts[0]), int(parts[1]))
        except (IndexError, ValueError):
            raise ValueError(f"not a software version: {version!r}; write it as 3.15 or 5.11") from None

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}"


LAST_CB3 = Version(3, 15)
"""The last minor release of the CB3 series. Source: the maker's download pages, manuals up to 3.15.8."""


@dataclass(frozen=True, slots=True)
class PerGeneration:
    """One release for each generation; None where it does not apply."""

    cb3: Version | None = None
    e_series: Version | None = None
    polyscope_x: Version | None = None

    def get(self, generation: Generation) -> Version | None:
        """The release of that generation, or None."""
        if generation is Generation.CB3:
            return self.cb3
        return self.e_series if generation is Generation.E_SERIES else self.polyscope_x

    def __str__(self) -> str:
        known = ((g, self.get(g)) for g in Generation)
        return ", ".join(f"{g.value} {version}" for g, version in known if version is not None) or "-"


def releases(
    cb3: str | None = None, e_series: str | None = None, polyscope_x: str | None = None
) -> PerGeneration:
    """Short form for tables: `releases("3.0", "5.0", "10.0")`."""
    numbers = [None if text is None else Version.of(text) for text in (cb3, e_series, polyscope_x)]
    return PerGeneration(*numbers)


NEVER = PerGeneration()
# "3.0", "5.0" and "10.0" mean "since the first release": the manuals rarely give a later one.
EVERYWHERE = releases("3.0", "5.0", "10.0")
CB3_ONLY = releases("3.0")
NOT_CB3 = releases(None, "5.0", "10.0")
# Names first seen in an e-Series manual of the 5.2x editions; the exact first release is not known.
LATE_E_SERIES = releases(None, "5.21", "10.0")
