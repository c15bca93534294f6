"""The client's nominal arm: published geometry through Pinocchio, and limits of its own.

The geometry of the CB3 arms is read from example-robot-data, whose UR files equal UR's published DH table;
its *limits* are wrong (the UR3 file carries UR10 torques and 124-183 deg/s) and its masses are estimates, so
neither is used. The other arms, which it lacks, come from the DH table itself (`dh_arm`). Nothing here may be
fed with the kinematics of an emulated box: a client of a real arm does not know them.

Frames: everything is expressed in UR's `base` frame, the frame of the DH table and of the TCP poses that a
control box reports. (The URDF's own root, `base_link`, is turned by pi about z against it.) The TCP is the
flange, `tool0`.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from importlib import metadata
from math import pi, radians
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pinocchio as pin

from pc_client.errors import PlanningError
from pc_client.kinematics.cell import NO_CELL, Cell
from pc_client.kinematics.dh_arm import (
    UR3E,
    UR5E,
    UR8LONG,
    UR10E,
    UR15,
    UR16E,
    UR18,
    UR20,
    UR30,
    DhArm,
    urdf_text,
)

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


Six = tuple[float, float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class JointLimits:
    """What the joints of one arm may do, base to wrist 3.

    Attributes:
        q_min: lowest joint angles [rad].
        q_max: highest joint angles [rad].
        qd_max: the fastest that a joint is asked to turn [rad/s].
        qdd_max: joint acceleration limits [rad/s²].
    """

    q_min: Six
    q_max: Six
    qd_max: Six
    qdd_max: Six


@dataclass(frozen=True, slots=True)
class RobotDescription:
    """The data in which the arms of the family differ.

    Attributes:
        name: short name, e.g. `ur3`.
        geometry: file below `example-robot-data/robots/`, or the lengths of the arm.
        limits: joint limits.
        reach: distance from the base axis to the flange of the stretched arm [m].
        position_tolerance: between the flange that a real arm reports and this model's [m].
        q_branch: a posture on the IK branch that is preferred for drawing in front of the arm [rad].
        tcp_speed_max: TCP speed limit [m/s].
    """

    name: str
    geometry: str | DhArm
    limits: JointLimits
    reach: float
    position_tolerance: float
    q_branch: Six
    tcp_speed_max: float

    @property
    def title(self) -> str:
        """The name for people, as robots report it, e.g. `UR5e`."""
        kind = self.name.removeprefix("ur")
        return f"UR{kind if kind.endswith('e') else kind.upper()}"

    @property
    def urdf(self) -> str:
        """The URDF of its frames.

        Raises:
            PlanningError: example-robot-data is not installed.
        """
        if isinstance(self.geometry, str):
            return find_robot_file(self.geometry).read_text(encoding="utf-8")
        return urdf_text(self.geometry, self.name)


@dataclass(frozen=True, slots=True)
class RobotModel:
    """One arm as Pinocchio computes it, in its cell.

    `pin_data` is scratch memory that every computation overwrites: give each thread a model of its own.

    Attributes:
        description: names, limits, preferred branch.
        cell: what stands around it and what it carries.
        pin_model: Pinocchio model whose world frame is UR's `base`.
        pin_data: its scratch memory.
        tcp_frame: index of the frame `tool0`.
    """

    description: RobotDescription
    cell: Cell = field(repr=False)
    pin_model: Any = field(repr=False)
    pin_data: Any = field(repr=False)
    tcp_frame: int

    @property
    def name(self) -> str:
        """Short name, e.g. `ur3`."""
        return self.description.name

    @property
    def title(self) -> str:
        """The name for people, e.g. `UR5e`."""
        return self.description.title

    @property
    def limits(self) -> JointLimits:
        """Joint limits of the client's own table."""
        return self.description.limits


_STOPPABLE_SPEED = 180.0
"""No joint is asked for more than this [deg/s], which only a UR3's wrists could do: from it the arm is at
rest within 0.3 s of the client's last command (the figures are those of `driver.receiver_script`)."""


def _speeds(*rated: float) -> Six:
    """The rated joint speeds of an arm [deg/s] as what the client asks for [rad/s]."""
    return _six_degrees(*(min(speed, _STOPPABLE_SPEED) for speed in rated))


