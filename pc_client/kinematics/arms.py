"""The arms of the family as published: one row an arm, with its geometry, limits, reach and working box.

CB3 arms have their URDF in example-robot-data, whose UR files equal UR's published DH table; its *limits* are
wrong (the UR3 file carries UR10 torques and 124-183 deg/s) and its masses are estimates, so neither is used.
The arms that it lacks are given by the lengths of their DH table (`DhArm`), of which `urdf_text` makes a URDF
with the same links, joints and frames: base and wrist 2 turn about z, all others about y; upper arm and
forearm lie along z. Nothing here may come from the kinematics of an emulated box: a client of a real arm does
not know them.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib import metadata
from math import pi, radians
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from pc_client.arrays import Array
from pc_client.errors import MovementError, PlanningError
from ur_hil.cell import Three

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
class Box:
    """An axis-parallel box by its lowest and highest corner, m, in the robot's base frame."""

    low: Three
    high: Three

    def __post_init__(self) -> None:
        if not all(math.isfinite(b - a) and a < b for a, b in zip(self.low, self.high, strict=True)):
            raise MovementError(
                f"box from {self.low} to {self.high} m: each low edge must lie below its high edge"
            )

    @property
    def size(self) -> Array:
        """Edge lengths, (3,), m."""
        return np.subtract(self.high, self.low)

    @property
    def centre(self) -> Array:
        """Midpoint, (3,), m."""
        return 0.5 * np.add(self.high, self.low)

    def shrunk(self, margin: float) -> Box:
        """The box less a margin (m) on every side."""
        return Box(
            (self.low[0] + margin, self.low[1] + margin, self.low[2] + margin),
            (self.high[0] - margin, self.high[1] - margin, self.high[2] - margin),
        )

    def contains(self, p: ArrayLike, tolerance: float = 0.0) -> bool:
        """Whether all points p, (..., 3), m, lie inside, or outside by no more than the tolerance (m)."""
        points = np.asarray(p, dtype=np.float64)
        inside = (points >= np.subtract(self.low, tolerance)) & (points <= np.add(self.high, tolerance))
        return bool(inside.all())


@dataclass(frozen=True, slots=True)
class DhArm:
    """Lengths of an arm [m].

    Attributes:
        d1: height of the shoulder.
        a2: upper arm, negative as in the DH table.
        a3: forearm, negative.
        d4: wrist 1.
        d5: wrist 2.
        d6: wrist 3, to the flange.
        shoulder_offset: from the base axis to the middle plane of the upper arm.
        elbow_offset: from the base axis to the middle plane of the forearm.
        foot: radius of the base where it is mounted.
        radii: of the housings of shoulder, elbow and wrists.
    """

    d1: float
    a2: float
    a3: float
    d4: float
    d5: float
    d6: float
    shoulder_offset: float
    elbow_offset: float
    foot: float
    radii: Three

    @property
    def elbow_step(self) -> float:
        """From the middle plane of the forearm to that of the upper arm."""
        return self.shoulder_offset - self.elbow_offset

    @property
    def wrist_step(self) -> float:
        """From the middle plane of the forearm to the axis of wrist 2."""
        return self.d4 - self.elbow_offset


_CALIBRATION_SHARE = 0.012
"""Of the reach: 34 real arms are off by .3 to .8 % of it at most, a UR10 by 1.15 % (docs/fidelity.md)."""


@dataclass(frozen=True, slots=True)
class RobotDescription:
    """The data in which the arms of the family differ.

    Attributes:
        name: short name, e.g. `ur3`.
        geometry: file below `example-robot-data/robots/`, or the lengths of the arm.
        reach: distance from the base axis to the flange of the stretched arm [m].
        working_box: where the tool at RPY(0, 3/4 pi, 0) runs .35 m/s in every direction below the joint speed
            limits, in one branch of the inverse kinematics, clear of the arm and of the table.
        q_branch: a posture on the IK branch that is preferred for drawing in front of the arm [rad].
        tcp_speed_max: TCP speed limit [m/s].
    """

    name: str
    geometry: str | DhArm
    limits: JointLimits
    reach: float
    working_box: Box
    q_branch: Six
    tcp_speed_max: float

    @property
    def title(self) -> str:
        """The name for people, as robots report it, e.g. `UR5e`."""
        kind = self.name.removeprefix("ur")
        return f"UR{kind if kind.endswith('e') else kind.upper()}"

    @property
    def position_tolerance(self) -> float:
        """Between the flange that a real arm reports and this model's [m]."""
        return _CALIBRATION_SHARE * self.reach

    @property
    def library_shift(self) -> Array:
        """The shortest way of the UR3's box, and of movements that were made for it, into this arm's [m]."""
        low, high = self.working_box.low, self.working_box.high
        shift: Array = np.clip(0.0, np.subtract(low, UR3_BOX.low), np.subtract(high, UR3_BOX.high))
        return shift

    @property
    def urdf(self) -> str:
        """The URDF of its frames; PlanningError if example-robot-data is not installed."""
        if isinstance(self.geometry, str):
            return find_robot_file(self.geometry).read_text(encoding="utf-8")
        return urdf_text(self.geometry, self.name)


