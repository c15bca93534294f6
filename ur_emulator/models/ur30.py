"""The UR30, in numbers.

Sources, cited by letter below:
 A  Universal Robots article "DH parameters for calculations of kinematics and dynamics" (UR30 table).
 B  UniversalRobots/Universal_Robots_ROS2_Description, config/ur30: masses and centres, turned back into the
    DH frames. Its tensors are a copy of another arm's and not used.
 D  Assumed: the tensors of the UR20; those of the arm's tubes scaled by mass and length, of wrist 3 by mass.
 C  Drives: assumed, see `joint_sizes.py`.
"""

from __future__ import annotations

from dataclasses import replace

from ur_emulator.models.robot_model import Link, dh_table
from ur_emulator.models.ur20 import UR20

UR30 = replace(
    UR20,
    name="ur30",
    title="UR30",
    # A. The vendor's "a" and "d" in metres.
    dh=dh_table(d1=0.2363, a2=-0.637, a3=-0.5037, d4=0.201, d5=0.1593, d6=0.1543),
    # B: mass, centre of mass. D: inertia.
    links=(
        Link(  # shoulder: the housing stands along y of its frame
            mass=16.343,
            com=(-0.0001, -0.06, 0.0069),
            inertia=(0.08866, 0.07632, 0.08418),
            products=(-0.00011, -0.00011, 0.0072),
        ),
        Link(  # upper arm: from the elbow (origin) back to the shoulder along +x
            mass=28.542,
            com=(0.3894, 0.0, 0.2103),
            inertia=(0.1413, 2.4543, 2.4379),
            products=(0.00014, -0.03675, 0.00003),
        ),
        Link(  # forearm: from wrist 1 (origin) back to the elbow along +x
            mass=7.156,
            com=(0.2257, 0.0, 0.0629),
            inertia=(0.02372, 0.3288, 0.3269),
            products=(-0.00003, -0.01819, -0.00001),
        ),
        Link(  # wrist 1: from the forearm along +y to the axis of wrist 2
            mass=3.054,
            com=(0.0, -0.0048, 0.0353),
            inertia=(0.00555, 0.00537, 0.00402),
            products=(-0.00001, -0.00002, 0.00036),
        ),
        Link(  # wrist 2: from wrist 1 along -y to the axis of wrist 3
            mass=3.126,
            com=(0.0, 0.0046, 0.0341),
            inertia=(0.00586, 0.00578, 0.00427),
            products=(-0.00001, -0.00002, -0.00037),
        ),
        Link(  # wrist 3 with the tool flange at the origin, facing +z
            mass=0.926,
            com=(0.0, 0.0, -0.0293),
            inertia=(0.00101, 0.001, 0.00128),
        ),
    ),
    stop_deceleration=6.0,  # assumed: as for the UR10, of the same reach
    # Joint-space inertia diagonal at `home_q` by A and B plus the armature.
    servo_inertia=(21.9, 26.2, 11.4, 1.57, 1.46, 1.44),
    payload_max=30.0,  # UR30 data sheet
    reach=1.3,
    robot_type=8,  # UR client library
    box_type=30,  # assumed: like the 16 of the UR16e
    # Elbow up, tool forward and 45 degrees down, flange at about (0.75, 0, 0.5) m.
    home_q=(0.3190, -1.7911, -2.1424, -0.0193, 1.3472, 1.8002),
    first_version="5.15.0",
)