def _six_degrees(*angles: float) -> Six:
    """Turn six angles [deg] into [rad]."""
    a, b, c, d, e, f = (radians(angle) for angle in angles)
    return (a, b, c, d, e, f)


# Source: UR user manuals CB3 3.13, technical specifications, UR's ROS description of the others: working
# range +-360 deg of all joints (wrist 3 of UR3 and UR3e turns without end, streaming needs no more).
_ANY_TURN_MIN: Six = (-2 * pi,) * 6
_ANY_TURN_MAX: Six = (2 * pi,) * 6

# Elbow up, tool 45 deg down and forward: for the UR3 the branch whose whole box [.275, .425] x [-.2, .2] x
# [.15, .35] m is reachable at >= .35 m/s in every direction. Source: own closed-form sweep of all branches.
# The other arms have the same shape, so the same posture names the same branch.
_ELBOW_UP = _six_degrees(22.6, -101.1, -120.3, -5.9, 74.2, 106.4)

_TCP_SPEED = 1.0
"""[m/s]. Source: data sheets up to the UR16e, "typical tool speed 1 m/s"; later arms get no more."""


def _arm(
    name: str,
    geometry: str | DhArm,
    speeds: Six,
    accelerations: tuple[float, float],
    reach: float,
    position_tolerance: float,
) -> RobotDescription:
    """A row of the table: speeds as rated [deg/s], accelerations of shoulder and elbow [rad/s²]."""
    shoulder, elbow = accelerations
    qdd_max = (shoulder, shoulder, elbow, _WRISTS, _WRISTS, _WRISTS)
    limits = JointLimits(_ANY_TURN_MIN, _ANY_TURN_MAX, _speeds(*speeds), qdd_max)
    return RobotDescription(name, geometry, limits, reach, position_tolerance, _ELBOW_UP, _TCP_SPEED)


# Speeds: UR3, UR5, UR10 manuals CB3 3.13; UR's ROS description (config/*/joint_limits.yaml) says the same and
# has the other arms, but for the UR8 Long: assumed, a UR15's, with base and shoulder of a UR20.
_UR3_SPEEDS: Six = (180.0, 180.0, 180.0, 360.0, 360.0, 360.0)
_UR5_SPEEDS: Six = (180.0,) * 6
_UR10_SPEEDS: Six = (120.0, 120.0, 180.0, 180.0, 180.0, 180.0)
_UR8LONG_SPEEDS: Six = (120.0, 120.0, 240.0, 300.0, 300.0, 300.0)
_UR15_SPEEDS: Six = (180.0, 180.0, 240.0, 300.0, 300.0, 300.0)
_UR20_SPEEDS: Six = (120.0, 120.0, 150.0, 210.0, 210.0, 210.0)

# Accelerations: UR publishes none. UR's own driver streams speedj with a = 40 rad/s²
# (Universal_Robots_Client_Library, external_control.urscript); no joint gets more. For the large joints it
# is less, from torque: what UR's "max joint torques" leave after gravity of the bare arm in its worst
# posture and friction at 1 rad/s, over the inertia of the arm before its base with the rotor. Masses: UR's
# DH article; rotor inertia and friction: identified sets of real arms (.45 kg m² for joints of size 2 on a
# UR3, .61 on a UR3e, 1.93 for size 3, 5.9 for size 4; the larger ones assumed, in proportion to the torque).
# The base gets what the shoulder gets.
_WRISTS = 40.0

