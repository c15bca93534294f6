"""The UR5e, in numbers.

Sources, cited by letter below:
 A  Universal Robots article "DH parameters for calculations of kinematics and dynamics" (UR5e table).
 B  UniversalRobots/Universal_Robots_ROS2_Description 3.1.0, config/ur5e: measured inertia tensors.
 C  Drives by joint size (3, 3, 3, 1, 1, 1), see `joint_sizes.py`.
"""

from __future__ import annotations

from math import pi

from ur_emulator.models.e_series import E_SERIES
from ur_emulator.models.joint_ranges import RANGE_END
from ur_emulator.models.joint_sizes import SIZE_1, SIZE_3, drives
from ur_emulator.models.robot_model import Link, RobotModel, dh_table
from ur_emulator.models.ur5 import UR5

UR5E = RobotModel(
    name="ur5e",
    title="UR5e",
    generation=E_SERIES,
    # A. The vendor's "a" and "d" in metres.
    dh=dh_table(d1=0.1625, a2=-0.425, a3=-0.3922, d4=0.1333, d5=0.0997, d6=0.0996),
    # A: mass and centre of mass. B: inertia.
    links=(
        Link(  # shoulder: the cylinder stands along y of its frame
            mass=3.761,
            com=(0.0, -0.02561, 0.00193),
            inertia=(0.0070021, 0.0064809, 0.0065729),
            products=(0.0000007, -0.0000105, 0.0004999),
        ),
        Link(  # upper arm: from the elbow (origin) back to the shoulder along +x
            mass=8.058,
            com=(0.2125, 0.0, 0.11336),
            inertia=(0.0150589, 0.333881, 0.332472),
            products=(-0.000054, 0.0000056, -0.0000018),
        ),
        Link(  # forearm: from wrist 1 (origin) back to the elbow along +x
            mass=2.846,
            com=(0.15, 0.0, 0.0265),
            inertia=(0.0039963, 0.0787925, 0.0784851),
            products=(-0.0000137, 0.0013727, -0.0000066),
        ),
        Link(  # wrist 1: from the forearm along +y to the axis of wrist 2
            mass=1.37,
            com=(0.0, -0.0018, 0.01634),
            inertia=(0.0016549, 0.0013596, 0.0012628),
            products=(-0.0000028, -0.0000044, 0.0001016),
        ),
        Link(  # wrist 2: from wrist 1 along -y to the axis of wrist 3
            mass=1.3,
            com=(0.0, 0.0018, 0.01634),
            inertia=(0.0013562, 0.0012783, 0.0009661),
            products=(-0.0000027, 0.0000044, -0.0000505),
        ),
        Link(  # wrist 3 with the tool flange at the origin, facing +z
            mass=0.365,
            com=(0.0, 0.0, -0.001159),
            inertia=(0.0001869, 0.0001891, 0.0002576),
        ),
    ),
    outline=UR5.outline,
    qd_max=(pi,) * 6,  # B: 180 deg/s
    q_min=(-RANGE_END,) * 6,  # capture of a UR5e
    q_max=(RANGE_END,) * 6,
    **drives(SIZE_3, SIZE_3, SIZE_3, SIZE_1, SIZE_1, SIZE_1),  # C
    stop_deceleration=13.0,  # as for the UR5
    # Joint-space inertia diagonal at `home_q` by A and B plus the armature.
    servo_inertia=(3, 3.88, 2.73, 0.235, 0.217, 0.212),
    payload_max=5.0,  # UR5e data sheet
    reach=0.85,
    has_point_masses=True,  # A calls the tensors of UR3e and UR5e negligible
    robot_type=1,  # client interface sheet, configuration data
    box_type=4,
    # Elbow up, tool forward and 45 degrees down, flange at about (.55, 0, .35) m.
    home_q=(0.2817, -1.7391, -2.0296, -0.1784, 1.3730, 1.7726),
)
