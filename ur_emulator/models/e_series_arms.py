"""The first arms of the e-Series, in numbers, as in `cb3_arms`."""

from __future__ import annotations

from dataclasses import replace
from math import pi

from ur_emulator.models.cb3_arms import UR3, UR5, UR10
from ur_emulator.models.generations import E_SERIES
from ur_emulator.models.joint_sizes import SIZE_0, SIZE_1, SIZE_2, SIZE_3, SIZE_4, drives
from ur_emulator.models.robot_model import FIRST_TURN, LAST_TURN, RANGE_END, Link, RobotModel, dh_table

# The UR5e. Sources:
# A  Universal Robots article "DH parameters for calculations of kinematics and dynamics" (UR5e table).
# B  UniversalRobots/Universal_Robots_ROS2_Description 3.1.0, config/ur5e: measured inertia tensors.
# C  Drives by joint size (3, 3, 3, 1, 1, 1), see `joint_sizes.py`.
UR5E = RobotModel(
    name="ur5e",
    title="UR5e",
    generation=E_SERIES,
    # A. The vendor's "a" and "d" in metres.
    dh=dh_table(d1=0.1625, a2=-0.425, a3=-0.3922, d4=0.1333, d5=0.0997, d6=0.0996),
    # A: mass and centre of mass. B: inertia.
    links=(
        Link(3.761, (0.0, -0.02561, 0.00193), (0.0070021, 0.0064809, 0.0065729), (7e-7, -1.05e-5, 4.999e-4)),
        Link(8.058, (0.2125, 0.0, 0.11336), (0.0150589, 0.333881, 0.332472), (-5.4e-5, 5.6e-6, -1.8e-6)),
        Link(2.846, (0.15, 0.0, 0.0265), (0.0039963, 0.0787925, 0.0784851), (-1.37e-5, 0.0013727, -6.6e-6)),
        Link(1.37, (0.0, -0.0018, 0.01634), (0.0016549, 0.0013596, 0.0012628), (-2.8e-6, -4.4e-6, 1.016e-4)),
        Link(1.3, (0.0, 0.0018, 0.01634), (0.0013562, 0.0012783, 9.661e-4), (-2.7e-6, 4.4e-6, -5.05e-5)),
        Link(0.365, (0.0, 0.0, -0.001159), (0.0001869, 0.0001891, 0.0002576)),
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


# The UR3e. Sources:
# A  Universal Robots article "DH parameters for calculations of kinematics and dynamics" (UR3e table).
# B  UniversalRobots/Universal_Robots_ROS2_Description 3.1.1, config/ur3e: measured inertia tensors.
# C  Drives by joint size (2, 2, 1, 0, 0, 0), see `joint_sizes.py`.
_SIZE_2 = replace(SIZE_2, torque_constant=10.827)  # C, of this arm

UR3E = RobotModel(
    name="ur3e",
    title="UR3e",
    generation=E_SERIES,
    # A. The vendor's "a" and "d" in metres.
    dh=dh_table(d1=0.15185, a2=-0.24355, a3=-0.2132, d4=0.13105, d5=0.08535, d6=0.0921),
    # A: mass and centre of mass. B: inertia.
    links=(
        Link(1.98, (0.0, -0.02, 0.0), (0.0027657, 0.0021501, 0.0025626), (0.0000096, -0.0000149, 0.0001873)),
        Link(3.4445, (0.13, 0.0, 0.1157), (0.0042623, 0.0460284, 0.0448947), (-4.09e-5, -0.001496, -1.29e-5)),
        Link(1.437, (0.05, 0.0, 0.0238), (0.0010511, 0.0113396, 0.0110895), (0.0, -0.0000331, 0.0000022)),
        Link(0.871, (0.0, 0.0, 0.01), (0.0008174, 0.0006844, 0.0005497), (-0.0000005, 0.0000021, 0.0000617)),
        Link(0.805, (0.0, 0.0, 0.01), (6.059e-4, 5.837e-4, 3.831e-4), (-6e-7, -6e-7, -2.71e-5)),
        Link(0.261, (0.0, 0.0, -0.02), (0.000108, 0.0001086, 0.0001371)),
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


# The UR7e: a UR5e for a greater payload, which says on the wire that it is a UR5e.
# Sources: UR client library (type, first version), data sheet (payload).
UR7E = replace(UR5E, name="ur7e", title="UR7e", payload_max=7.5, first_version="5.22.0")


# The UR10e. Sources:
# A  Universal Robots article "DH parameters for calculations of kinematics and dynamics" (UR10e table).
# B  The same article and UniversalRobots/Universal_Robots_ROS2_Description, config/ur10e: inertia tensors.
# C  Drives by joint size (4, 4, 3, 2, 2, 2), see `joint_sizes.py`.
# G  Rough outline (tube and housing radii), assumed; only collisions depend on it.
UR10E = RobotModel(
    name="ur10e",
    title="UR10e",
    generation=E_SERIES,
    # A. The vendor's "a" and "d" in metres.
    dh=dh_table(d1=0.1807, a2=-0.6127, a3=-0.57155, d4=0.17415, d5=0.11985, d6=0.11655),
    # A: mass and centre of mass. B: inertia.
    links=(
        Link(7.369, (0.021, 0.0, 0.027), (0.03408, 0.03529, 0.02156), (0.00002, -0.00425, 0.00008)),
        Link(13.051, (0.38, 0.0, 0.158), (0.02814, 0.77068, 0.76943), (0.00005, -0.01561, 0.00002)),
        Link(3.989, (0.24, 0.0, 0.068), (0.01014, 0.30928, 0.30646), (0.00008, 0.00916, 0.0)),
        Link(2.1, (0.0, 0.007, 0.018), (0.00296, 0.00222, 0.00258), (-0.00001, 0.0, -0.00024)),
        Link(1.98, (0.0, 0.007, 0.018), (0.00296, 0.00222, 0.00258), (-0.00001, 0.0, -0.00024)),
        Link(0.615, (0.0, 0.0, -0.026), (0.0004, 0.00041, 0.00034)),
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


# The UR12e: a UR10e for a greater payload, which says on the wire that it is a UR10e.
# Sources: UR client library (type, first version), data sheet (payload).
UR12E = replace(UR10E, name="ur12e", title="UR12e", payload_max=12.5, first_version="5.22.0")


# The UR16e. Sources:
# A  Universal Robots article "DH parameters for calculations of kinematics and dynamics" (UR16e table).
# B  UniversalRobots/Universal_Robots_ROS2_Description, config/ur16e: masses, centres and inertia tensors,
#    turned back into the DH frames.
# C  Drives by joint size (4, 4, 3, 2, 2, 2), see `joint_sizes.py`.
UR16E = replace(
    UR10E,
    name="ur16e",
    title="UR16e",
    # A. The vendor's "a" and "d" in metres.
    dh=dh_table(d1=0.1807, a2=-0.4784, a3=-0.36, d4=0.17415, d5=0.11985, d6=0.11655),
    # B: mass, centre of mass and inertia.
    links=(
        Link(7.369, (0.0, -0.016, 0.03), (0.03351, 0.03374, 0.021), (0.00002, -0.00001, 0.00374)),
        Link(10.45, (0.302, 0.0, 0.16), (0.02796, 0.47558, 0.47635), (-0.0001, -0.0072, 0.00003)),
        Link(4.321, (0.194, 0.0, 0.065), (0.01091, 0.1206, 0.11714), (0.00006, 0.01012, 0.00001)),
        Link(2.18, (0.0, -0.009, 0.011), (0.00609, 0.00245, 0.00579), (-0.00001, 0.0, 0.00083)),
        Link(2.033, (0.0, 0.018, 0.012), (0.00389, 0.00219, 0.00363), (-0.00001, 0.0, -0.00045)),
        Link(0.907, (0.0, 0.0, -0.044), (0.00117, 0.00118, 0.00084)),
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
