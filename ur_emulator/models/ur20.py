"""The UR20, in numbers.

Sources, cited by letter below:
 A  Universal Robots article "DH parameters for calculations of kinematics and dynamics" (UR20 table).
 B  The same article and UniversalRobots/Universal_Robots_ROS2_Description, config/ur20: inertia tensors.
 C  Drives: assumed, see `joint_sizes.py`.
 G  Rough outline (tube and housing radii), assumed; only collisions depend on it.
"""

from __future__ import annotations

from math import pi

from ur_emulator.models.e_series import E_SERIES
from ur_emulator.models.joint_ranges import RANGE_END
from ur_emulator.models.joint_sizes import BASE_OF_UR20, ELBOW_OF_UR20, WRIST_OF_UR20, drives
from ur_emulator.models.robot_model import Link, Outline, RobotModel, dh_table

UR20 = RobotModel(
    name="ur20",
    title="UR20",
    generation=E_SERIES,
    # A. The vendor's "a" and "d" in metres.
    dh=dh_table(d1=0.2363, a2=-0.862, a3=-0.7287, d4=0.201, d5=0.1593, d6=0.1543),
    # A: mass and centre of mass. B: inertia.
    links=(
        Link(  # shoulder: the housing stands along y of its frame
            mass=16.343,
            com=(0.0, -0.061, 0.0062),
            inertia=(0.08866, 0.07632, 0.08418),
            products=(-0.00011, -0.00011, 0.0072),
        ),
        Link(  # upper arm: from the elbow (origin) back to the shoulder along +x
            mass=29.632,
            com=(0.5226, 0.0, 0.2098),
            inertia=(0.1467, 4.6659, 4.6348),
            products=(0.00019, -0.05163, 0.00004),
        ),
        Link(  # forearm: from wrist 1 (origin) back to the elbow along +x
            mass=7.879,
            com=(0.3234, 0.0, 0.0604),
            inertia=(0.02612, 0.75763, 0.75327),
            products=(-0.00005, -0.02898, -0.00001),
        ),
        Link(  # wrist 1: from the forearm along +y to the axis of wrist 2
            mass=3.054,
            com=(0.0, -0.0026, 0.0393),
            inertia=(0.00555, 0.00537, 0.00402),
            products=(-0.00001, -0.00002, 0.00036),
        ),
        Link(  # wrist 2: from wrist 1 along -y to the axis of wrist 3
            mass=3.126,
            com=(0.0, 0.0024, 0.0379),
            inertia=(0.00586, 0.00578, 0.00427),
            products=(-0.00001, -0.00002, -0.00037),
        ),
        Link(  # wrist 3 with the tool flange at the origin, facing +z
            mass=0.846,
            com=(0.0, -0.0003, -0.0318),
            inertia=(0.00092, 0.00091, 0.00117),
        ),
    ),
    outline=Outline(  # G
        base=(0.02, 0.04, 0.12),
        shoulder=(-0.02, 0.13, 0.11),
        upper_arm=(0.26, 0.09),
        forearm=(0.043, 0.07),
        wrist=(0.06, 0.055),
        flange=(-0.056, -0.052, 0.05),
    ),
    qd_max=(2 * pi / 3, 2 * pi / 3, 5 * pi / 6, 7 * pi / 6, 7 * pi / 6, 7 * pi / 6),  # B: 120, 150, 210 deg/s
    q_min=(-RANGE_END,) * 6,
    q_max=(RANGE_END,) * 6,
    **drives(BASE_OF_UR20, BASE_OF_UR20, ELBOW_OF_UR20, WRIST_OF_UR20, WRIST_OF_UR20, WRIST_OF_UR20),  # C
    stop_deceleration=5.0,  # assumed: the UR10's, scaled by the reach
    # Joint-space inertia diagonal at `home_q` by A and B plus the armature.
    servo_inertia=(27.6, 37.2, 14.7, 1.57, 1.46, 1.44),
    payload_max=20.0,  # UR20 data sheet
    reach=1.75,
    robot_type=7,  # UR client library
    box_type=20,  # assumed: like the 16 of the UR16e
    # Elbow up, tool forward and 45 degrees down, flange at about (1.05, 0, 0.6) m.
    home_q=(0.2153, -1.8582, -1.9758, -0.1047, 1.4192, 1.7242),
    first_version="5.14.0",
)