# Reach: the data sheets. Position tolerances: twice what three real UR3e calibrations come to, 2.7 mm, in
# proportion to the reach; a choice, docs/fidelity.md.
_ROWS = (
    # (56 - 19 gravity - 10 friction) Nm over .95 kg m²; elbow (28 - 7 - 4) over .4.
    _arm("ur3", "ur_description/urdf/ur3_robot.urdf", _UR3_SPEEDS, (28.0, 40.0), 0.5, 0.005),
    # (150 - 55 - 14) Nm over 3.7 kg m²; elbow (150 - 17 - 17) over 2.6.
    _arm("ur5", "ur_description/urdf/ur5_robot.urdf", _UR5_SPEEDS, (22.0, 40.0), 0.85, 0.009),
    # (330 - 122 - 29) Nm over 11.8 kg m²; elbow (150 - 41 - 17) over 4.3.
    _arm("ur10", "ur_description/urdf/ur10_robot.urdf", _UR10_SPEEDS, (15.0, 21.0), 1.3, 0.014),
    # (54 - 19 - 6) Nm over 1.1 kg m²; elbow (28 - 7 - 3) over .4.
    _arm("ur3e", UR3E, _UR3_SPEEDS, (26.0, 40.0), 0.5, 0.005),
    # (150 - 62 - 16) Nm over 3.6 kg m²; elbow (150 - 20 - 16) over 2.7.
    _arm("ur5e", UR5E, _UR5_SPEEDS, (20.0, 40.0), 0.85, 0.009),
    _arm("ur7e", UR5E, _UR5_SPEEDS, (20.0, 40.0), 0.85, 0.009),
    # (330 - 125 - 34) Nm over 11.8 kg m²; elbow (150 - 43 - 16) over 4.3.
    _arm("ur10e", UR10E, _UR10_SPEEDS, (14.0, 21.0), 1.3, 0.014),
    _arm("ur12e", UR10E, _UR10_SPEEDS, (14.0, 21.0), 1.3, 0.014),
    # (330 - 91 - 34) Nm over 8.4 kg m²; elbow (150 - 29 - 16) over 2.8.
    _arm("ur16e", UR16E, _UR10_SPEEDS, (24.0, 37.0), 0.9, 0.01),
    # (433 - 233 - 46) Nm over 24 kg m²; elbow (204 - 64 - 22) over 7.1.
    _arm("ur8long", UR8LONG, _UR8LONG_SPEEDS, (6.0, 16.0), 1.75, 0.019),
    # (433 - 149 - 46) Nm over 15 kg m²; elbow (204 - 44 - 22) over 5.
    _arm("ur15", UR15, _UR15_SPEEDS, (16.0, 27.0), 1.3, 0.014),
    # (433 - 103 - 46) Nm over 12 kg m²; elbow (204 - 29 - 22) over 3.8.
    _arm("ur18", UR18, _UR15_SPEEDS, (24.0, 40.0), 0.95, 0.011),
    # (738 - 314 - 76) Nm over 32 kg m²; elbow (433 - 90 - 45) over 13.7.
    _arm("ur20", UR20, _UR20_SPEEDS, (10.0, 21.0), 1.75, 0.019),
    # (738 - 221 - 76) Nm over 22 kg m²; elbow (433 - 62 - 45) over 10.6.
    _arm("ur30", UR30, _UR20_SPEEDS, (20.0, 30.0), 1.3, 0.014),
)
ROBOTS = MappingProxyType({arm.name: arm for arm in _ROWS})


def robot_model(name: str = "ur3", cell: Cell = NO_CELL) -> RobotModel:
    """Return a fresh nominal model of the arm called `name`.

    Args:
        name: a key of `ROBOTS`.
        cell: what stands around it and what it carries.

    Raises:
        PlanningError: unknown name, or example-robot-data is not installed.
    """
    description = ROBOTS.get(name)
    if description is None:
        raise PlanningError(f"no nominal model is called {name!r}; choose one of {', '.join(ROBOTS)}")
    model = load_pinocchio_model(description)
    return RobotModel(description, cell, model, model.createData(), int(model.getFrameId("tool0")))


@lru_cache(maxsize=len(ROBOTS))
def load_pinocchio_model(description: RobotDescription) -> Any:
    """Read the frames of an arm and move their world into UR's `base` frame.

    The result is shared between all callers and must not be changed.

    Returns:
        The Pinocchio model.
    """
    model = pin.buildModelFromXML(description.urdf)
    T_base_root = model.frames[model.getFrameId("base")].placement.inverse()
    # Everything that hangs directly on the root moves with it; the rest of the chain follows by itself.
    model.jointPlacements[1] = T_base_root * model.jointPlacements[1]
    for frame in model.frames:
        if frame.parentJoint == 0:
            frame.placement = T_base_root * frame.placement
    return model
