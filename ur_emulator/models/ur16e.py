"""The UR16e, in numbers.

Sources, cited by letter below:
 A  Universal Robots article "DH parameters for calculations of kinematics and dynamics" (UR16e table).
 B  UniversalRobots/Universal_Robots_ROS2_Description, config/ur16e: masses, centres and inertia tensors,
    turned back into the DH frames.
 C  Drives by joint size (4, 4, 3, 2, 2, 2), see `joint_sizes.py`.
"""

from __future__ import annotations

from dataclasses import replace

from ur_emulator.models.robot_model import Link, dh_table
from ur_emulator.models.ur10e import UR10E

UR16E = replace(
    UR10E,
    name="ur16e",
    title="UR16e",
    # A. The vendor's "a" and "d" in metres.
    dh=dh_table(d1=0.1807, a2=-0.4784, a3=-0.36, d4=0.17415, d5=0.11985, d6=0.11655),
    # B: mass, centre of mass and inertia.
    links=(
        Link(  # shoulder: the housing stands along y of its frame
            mass=7.369,
            com=(0.0, -0.016, 0.03),
            inertia=(0.03351, 0.03374, 0.021),
            products=(0.00002, -0.00001, 0.00374),
        ),
        Link(  # upper arm: from the elbow (origin) back to the shoulder along +x
            mass=10.45,
            com=(0.302, 0.0, 0.16),
            inertia=(0.02796, 0.47558, 0.47635),
            products=(-0.0001, -0.0072, 0.00003),
        ),
        Link(  # forearm: from wrist 1 (origin) back to the elbow along +x
            mass=4.321,
            com=(0.194, 0.0, 0.065),
            inertia=(0.01091, 0.1206, 0.11714),
            products=(0.00006, 0.01012, 0.00001),
        ),
        Link(  # wrist 1: from the forearm along +y to the axis of wrist 2
            mass=2.18,
            com=(0.0, -0.009, 0.011),
            inertia=(0.00609, 0.00245, 0.00579),
            products=(-0.00001, 0.0, 0.00083),
        ),
        Link(  # wrist 2: from wrist 1 along -y to the axis of wrist 3
            mass=2.033,
            com=(0.0, 0.018, 0.012),
            inertia=(0.00389, 0.00219, 0.00363),
            products=(-0.00001, 0.0, -0.00045),
        ),
        Link(  # wrist 3 with the tool flange at the origin, facing +z
            mass=0.907,
            com=(0.0, 0.0, -0.044),
            inertia=(0.00117, 0.00118, 0.00084),
        ),
    ),
    stop_deceleration=8.0,  # assumed: the UR10's, scaled by the reach
    # Joint-space inertia diagonal at `home_q` by A and B plus the armature.
    servo_inertia=(7.98, 9.11, 2.96, 0.657, 0.618, 0.611),
    payload_max=16.0,  # UR16e data sheet
    reach=0.9,
    robot_type=4,  # UR client library
    box_type=16,
    # Elbow up, tool forward and 45 degrees down, flange at about (0.6, 0, 0.4) m.
    home_q=(0.3432, -1.8505, -2.0218, -0.0847, 1.3306, 1.8183),
)