# Lengths: UR's article "DH parameters for calculations of kinematics and dynamics"; UR8 Long, UR15 and UR18
# by ros-industrial/universal_robot (ur_description/config/*/default_kinematics.yaml). Offsets: UR's ROS
# description (config/*/physical_parameters.yaml, "measured from model"; of UR8 Long, UR15 and UR18 it has the
# faces between two links, in the middle between their planes). The foot is half of the footprint in the data
# sheet. Radii go by joint size, from the meshes of the CB3 arms, whose housings are as large: 32 mm for size
# 0, 38 for 1, 46 for 2, 60 for 3, 75 for 4. Those of UR20 and UR30 are assumed, in proportion to the offsets;
# those of a UR15 are half of the widths of a UR8 Long's parts, by public notes on their STL files.
# Columns: d1, a2, a3, d4, d5, d6, shoulder_offset, elbow_offset, foot, radii.
_UR3E = DhArm(0.15185, -0.24355, -0.2132, 0.13105, 0.08535, 0.0921, 0.12, 0.027, 0.064, (0.046, 0.038, 0.032))
_UR5E = DhArm(0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996, 0.138, 0.007, 0.075, (0.06, 0.06, 0.038))
_UR10E = DhArm(
    0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655, 0.1762, 0.0393, 0.095, (0.075, 0.06, 0.046)
)
_UR20 = DhArm(0.2363, -0.862, -0.7287, 0.201, 0.1593, 0.1543, 0.26, 0.043, 0.1225, (0.11, 0.095, 0.064))
_UR15 = DhArm(0.2186, -0.6475, -0.5164, 0.1824, 0.1361, 0.1434, 0.218, 0.0505, 0.102, (0.075, 0.062, 0.045))
_UR16E = replace(_UR10E, a2=-0.4784, a3=-0.36, shoulder_offset=0.176, elbow_offset=0.04)
_UR30 = replace(_UR20, a2=-0.637, a3=-0.5037)
_UR18 = replace(_UR15, a2=-0.475, a3=-0.3389)
_UR8LONG = replace(_UR15, a2=-0.8989, a3=-0.7149)

_STOPPABLE_SPEED = 180.0
"""No joint is asked for more than this [deg/s], which only a UR3's wrists could do: from it the arm is at
rest within 0.3 s of the client's last command (the figures are those of `driver.receiver`)."""


def _six_degrees(*angles: float) -> Six:
    """Turn six angles [deg] into [rad]."""
    a, b, c, d, e, f = (radians(angle) for angle in angles)
    return (a, b, c, d, e, f)


# Elbow up, tool 45 deg down and forward: for the UR3 the branch whose whole box [.275, .425] x [-.2, .2] x
# [.15, .35] m is reachable at >= .35 m/s in every direction. Source: own closed-form sweep of all branches.
# The other arms have the same shape, so the same posture names the same branch.
_ELBOW_UP = _six_degrees(22.6, -101.1, -120.3, -5.9, 74.2, 106.4)

_TCP_SPEED = 1.0
"""[m/s]. Source: data sheets up to the UR16e, "typical tool speed 1 m/s"; later arms get no more."""


