"""The client's nominal arm: published geometry through Pinocchio, and limits of its own.

The geometry is read from example-robot-data, whose UR files equal UR's published DH table; its *limits* are
wrong (the UR3 file carries UR10 torques and 124-183 deg/s) and its masses are estimates, so neither is used.
Nothing here may be fed with the kinematics of an emulated box: a client of a real arm does not know them.

Frames: everything is expressed in UR's `base` frame, the frame of the DH table and of the TCP poses that a
control box reports. (The URDF's own root, `base_link`, is turned by pi about z against it.) The TCP is the
flange, `tool0`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from math import pi, radians
from types import MappingProxyType
from typing import Any

import pinocchio as pin

from pc_client.errors import PlanningError
from pc_client.kinematics.cell import NO_CELL, Cell
from pc_client.kinematics.robot_data import find_robot_file

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
        urdf: file below `example-robot-data/robots/`.
        limits: joint limits.
        q_branch: a posture on the IK branch that is preferred for drawing in front of the arm [rad].
        tcp_speed_max: TCP speed limit [m/s].
        reach: distance from the base axis to the flange of the stretched arm [m].
        position_tolerance: between the flange that a real arm reports and this model's [m].
    """

    name: str
    urdf: str
    limits: JointLimits
    q_branch: Six
    tcp_speed_max: float
    reach: float
    position_tolerance: float


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


# Source: UR user manuals CB3 3.13, technical specifications: working range +-360 deg of all joints (wrist 3
# of the UR3 turns without end, but streaming needs no more than this).
_ANY_TURN_MIN: Six = (-2 * pi,) * 6
_ANY_TURN_MAX: Six = (2 * pi,) * 6

# Elbow up, tool 45 deg down and forward: for the UR3 the branch whose whole box [.275, .425] x [-.2, .2] x
# [.15, .35] m is reachable at >= .35 m/s in every direction. Source: own closed-form sweep of all branches.
# The larger arms have the same shape, so the same posture names the same branch.
_ELBOW_UP = _six_degrees(22.6, -101.1, -120.3, -5.9, 74.2, 106.4)

# Accelerations: UR publishes none. UR's own driver streams speedj with a = 40 rad/s²
# (Universal_Robots_Client_Library, external_control.urscript); no joint gets more. For the large joints it
# is less, from torque: what UR's "max joint torques" leave after gravity of the bare arm in its worst
# posture and friction at 1 rad/s, over the inertia of the arm before its base with the rotor. Masses: UR's
# DH article; rotor inertia and friction: identified sets of real arms (.45 kg m² for joints of size 2 on a
# UR3, 1.93 for size 3, 5.9 for size 4). The base gets what the shoulder gets.
#
# TCP speeds: the data sheets of all three arms, "typical tool speed 1 m/s". Reach: the same. Position
# tolerances: twice what three real UR3e calibrations come to, 2.7 mm, in proportion to the reach; a choice,
# docs/fidelity.md.
ROBOTS = MappingProxyType(
    {
        # Speeds: UR3 manual CB3 3.13: base, shoulder, elbow 180 deg/s, wrists 360 deg/s
        # (= ur_description config/ur3/joint_limits.yaml).
        "ur3": RobotDescription(
            name="ur3",
            urdf="ur_description/urdf/ur3_robot.urdf",
            limits=JointLimits(
                _ANY_TURN_MIN,
                _ANY_TURN_MAX,
                qd_max=_speeds(180, 180, 180, 360, 360, 360),
                # (56 - 19 gravity - 10 friction) Nm over .95 kg m²; elbow (28 - 7 - 4) over .4.
                qdd_max=(28.0, 28.0, 40.0, 40.0, 40.0, 40.0),
            ),
            q_branch=_ELBOW_UP,
            tcp_speed_max=1.0,
            reach=0.5,
            position_tolerance=0.005,
        ),
        # UR5 manual CB3 3.13: all joints 180 deg/s (= config/ur5/joint_limits.yaml).
        "ur5": RobotDescription(
            name="ur5",
            urdf="ur_description/urdf/ur5_robot.urdf",
            limits=JointLimits(
                _ANY_TURN_MIN,
                _ANY_TURN_MAX,
                qd_max=_speeds(180, 180, 180, 180, 180, 180),
                # (150 - 55 - 14) Nm over 3.7 kg m²; elbow (150 - 17 - 17) over 2.6.
                qdd_max=(22.0, 22.0, 40.0, 40.0, 40.0, 40.0),
            ),
            q_branch=_ELBOW_UP,
            tcp_speed_max=1.0,
            reach=0.85,
            position_tolerance=0.009,
        ),
        # UR10 manual CB3 3.13: base, shoulder 120 deg/s, others 180 deg/s (config/ur10/joint_limits.yaml).
        "ur10": RobotDescription(
            name="ur10",
            urdf="ur_description/urdf/ur10_robot.urdf",
            limits=JointLimits(
                _ANY_TURN_MIN,
                _ANY_TURN_MAX,
                qd_max=_speeds(120, 120, 180, 180, 180, 180),
                # (330 - 122 - 29) Nm over 11.8 kg m²; elbow (150 - 41 - 17) over 4.3.
                qdd_max=(15.0, 15.0, 21.0, 40.0, 40.0, 40.0),
            ),
            q_branch=_ELBOW_UP,
            tcp_speed_max=1.0,
            reach=1.3,
            position_tolerance=0.014,
        ),
    }
)


def robot_model(name: str = "ur3", cell: Cell = NO_CELL) -> RobotModel:
    """Return a fresh nominal model of the arm called `name`.

    Args:
        name: one of `ur3`, `ur5`, `ur10`.
        cell: what stands around it and what it carries.

    Raises:
        PlanningError: unknown name, or example-robot-data is not installed.
    """
    description = ROBOTS.get(name)
    if description is None:
        raise PlanningError(f"no nominal model is called {name!r}; choose one of {', '.join(sorted(ROBOTS))}")
    model = load_pinocchio_model(description.urdf)
    return RobotModel(description, cell, model, model.createData(), int(model.getFrameId("tool0")))


@lru_cache(maxsize=len(ROBOTS))
def load_pinocchio_model(urdf: str) -> Any:
    """Read a URDF of example-robot-data and move its world into UR's `base` frame.

    The result is shared between all callers and must not be changed.

    Args:
        urdf: file below `example-robot-data/robots/`.

    Returns:
        The Pinocchio model.
    """
    model = pin.buildModelFromUrdf(str(find_robot_file(urdf)))
    T_base_root = model.frames[model.getFrameId("base")].placement.inverse()
    # Everything that hangs directly on the root moves with it; the rest of the chain follows by itself.
    model.jointPlacements[1] = T_base_root * model.jointPlacements[1]
    for frame in model.frames:
        if frame.parentJoint == 0:
            frame.placement = T_base_root * frame.placement
    return model
