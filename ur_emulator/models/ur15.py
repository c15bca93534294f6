"""The UR15, in numbers.

Sources, cited by letter below:
 A  ros-industrial/universal_robot, ur_description/config/ur15/default_kinematics.yaml: the controller's own
    table, with its hash.
 B  physical_parameters.yaml beside it: masses, centres and tensors, turned back into the DH frames; the
    offsets of the links, from which the outline follows.
 C  Drives: torques and speeds of joint_limits.yaml there; the rest assumed, see `joint_sizes.py`.
 G  Rough outline: radii by the bounding boxes of a UR8 Long's parts (public notes on their STL files); only
    collisions depend on it.
"""

from __future__ import annotations

from math import pi

from ur_emulator.models.e_series import E_SERIES
from ur_emulator.models.joint_ranges import RANGE_END
from ur_emulator.models.joint_sizes import ELBOW_OF_UR15, ELBOW_OF_UR20, WRIST_OF_UR15, drives
from ur_emulator.models.robot_model import Link, Outline, RobotModel, dh_table

UR15 = RobotModel(
    name="ur15",
    title="UR15",
    generation=E_SERIES,
    # A. The vendor's "a" and "d" in metres.
    dh=dh_table(d1=0.2186, a2=-0.6475, a3=-0.5164, d4=0.1824, d5=0.1361, d6=0.1434),
    # B: mass, centre of mass and inertia.
    links=(
        Link(  # shoulder: the housing stands along y of its frame
            mass=9.9883,
            com=(0.000024, -0.033309, 0.025304),
            inertia=(0.051334, 0.047702, 0.034263),
            products=(0.000025, -0.000016, 0.008805),
        ),
        Link(  # upper arm: from the elbow (origin) back to the shoulder along +x
            mass=14.9255,
            com=(0.419009, -0.000083, 0.192787),
            inertia=(0.048202, 1.188499, 1.182771),
            products=(0.000232, -0.032135, -0.000017),
        ),
        Link(  # forearm: from wrist 1 (origin) back to the elbow along +x
            mass=6.1015,
            com=(0.305471, 0.000019, 0.070552),
            inertia=(0.018481, 0.303502, 0.296843),
            products=(-0.000005, 0.013601, 0.000003),
        ),
        Link(  # wrist 1: from the forearm along +y to the axis of wrist 2
            mass=2.089,
            com=(0.000025, -0.019695, 0.016413),
            inertia=(0.004339, 0.002548, 0.003912),
            products=(0.000019, 0.000001, 0.000706),
        ),
        Link(  # wrist 2: from wrist 1 along -y to the axis of wrist 3
            mass=2.0869,
            com=(0.000025, 0.01996, 0.015886),
            inertia=(0.004288, 0.002566, 0.003927),
            products=(0.000017, -0.000003, -0.000716),
        ),
        Link(  # wrist 3 with the tool flange at the origin, facing +z
            mass=1.0666,
            com=(-0.000018, -0.000112, -0.053397),
            inertia=(0.001406, 0.001404, 0.001002),
            products=(-0.000003, 0.00001, -0.000024),
        ),
    ),
    outline=Outline(  # G
        base=(0.015, 0.03, 0.1),
        shoulder=(-0.01, 0.11, 0.085),
        upper_arm=(0.218, 0.072),
        forearm=(0.0505, 0.06),
        wrist=(0.055, 0.045),
        flange=(-0.05, -0.046, 0.045),
    ),
    qd_max=(pi, pi, 4 * pi / 3, 5 * pi / 3, 5 * pi / 3, 5 * pi / 3),  # C: 180, 240, 300 deg/s
    q_min=(-RANGE_END,) * 6,
    q_max=(RANGE_END,) * 6,
    **drives(ELBOW_OF_UR20, ELBOW_OF_UR20, ELBOW_OF_UR15, WRIST_OF_UR15, WRIST_OF_UR15, WRIST_OF_UR15),  # C
    stop_deceleration=6.0,  # assumed: as for the UR10, of the same reach
    # Joint-space inertia diagonal at `home_q` by A and B plus the armature.
    servo_inertia=(12.1, 14.9, 4.99, 0.915, 0.863, 0.851),
    payload_max=15.0,  # UR15 data sheet
    reach=1.3,
    robot_type=9,  # UR client library
    box_type=15,  # assumed: like the 16 of the UR16e
    # Elbow up, tool forward and 45 degrees down, flange at about (0.75, 0, 0.45) m.
    home_q=(0.2851, -1.8504, -2.129, 0.0318, 1.3707, 1.7751),
    first_version="5.22.0",  # script of the UR client library that starts the maker's simulator
)