def _arm(
    name: str,
    lengths: DhArm | None,
    speeds: Six,
    accelerations: tuple[float, float],
    reach: float,
    box: tuple[float, float, float, float, float],
) -> RobotDescription:
    """A row of the table, in SI units but for the rated speeds [deg/s].

    Args:
        lengths: None: its URDF is in example-robot-data.
        accelerations: of shoulder and elbow.
        box: working box: x from, x to, y to both sides, z from, z to.
    """
    qd_max = _six_degrees(*(min(speed, _STOPPABLE_SPEED) for speed in speeds))
    shoulder, elbow = accelerations
    qdd_max = (shoulder, shoulder, elbow, _WRISTS, _WRISTS, _WRISTS)
    near, far, aside, bottom, top = box
    return RobotDescription(
        name,
        lengths or f"ur_description/urdf/{name}_robot.urdf",
        JointLimits((-2 * pi,) * 6, (2 * pi,) * 6, qd_max, qdd_max),
        reach,
        Box((near, -aside, bottom), (far, aside, top)),
        _ELBOW_UP,
        _TCP_SPEED,
    )


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
# DH article; rotor inertia and friction: identified sets of real arms (.61 kg m² for joints of size 2, 1.93
# for size 3, 5.9 for size 4, on CB3 and e-Series; the larger ones assumed, in proportion to the torque).
# The base gets what the shoulder gets.
_WRISTS = 40.0

# Working range: +-360 deg of all joints, by UR's user manuals CB3 3.13, technical specifications, and UR's
# ROS description of the others (wrist 3 of UR3 and UR3e turns without end, streaming needs no more). Reach:
# the data sheets. Working boxes: a search for the largest box on a grid (UR3 25 mm,
# others 50 mm) with the nominal kinematics; a UR3e has the UR3's, for the movements that lie in it.
_ROWS = (
    # (56 - 19 gravity - 7 friction) Nm over 1.1 kg m²; elbow (28 - 7 - 4) over .4.
    _arm("ur3", None, _UR3_SPEEDS, (27.0, 40.0), 0.5, (0.275, 0.425, 0.2, 0.15, 0.35)),
    # (150 - 55 - 33) Nm over 3.7 kg m²; elbow (150 - 17 - 33) over 2.6.
    _arm("ur5", None, _UR5_SPEEDS, (17.0, 38.0), 0.85, (0.3, 0.65, 0.4, 0.15, 0.55)),
    # (330 - 122 - 29) Nm over 11.8 kg m²; elbow (150 - 41 - 33) over 4.3.
    _arm("ur10", None, _UR10_SPEEDS, (15.0, 18.0), 1.3, (0.4, 0.85, 0.7, 0.15, 0.8)),
    # (54 - 19 - 6) Nm over 1.1 kg m²; elbow (28 - 7 - 3) over .4.
    _arm("ur3e", _UR3E, _UR3_SPEEDS, (26.0, 40.0), 0.5, (0.275, 0.425, 0.2, 0.15, 0.35)),
    # (150 - 62 - 16) Nm over 3.6 kg m²; elbow (150 - 20 - 16) over 2.7.
    _arm("ur5e", _UR5E, _UR5_SPEEDS, (20.0, 40.0), 0.85, (0.35, 0.65, 0.45, 0.1, 0.6)),
    _arm("ur7e", _UR5E, _UR5_SPEEDS, (20.0, 40.0), 0.85, (0.35, 0.65, 0.45, 0.1, 0.6)),
    # (330 - 125 - 34) Nm over 11.8 kg m²; elbow (150 - 43 - 16) over 4.3.
    _arm("ur10e", _UR10E, _UR10_SPEEDS, (14.0, 21.0), 1.3, (0.4, 0.95, 0.65, 0.15, 0.8)),
    _arm("ur12e", _UR10E, _UR10_SPEEDS, (14.0, 21.0), 1.3, (0.4, 0.95, 0.65, 0.15, 0.8)),
    # (330 - 91 - 34) Nm over 8.4 kg m²; elbow (150 - 29 - 16) over 2.8.
    _arm("ur16e", _UR16E, _UR10_SPEEDS, (24.0, 37.0), 0.9, (0.45, 0.7, 0.5, 0.15, 0.6)),
    # (433 - 233 - 46) Nm over 24 kg m²; elbow (204 - 64 - 22) over 7.1.
    _arm("ur8long", _UR8LONG, _UR8LONG_SPEEDS, (6.0, 16.0), 1.75, (0.55, 1.3, 0.9, 0.15, 1.0)),
    # (433 - 149 - 46) Nm over 15 kg m²; elbow (204 - 44 - 22) over 5.
    _arm("ur15", _UR15, _UR15_SPEEDS, (16.0, 27.0), 1.3, (0.5, 1.0, 0.65, 0.15, 0.75)),
    # (433 - 103 - 46) Nm over 12 kg m²; elbow (204 - 29 - 22) over 3.8.
    _arm("ur18", _UR18, _UR15_SPEEDS, (24.0, 40.0), 0.95, (0.5, 0.75, 0.45, 0.2, 0.6)),
    # (738 - 314 - 76) Nm over 32 kg m²; elbow (433 - 90 - 45) over 13.7.
    _arm("ur20", _UR20, _UR20_SPEEDS, (10.0, 21.0), 1.75, (0.55, 1.3, 0.85, 0.2, 1.05)),
    # (738 - 221 - 76) Nm over 22 kg m²; elbow (433 - 62 - 45) over 10.6.
    _arm("ur30", _UR30, _UR20_SPEEDS, (20.0, 30.0), 1.3, (0.6, 1.05, 0.6, 0.15, 0.75)),
)
ROBOTS = MappingProxyType({arm.name: arm for arm in _ROWS})

