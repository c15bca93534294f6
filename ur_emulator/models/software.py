"""The software of a box: version, build number and date, the same on every port that tells them."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from protocol.ur_types import SoftwareVersion


@dataclass(frozen=True, slots=True)
class Software:
    """What a box says of its software.

    Attributes:
        version: four numbers; the last is the build.
        built: when; in the time of the box.
    """

    version: SoftwareVersion
    built: datetime

    @property
    def day(self) -> str:
        """The date as the dashboard writes it, "Nov 30 2021"."""
        return self.built.strftime("%b %d %Y")


# First version, build and date of each row, the oldest first.
Builds = tuple[tuple[SoftwareVersion, int, datetime], ...]

# Software between two rows has the build and the date of the earlier row.
CB3_BUILDS: Builds = (
    (SoftwareVersion(3, 0), 15547, datetime(2014, 6, 1)),  # build: public issues name 3.0.15547; date chosen
    (SoftwareVersion(3, 2), 19171, datetime(2016, 1, 1)),  # chosen
    (SoftwareVersion(3, 3), 60, datetime(2016, 7, 8, 16, 7, 20)),  # capture of 3.3.1
    (SoftwareVersion(3, 10), 76000, datetime(2019, 5, 3, 6, 39)),  # date: capture of 3.10.0; build chosen
    (SoftwareVersion(3, 15), 106339, datetime(2021, 11, 30)),  # 3.15.8; date of its manual, time chosen
)


def software_of(version: SoftwareVersion, builds: Builds = CB3_BUILDS) -> Software:
    """Return what a box with a software version tells.

    Args:
        version: as the user gave it; a build number above 0 stays.
        builds: first version, build and date of each row, oldest first.
    """
    _, build, built = [row for row in builds if row[0] <= version][-1]
    return Software(version._replace(build=version.build or build), built)
