"""The UR8 Long, in numbers.

Sources, cited by letter below:
 A  ros-industrial/universal_robot, ur_description/config/ur8long/default_kinematics.yaml: the controller's
    own table, with its hash.
 B  physical_parameters.yaml beside it, as for the UR15.
 C  Assumed, no list of its limits is known: drives and speeds of the UR15, whose shoulder and wrists it has;
    base and shoulder turn no faster than a UR20's, of the same reach.
"""

from __future__ import annotations

from dataclasses import replace
from math import pi

from ur_emulator.models.robot_model import Link, dh_table
from ur_emulator.models.ur15 import UR15

_SHOULDER, _, _, _WRIST_1, _WRIST_2, _WRIST_3 = UR15.links

UR8LONG = replace(
    UR15,
    name="ur8long",
    title="UR8 Long",
    # A. The vendor's "a" and "d" in metres.
    dh=dh_table(d1=0.2186, a2=-0.8989, a3=-0.7149, d4=0.1824, d5=0.1361, d6=0.1434),
    # B: mass, centre of mass and inertia; shoulder and wrists are the UR15's.
    links=(
        _SHOULDER,
        Link(  # upper arm: from the elbow (origin) back to the shoulder along +x
            mass=17.0738,
            com=(0.565429, -0.000074, 0.19542),
            inertia=(0.056709, 2.44012, 2.432744),
            products=(0.000292, -0.054852, -0.000014),
        ),
        Link(  # forearm: from wrist 1 (origin) back to the elbow along +x
            mass=7.6393,
            com=(0.416102, 0.000058, 0.065663),
            inertia=(0.022148, 0.633274, 0.625889),
            products=(0.000052, 0.019779, 0.000003),
        ),
        _WRIST_1,
        _WRIST_2,
        _WRIST_3,
    ),
    qd_max=(2 * pi / 3, 2 * pi / 3, *UR15.qd_max[2:]),  # C
    stop_deceleration=5.0,  # assumed: the UR10's, scaled by the reach
    # Joint-space inertia diagonal at `home_q` by A and B plus the armature.
    servo_inertia=(16.6, 24.0, 7.13, 0.916, 0.863, 0.851),
    payload_max=8.0,  # the name; newer lists say 10, with the load below the flange
    reach=1.75,
    robot_type=6,  # UR client library
    box_type=8,  # assumed: like the 16 of the UR16e
    # Elbow up, tool forward and 45 degrees down, flange at about (1.05, 0, 0.6) m.
    home_q=(0.1935, -1.8987, -1.9484, -0.0894, 1.4345, 1.7084),
    first_version="5.23.0",  # script of the UR client library that starts the maker's simulator
)