UR3_BOX = ROBOTS["ur3"].working_box
"""Where the movements of the library lie."""

SHARE_VARIABLE = "EXAMPLE_ROBOT_DATA_SHARE"
"""Environment variable that names the share folder, i.e. the one that contains `example-robot-data/`."""

_PACKAGE = "example-robot-data"
_CMEEL_SHARE = Path("cmeel.prefix") / "share"


def find_share_folder() -> Path:
    """Return the folder that contains `example-robot-data/`, the root of its `package://` addresses.

    Raises:
        PlanningError: the package is nowhere to be found; the message says what to install.
    """
    for folder in _candidates():
        if (folder / _PACKAGE / "robots").is_dir():
            return folder
    raise PlanningError(
        "the nominal robot model is missing: example-robot-data was not found; "
        f"run `pip install 'ur-hil[client]'` or set {SHARE_VARIABLE} to its share folder"
    )


def find_robot_file(relative: str) -> Path:
    """The path of a file below `example-robot-data/robots/`, e.g. ur_description/urdf/ur3_robot.urdf.

    Raises:
        PlanningError: the package is missing, or this version of it has no such file.
    """
    path = find_share_folder() / _PACKAGE / "robots" / relative
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
        distribution = metadata.distribution(_PACKAGE)
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


def urdf_text(arm: DhArm, name: str) -> str:
    """The frames of an arm as a URDF, without bodies and masses; the limits in it are none."""
    straight, turned, y, z = (0.0, 0.0, 0.0), (0.0, pi / 2, 0.0), (0, 1, 0), (0, 0, 1)
    out, inward, on = (0.0, arm.shoulder_offset, 0.0), -arm.elbow_step, (0.0, arm.wrist_step, 0.0)
    joints = (
        ("shoulder_pan_joint", "base_link", "shoulder_link", (0.0, 0.0, arm.d1), straight, z),
        ("shoulder_lift_joint", "shoulder_link", "upper_arm_link", out, turned, y),
        ("elbow_joint", "upper_arm_link", "forearm_link", (0.0, inward, -arm.a2), straight, y),
        ("wrist_1_joint", "forearm_link", "wrist_1_link", (0.0, 0.0, -arm.a3), turned, y),
        ("wrist_2_joint", "wrist_1_link", "wrist_2_link", on, straight, z),
        ("wrist_3_joint", "wrist_2_link", "wrist_3_link", (0.0, 0.0, arm.d5), straight, y),
        ("base_link-base_fixed_joint", "base_link", "base", straight, (0.0, 0.0, -pi), None),
        ("wrist_3_link-tool0_fixed_joint", "wrist_3_link", "tool0", (0, arm.d6, 0), (-pi / 2, 0, 0), None),
    )
    elements = ['<link name="base_link"/>']
    for joint, parent, child, xyz, rpy, axis in joints:
        # A joint that turns must have limits in a URDF; nothing reads them.
        turns = "" if axis is None else f'<axis xyz="{_text(axis)}"/><limit velocity="0" effort="0"/>'
        elements.append(
            f'<link name="{child}"/><joint name="{joint}" type="{"fixed" if axis is None else "revolute"}">'
            f'<parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{_text(xyz)}" rpy="{_text(rpy)}"/>{turns}</joint>'
        )
    return f'<robot name="{name}">{"".join(elements)}</robot>'


def _text(numbers: tuple[float, ...]) -> str:
    return " ".join(map(repr, numbers))
