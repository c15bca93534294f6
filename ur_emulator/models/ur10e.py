"""The UR10e, in numbers.

Sources, cited by letter below:
 A  Universal Robots article "DH parameters for calculations of kinematics and dynamics" (UR10e table).
 B  The same article and UniversalRobots/Universal_Robots_ROS2_Description, config/ur10e: inertia tensors.
 C  Drives by joint size (4, 4, 3, 2, 2, 2), see `joint_sizes.py`.
 G  Rough outline (tube and housing radii), assumed; only collisions depend on it.
"""

from __future__ import annotations

from dataclasses import replace
from math import pi

from ur_emulator.models.e_series import E_SERIES
from ur_emulator.models.joint_ranges import RANGE_END
from ur_emulator.models.joint_sizes import SIZE_2, SIZE_3, SIZE_4, drives
from ur_emulator.models.robot_model import Link, RobotModel, dh_table
from ur_emulator.models.ur10 import UR10

UR10E = RobotModel(
    name="ur10e",
    title="UR10e",
    generation=E_SERIES,
    # A. The vendor's "a" and "d" in metres.
    dh=dh_table(d1=0.1807, a2=-0.6127, a3=-0.57155, d4=0.17415, d5=0.11985, d6=0.11655),
    # A: mass and centre of mass. B: inertia.
    links=(
        Link(  # shoulder: the housing stands along y of its frame
            mass=7.369,
            com=(0.021, 0.0, 0.027),
            inertia=(0.03408, 0.03529, 0.02156),
            products=(0.00002, -0.00425, 0.00008),
        ),
        Link(  # upper arm: from the elbow (origin) back to the shoulder along +x
            mass=13.051,
            com=(0.38, 0.0, 0.158),
            inertia=(0.02814, 0.77068, 0.76943),
            products=(0.00005, -0.01561, 0.00002),
        ),
        Link(  # forearm: from wrist 1 (origin) back to the elbow along +x
            mass=3.989,
            com=(0.24, 0.0, 0.068),
            inertia=(0.01014, 0.30928, 0.30646),
            products=(0.00008, 0.00916, 0.0),
        ),
        Link(  # wrist 1: from the forearm along +y to the axis of wrist 2
            mass=2.1,
            com=(0.0, 0.007, 0.018),
            inertia=(0.00296, 0.00222, 0.00258),
            products=(-0.00001, 0.0, -0.00024),
        ),
        Link(  # wrist 2: from wrist 1 along -y to the axis of wrist 3
            mass=1.98,
            com=(0.0, 0.007, 0.018),
            inertia=(0.00296, 0.00222, 0.00258),
            products=(-0.00001, 0.0, -0.00024),
        ),
        Link(  # wrist 3 with the tool flange at the origin, facing +z
            mass=0.615,
            com=(0.0, 0.0, -0.026),
            inertia=(0.0004, 0.00041, 0.00034),
        ),
    ),
    outline=replace(UR10.outline, upper_arm=(0.1762, 0.075), forearm=(0.0393, 0.06)),  # G
    qd_max=(2 * pi / 3, 2 * pi / 3, pi, pi, pi, pi),  # B: 120 and 180 deg/s
    q_min=(-RANGE_END,) * 6,
    q_max=(RANGE_END,) * 6,
    **drives(SIZE_4, SIZE_4, SIZE_3, SIZE_2, SIZE_2, SIZE_2),  # C
    stop_deceleration=6.0,  # as for the UR10
    # Joint-space inertia diagonal at `home_q` by A and B plus the armature.
    servo_inertia=(8.95, 10.2, 4.26, 0.656, 0.618, 0.61),
    payload_max=10.0,  # PolyScope X user manual; labels of newer arms say 12.5
    reach=1.3,
    robot_type=2,  # UR client library
    box_type=5,
    # Elbow up, tool forward and 45 degrees down, flange at about (0.7, 0, 0.25) m.
    home_q=(0.2859, -1.9532, -2.2524, 0.2579, 1.3701, 1.7757),
)
