"""The UR18, in numbers.

Sources, cited by letter below:
 A  ros-industrial/universal_robot, ur_description/config/ur18/default_kinematics.yaml: the controller's own
    table, with its hash.
 B  physical_parameters.yaml beside it, as for the UR15.
 C  Drives and speeds are those of the UR15: Universal_Robots_ROS2_Description, config/ur18/joint_limits.yaml.
"""

from __future__ import annotations

from dataclasses import replace

from ur_emulator.models.robot_model import Link, dh_table
from ur_emulator.models.ur15 import UR15

_SHOULDER, _, _, _WRIST_1, _WRIST_2, _WRIST_3 = UR15.links

UR18 = replace(
    UR15,
    name="ur18",
    title="UR18",
    # A. The vendor's "a" and "d" in metres.
    dh=dh_table(d1=0.2186, a2=-0.475, a3=-0.3389, d4=0.1824, d5=0.1361, d6=0.1434),
    # B: mass, centre of mass and inertia; shoulder and wrists are the UR15's.
    links=(
        _SHOULDER,
        Link(  # upper arm: from the elbow (origin) back to the shoulder along +x
            mass=14.2009,
            com=(0.308664, -0.000088, 0.190204),
            inertia=(0.045094, 0.630805, 0.625724),
            products=(0.000179, -0.024705, -0.00002),
        ),
        Link(  # forearm: from wrist 1 (origin) back to the elbow along +x
            mass=5.52,
            com=(0.199652, 0.000021, 0.073101),
            inertia=(0.016891, 0.129732, 0.123451),
            products=(0.0, 0.009081, 0.000003),
        ),
        _WRIST_1,
        _WRIST_2,
        _WRIST_3,
    ),
    stop_deceleration=8.0,  # assumed: the UR10's, scaled by the reach
    # Joint-space inertia diagonal at `home_q` by A and B plus the armature.
    servo_inertia=(10.7, 11.8, 3.81, 0.915, 0.863, 0.851),
    payload_max=18.0,  # UR18 data sheet
    reach=0.95,
    robot_type=5,  # UR client library
    box_type=18,  # assumed: like the 16 of the UR16e
    # Elbow up, tool forward and 45 degrees down, flange at about (0.6, 0, 0.4) m.
    home_q=(0.3745, -1.8885, -2.1327, 0.0584, 1.3092, 1.8419),
    first_version="5.23.0",  # script of the UR client library that starts the maker's simulator
)
