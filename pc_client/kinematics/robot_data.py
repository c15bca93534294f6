"""Where example-robot-data keeps its robots on this machine.

Version 6 of the package ships URDF files and meshes but no Python module, so this
module looks in the places where pip, conda and ROS put share folders. It reads no robot file itself.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

from pc_client.errors import PlanningError

SHARE_VARIABLE = "EXAMPLE_ROBOT_DATA_SHARE"
"""Environment variable that names the share folder, i.e. the one that contains `example-robot-data/`."""

_DISTRIBUTION = "example-robot-data"
_PACKAGE_FOLDER = "example-robot-data"
_CMEEL_SHARE = Path("cmeel.prefix") / "share"


def find_share_folder() -> Path:
    """Return the folder that contains `example-robot-data/`, the root of its `package://` addresses.

    Raises:
        PlanningError: the package is nowhere to be found; the message says what to install.
    """
    for folder in _candidates():
        if (folder / _PACKAGE_FOLDER / "robots").is_dir():
            return folder
    raise PlanningError(
        "the nominal robot model is missing: example-robot-data was not found; "
        f"run `pip install 'ur-hil[client]'` or set {SHARE_VARIABLE} to its share folder"
    )


def find_robot_file(relative: str) -> Path:
    """Return the path of a file below `example-robot-data/robots/`, e.g. ur_description/urdf/ur3_robot.urdf.

    Raises:
        PlanningError: the package is missing, or this version of it has no such file.
    """
    path = find_share_folder() / _PACKAGE_FOLDER / "robots" / relative
    if not path.is_file():
        raise PlanningError(
            f"example-robot-data has no {relative} ({path}); install example-robot-data >= 6.0"
        )
    return path


def _candidates() -> Iterator[Path]:
    """Yield possible share folders, the explicit choice first, then the installed distribution."""
    chosen = os.environ.get(SHARE_VARIABLE)
    if chosen:
        yield Path(chosen)
    try:
        distribution = metadata.distribution(_DISTRIBUTION)
    except metadata.PackageNotFoundError:
        pass
    else:
        yield Path(str(distribution.locate_file(_CMEEL_SHARE)))
    for entry in sys.path:
        yield Path(entry) / _CMEEL_SHARE
    # conda and system installations have one share folder for everything.
    yield Path(sys.prefix) / "share"
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if prefix:
            yield Path(prefix) / "share"
