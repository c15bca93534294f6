"""The UR3e, in numbers.

Sources, cited by letter below:
 A  Universal Robots article "DH parameters for calculations of kinematics and dynamics" (UR3e table).
 B  UniversalRobots/Universal_Robots_ROS2_Description 3.1.1, config/ur3e: measured inertia tensors.
 C  Drives by joint size (2, 2, 1, 0, 0, 0), see `joint_sizes.py`.
"""

from __future__ import annotations

from dataclasses import replace
from math import pi

from ur_emulator.models.e_series import E_SERIES
from ur_emulator.models.joint_ranges import FIRST_TURN, LAST_TURN, RANGE_END
from ur_emulator.models.joint_sizes import SIZE_0, SIZE_1, SIZE_2, drives
from ur_emulator.models.robot_model import Link, RobotModel, dh_table
from ur_emulator.models.ur3 import UR3

_SIZE_2 = replace(SIZE_2, torque_constant=10.827)  # C, of this arm

UR3E = RobotModel(
    name="ur3e",
    title="UR3e",
    generation=E_SERIES,
    # A. The vendor's "a" and "d" in metres.
    dh=dh_table(d1=0.15185, a2=-0.24355, a3=-0.2132, d4=0.13105, d5=0.08535, d6=0.0921),
    # A: mass and centre of mass. B: inertia.
    links=(
        Link(  # shoulder: the housing stands along y of its frame
            mass=1.98,
            com=(0.0, -0.02, 0.0),
            inertia=(0.0027657, 0.0021501, 0.0025626),
            products=(0.0000096, -0.0000149, 0.0001873),
        ),
        Link(  # upper arm: from the elbow (origin) back to the shoulder along +x
            mass=3.4445,
            com=(0.13, 0.0, 0.1157),
            inertia=(0.0042623, 0.0460284, 0.0448947),
            products=(-0.0000409, -0.001496, -0.0000129),
        ),
        Link(  # forearm: from wrist 1 (origin) back to the elbow along +x
            mass=1.437,
            com=(0.05, 0.0, 0.0238),
            inertia=(0.0010511, 0.0113396, 0.0110895),
            products=(0.0, -0.0000331, 0.0000022),
        ),
        Link(  # wrist 1: from the forearm along +y to the axis of wrist 2
            mass=0.871,
            com=(0.0, 0.0, 0.01),
            inertia=(0.0008174, 0.0006844, 0.0005497),
            products=(-0.0000005, 0.0000021, 0.0000617),
        ),
        Link(  # wrist 2: from wrist 1 along -y to the axis of wrist 3
            mass=0.805,
            com=(0.0, 0.0, 0.01),
            inertia=(0.0006059, 0.0005837, 0.0003831),
            products=(-0.0000006, -0.0000006, -0.0000271),
        ),
        Link(  # wrist 3 with the tool flange at the origin, facing +z
            mass=0.261,
            com=(0.0, 0.0, -0.02),
            inertia=(0.000108, 0.0001086, 0.0001371),
        ),
    ),
    outline=UR3.outline,
    qd_max=(pi, pi, pi, 2 * pi, 2 * pi, 2 * pi),  # B: 180 and 360 deg/s
    q_min=(*(-RANGE_END,) * 5, FIRST_TURN),  # wrist 3 is endless
    q_max=(*(RANGE_END,) * 5, LAST_TURN),
    **drives(_SIZE_2, _SIZE_2, SIZE_1, SIZE_0, SIZE_0, SIZE_0),  # C
    stop_deceleration=20.0,  # as for the UR3
    # Joint-space inertia diagonal at `home_q` by A and B plus the armature.
    servo_inertia=(0.852, 0.917, 0.377, 0.0817, 0.0733, 0.0713),
    payload_max=3.0,  # UR3e data sheet
    reach=0.5,
    has_point_masses=True,  # C: its own log
    robot_type=3,  # UR client library
    box_type=6,
    # Elbow up, tool forward and 45 degrees down, flange at about (0.35, 0, 0.25) m.
    home_q=(0.4780, -1.6723, -2.1592, -0.1548, 1.2395, 1.9220),
)
