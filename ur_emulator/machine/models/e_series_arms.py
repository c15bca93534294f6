"""The arms with the software of the e-Series, in numbers, as in `cb3_arms`; first the sizes of their joints.

Sources, cited by letter; what only one arm has stands above it:
 A  Universal Robots article "DH parameters for calculations of kinematics and dynamics", table of the arm.
 B  UniversalRobots/Universal_Robots_ROS2_Description 3.1.0, config/ of the arm (UR3e: 3.1.1): measured
    inertia tensors, joint_limits.yaml.
 C  Fits of the controller's own drive model to logs of a real UR10e (dynamic_calibration of S. Mamedov) and a
    real UR3e (dsn-2022-rad-artifact): target torque against target current. Size 2 is in both and agrees
    within 1 %.
 D  Assumed for the joints of the UR8 Long, UR15, UR18, UR20 and UR30, of which no log is known: the other
    sizes extrapolated by the rated torque. Rotor inertia grows with its power of 1.26; friction is
    proportional to it.
 E  ros-industrial/universal_robot, ur_description/config/ of the arm: default_kinematics.yaml, the
    controller's own table with its hash; physical_parameters.yaml: masses, centres and tensors, turned back
    into the DH frames, and the offsets of the links, from which the outline follows; joint_limits.yaml.
 G  Rough outline (tube and housing radii), assumed; only collisions depend on it.
"""

from dataclasses import dataclass, fields, replace
from math import pi
from typing import Any

from ur_emulator.machine.models.cb3_arms import UR3, UR5, UR10
from ur_emulator.machine.models.generations import E_SERIES
from ur_emulator.machine.models.robot_model import Link, Outline, RobotModel, dh_table, six


@dataclass(frozen=True, slots=True)
class JointSize:
    """What all joints of a size have in common, by names, and in units, of `RobotModel`."""

    tau_max: float
    torque_constant: float
    armature: float
    coulomb: float
    viscous: float
    viscous_fast: float


# tau_max, torque_constant, armature, coulomb, viscous, viscous_fast. Base and shoulder of a UR3e have nearly
# the numbers of size 2; those of a UR15 have the torque of a UR20's elbow.
SIZE_0 = JointSize(9.0, 3.600, 0.0712, 0.69, 0.61, 0.63)  # B, C: wrists of a UR3e
SIZE_1 = JointSize(28.0, 7.571, 0.2118, 1.52, 2.08, 1.26)  # B, C: elbow of a UR3e
SIZE_2 = JointSize(54.0, 10.763, 0.61, 3.15, 3.8, 2.6)  # B, C: wrists of a UR10e
SIZE_3 = JointSize(150.0, 9.839, 1.93, 6.43, 12.2, 7.2)  # B, C: elbow of a UR10e
SIZE_4 = JointSize(330.0, 11.976, 5.95, 16.9, 24.4, 9.8)  # B, C: base, shoulder of a UR10e
WRIST_OF_UR15 = JointSize(70.0, 10.8, 0.85, 4.1, 4.9, 3.4)  # these five: B torque, D the rest
ELBOW_OF_UR15 = JointSize(204.0, 9.8, 2.84, 8.7, 16.6, 9.8)
WRIST_OF_UR20 = JointSize(107.0, 10.8, 1.44, 5.5, 8.0, 4.0)
ELBOW_OF_UR20 = JointSize(433.0, 12.0, 8.4, 22.0, 32.0, 15.0)
BASE_OF_UR20 = JointSize(738.0, 12.0, 16.4, 37.0, 55.0, 24.0)


def drives(*sizes: JointSize) -> dict[str, Any]:
    """Return those fields of `RobotModel` that follow from the sizes of an arm's six joints, base first."""
    return {one.name: six([getattr(size, one.name) for size in sizes]) for one in fields(JointSize)}


# The UR5e. Its own viscous friction: joint self-calibration of a real UR5e, warm, no load
# (INTO-CPS-Association/aurt): base .62 to .82 A at .07, .94 at .5, 1.36 at 1.5, 1.77 at 3.2 rad/s; wrist 2
# likewise (O).
_SIZE_3 = replace(SIZE_3, viscous=5.6, viscous_fast=3.3)
_SIZE_1 = replace(SIZE_1, viscous=1.7, viscous_fast=1.0)

UR5E = RobotModel(
    name="ur5e",
    title="UR5e",
    generation=E_SERIES,
    dh=dh_table(d1=0.1625, a2=-0.425, a3=-0.3922, d4=0.1333, d5=0.0997, d6=0.0996),  # A
    links=(  # A: mass and centre of mass. B: inertia
        Link(3.761, (0.0, -0.02561, 0.00193), (0.0070021, 0.0064809, 0.0065729), (7e-7, -1.05e-5, 4.999e-4)),
        Link(8.058, (0.2125, 0.0, 0.11336), (0.0150589, 0.333881, 0.332472), (-5.4e-5, 5.6e-6, -1.8e-6)),
        Link(2.846, (0.15, 0.0, 0.0265), (0.0039963, 0.0787925, 0.0784851), (-1.37e-5, 0.0013727, -6.6e-6)),
        Link(1.37, (0.0, -0.0018, 0.01634), (0.0016549, 0.0013596, 0.0012628), (-2.8e-6, -4.4e-6, 1.016e-4)),
        Link(1.3, (0.0, 0.0018, 0.01634), (0.0013562, 0.0012783, 9.661e-4), (-2.7e-6, 4.4e-6, -5.05e-5)),
        Link(0.365, (0.0, 0.0, -0.001159), (0.0001869, 0.0001891, 0.0002576)),
    ),
    outline=UR5.outline,
    qd_max=(pi,) * 6,  # B: 180 deg/s
    **drives(_SIZE_3, _SIZE_3, _SIZE_3, _SIZE_1, _SIZE_1, _SIZE_1),
    stop_deceleration=13.0,  # as for the UR5
    servo_inertia=(3, 3.88, 2.73, 0.235, 0.217, 0.212),  # A, B
    payload_max=5.0,  # UR5e data sheet
    reach=0.85,
    has_point_masses=True,  # A calls the tensors of UR3e and UR5e negligible
    robot_type=1,  # client interface sheet, configuration data
    box_type=4,
    home_q=(0.2817, -1.7391, -2.0296, -0.1784, 1.3730, 1.7726),  # (.55, 0, .35)
)


# The UR3e.
_SIZE_2 = replace(SIZE_2, torque_constant=10.827)  # C, of this arm

UR3E = RobotModel(
    name="ur3e",
    title="UR3e",
    generation=E_SERIES,
    dh=dh_table(d1=0.15185, a2=-0.24355, a3=-0.2132, d4=0.13105, d5=0.08535, d6=0.0921),  # A
    links=(  # A: mass and centre of mass. B: inertia
        Link(1.98, (0.0, -0.02, 0.0), (0.0027657, 0.0021501, 0.0025626), (0.0000096, -0.0000149, 0.0001873)),
        Link(3.4445, (0.13, 0.0, 0.1157), (0.0042623, 0.0460284, 0.0448947), (-4.09e-5, -0.001496, -1.29e-5)),
        Link(1.437, (0.05, 0.0, 0.0238), (0.0010511, 0.0113396, 0.0110895), (0.0, -0.0000331, 0.0000022)),
        Link(0.871, (0.0, 0.0, 0.01), (0.0008174, 0.0006844, 0.0005497), (-0.0000005, 0.0000021, 0.0000617)),
        Link(0.805, (0.0, 0.0, 0.01), (6.059e-4, 5.837e-4, 3.831e-4), (-6e-7, -6e-7, -2.71e-5)),
        Link(0.261, (0.0, 0.0, -0.02), (0.000108, 0.0001086, 0.0001371)),
    ),
    outline=UR3.outline,
    qd_max=(pi, pi, pi, 2 * pi, 2 * pi, 2 * pi),  # B: 180 and 360 deg/s
    q_min=UR3.q_min,  # wrist 3 is endless
    q_max=UR3.q_max,
    **drives(_SIZE_2, _SIZE_2, SIZE_1, SIZE_0, SIZE_0, SIZE_0),
    stop_deceleration=20.0,  # as for the UR3
    servo_inertia=(0.852, 0.917, 0.377, 0.0817, 0.0733, 0.0713),  # A, B
    payload_max=3.0,  # UR3e data sheet
    reach=0.5,
    has_point_masses=True,  # C: its own log
    robot_type=3,  # UR client library
    box_type=6,
    home_q=(0.4780, -1.6723, -2.1592, -0.1548, 1.2395, 1.9220),  # (0.35, 0, 0.25)
)


# The UR7e: a UR5e for a greater payload, which says on the wire that it is a UR5e.
# Sources: UR client library (type, first version), data sheet (payload).
UR7E = replace(UR5E, name="ur7e", title="UR7e", payload_max=7.5, first_version="5.22.0")


# The UR10e. Its inertia tensors are also those of A.
UR10E = RobotModel(
    name="ur10e",
    title="UR10e",
    generation=E_SERIES,
    dh=dh_table(d1=0.1807, a2=-0.6127, a3=-0.57155, d4=0.17415, d5=0.11985, d6=0.11655),  # A
    links=(  # A: mass and centre of mass. B: inertia
        Link(7.369, (0.021, 0.0, 0.027), (0.03408, 0.03529, 0.02156), (0.00002, -0.00425, 0.00008)),
        Link(13.051, (0.38, 0.0, 0.158), (0.02814, 0.77068, 0.76943), (0.00005, -0.01561, 0.00002)),
        Link(3.989, (0.24, 0.0, 0.068), (0.01014, 0.30928, 0.30646), (0.00008, 0.00916, 0.0)),
        Link(2.1, (0.0, 0.007, 0.018), (0.00296, 0.00222, 0.00258), (-0.00001, 0.0, -0.00024)),
        Link(1.98, (0.0, 0.007, 0.018), (0.00296, 0.00222, 0.00258), (-0.00001, 0.0, -0.00024)),
        Link(0.615, (0.0, 0.0, -0.026), (0.0004, 0.00041, 0.00034)),
    ),
    outline=replace(UR10.outline, upper_arm=(0.1762, 0.075), forearm=(0.0393, 0.06)),  # G
    qd_max=(2 * pi / 3, 2 * pi / 3, pi, pi, pi, pi),  # B: 120 and 180 deg/s
    **drives(SIZE_4, SIZE_4, SIZE_3, SIZE_2, SIZE_2, SIZE_2),
    stop_deceleration=6.0,  # as for the UR10
    servo_inertia=(8.95, 10.2, 4.26, 0.656, 0.618, 0.61),  # A, B
    payload_max=10.0,  # PolyScope X user manual; labels of newer arms say 12.5
    reach=1.3,
    robot_type=2,  # UR client library
    box_type=5,
    home_q=(0.2859, -1.9532, -2.2524, 0.2579, 1.3701, 1.7757),  # (0.7, 0, 0.25)
)


# The UR12e: likewise a UR10e, with the same sources.
UR12E = replace(UR10E, name="ur12e", title="UR12e", payload_max=12.5, first_version="5.22.0")


# The UR16e. Its masses and centres are those of B, too, turned back into the DH frames.
UR16E = replace(
    UR10E,
    name="ur16e",
    title="UR16e",
    dh=dh_table(d1=0.1807, a2=-0.4784, a3=-0.36, d4=0.17415, d5=0.11985, d6=0.11655),  # A
    links=(  # B: mass, centre of mass and inertia
        Link(7.369, (0.0, -0.016, 0.03), (0.03351, 0.03374, 0.021), (0.00002, -0.00001, 0.00374)),
        Link(10.45, (0.302, 0.0, 0.16), (0.02796, 0.47558, 0.47635), (-0.0001, -0.0072, 0.00003)),
        Link(4.321, (0.194, 0.0, 0.065), (0.01091, 0.1206, 0.11714), (0.00006, 0.01012, 0.00001)),
        Link(2.18, (0.0, -0.009, 0.011), (0.00609, 0.00245, 0.00579), (-0.00001, 0.0, 0.00083)),
        Link(2.033, (0.0, 0.018, 0.012), (0.00389, 0.00219, 0.00363), (-0.00001, 0.0, -0.00045)),
        Link(0.907, (0.0, 0.0, -0.044), (0.00117, 0.00118, 0.00084)),
    ),
    stop_deceleration=8.0,  # assumed: the UR10's, scaled by the reach
    servo_inertia=(7.98, 9.11, 2.96, 0.657, 0.618, 0.611),  # A, B
    payload_max=16.0,  # UR16e data sheet
    reach=0.9,
    robot_type=4,  # UR client library
    box_type=16,
    home_q=(0.3432, -1.8505, -2.0218, -0.0847, 1.3306, 1.8183),  # (0.6, 0, 0.4)
)


# The UR15. Radii of its outline: by the bounding boxes of a UR8 Long's parts (public notes on their STL
# files).
UR15 = RobotModel(
    name="ur15",
    title="UR15",
    generation=E_SERIES,
    dh=dh_table(d1=0.2186, a2=-0.6475, a3=-0.5164, d4=0.1824, d5=0.1361, d6=0.1434),  # E
    links=(  # E: mass, centre of mass and inertia
        Link(
            9.9883, (2.4e-5, -0.033309, 0.025304), (0.051334, 0.047702, 0.034263), (2.5e-5, -1.6e-5, 0.008805)
        ),
        Link(
            14.9255,
            (0.419009, -8.3e-5, 0.192787),
            (0.048202, 1.188499, 1.182771),
            (2.32e-4, -0.032135, -1.7e-5),
        ),
        Link(6.1015, (0.305471, 1.9e-5, 0.070552), (0.018481, 0.303502, 0.296843), (-5e-6, 0.013601, 3e-6)),
        Link(2.089, (2.5e-5, -0.019695, 0.016413), (0.004339, 0.002548, 0.003912), (1.9e-5, 1e-6, 7.06e-4)),
        Link(2.0869, (2.5e-5, 0.01996, 0.015886), (0.004288, 0.002566, 0.003927), (1.7e-5, -3e-6, -7.16e-4)),
        Link(1.0666, (-1.8e-5, -1.12e-4, -0.053397), (0.001406, 0.001404, 0.001002), (-3e-6, 1e-5, -2.4e-5)),
    ),
    outline=Outline(  # G
        base=(0.015, 0.03, 0.1),
        shoulder=(-0.01, 0.11, 0.085),
        upper_arm=(0.218, 0.072),
        forearm=(0.0505, 0.06),
        wrist=(0.055, 0.045),
        flange=(-0.05, -0.046, 0.045),
    ),
    qd_max=(pi, pi, 4 * pi / 3, 5 * pi / 3, 5 * pi / 3, 5 * pi / 3),  # E: 180, 240, 300 deg/s
    **drives(ELBOW_OF_UR20, ELBOW_OF_UR20, ELBOW_OF_UR15, WRIST_OF_UR15, WRIST_OF_UR15, WRIST_OF_UR15),
    stop_deceleration=6.0,  # assumed: as for the UR10, of the same reach
    servo_inertia=(12.1, 14.9, 4.99, 0.915, 0.863, 0.851),  # E
    payload_max=15.0,  # UR15 data sheet
    reach=1.3,
    robot_type=9,  # UR client library
    box_type=15,  # assumed: like the 16 of the UR16e
    home_q=(0.2851, -1.8504, -2.129, 0.0318, 1.3707, 1.7751),  # (0.75, 0, 0.45)
    first_version="5.22.0",  # script of the UR client library that starts the maker's simulator
)


# The UR8 Long. Assumed, no list of its limits is known: drives and speeds of the UR15, whose shoulder and
# wrists it has; base and shoulder turn no faster than a UR20's, of the same reach.
UR8LONG = replace(
    UR15,
    name="ur8long",
    title="UR8 Long",
    dh=dh_table(d1=0.2186, a2=-0.8989, a3=-0.7149, d4=0.1824, d5=0.1361, d6=0.1434),  # E
    links=(  # E: mass, centre of mass and inertia; shoulder and wrists are the UR15's
        UR15.links[0],
        Link(
            17.0738,
            (0.565429, -7.4e-5, 0.19542),
            (0.056709, 2.44012, 2.432744),
            (2.92e-4, -0.054852, -1.4e-5),
        ),
        Link(7.6393, (0.416102, 5.8e-5, 0.065663), (0.022148, 0.633274, 0.625889), (5.2e-5, 0.019779, 3e-6)),
        *UR15.links[3:],
    ),
    qd_max=(2 * pi / 3, 2 * pi / 3, *UR15.qd_max[2:]),
    stop_deceleration=5.0,  # assumed: the UR10's, scaled by the reach
    servo_inertia=(16.6, 24.0, 7.13, 0.916, 0.863, 0.851),  # E
    payload_max=8.0,  # the name; newer lists say 10, with the load below the flange
    reach=1.75,
    robot_type=6,  # UR client library
    box_type=8,  # assumed: like the 16 of the UR16e
    home_q=(0.1935, -1.8987, -1.9484, -0.0894, 1.4345, 1.7084),  # (1.05, 0, 0.6)
    first_version="5.23.0",  # script of the UR client library that starts the maker's simulator
)


# The UR18. B: it has drives and speeds of the UR15.
UR18 = replace(
    UR15,
    name="ur18",
    title="UR18",
    dh=dh_table(d1=0.2186, a2=-0.475, a3=-0.3389, d4=0.1824, d5=0.1361, d6=0.1434),  # E
    links=(  # E: mass, centre of mass and inertia; shoulder and wrists are the UR15's
        UR15.links[0],
        Link(
            14.2009,
            (0.308664, -8.8e-5, 0.190204),
            (0.045094, 0.630805, 0.625724),
            (1.79e-4, -0.024705, -2e-5),
        ),
        Link(5.52, (0.199652, 0.000021, 0.073101), (0.016891, 0.129732, 0.123451), (0.0, 0.009081, 0.000003)),
        *UR15.links[3:],
    ),
    stop_deceleration=8.0,  # assumed: the UR10's, scaled by the reach
    servo_inertia=(10.7, 11.8, 3.81, 0.915, 0.863, 0.851),  # E
    payload_max=18.0,  # UR18 data sheet
    reach=0.95,
    robot_type=5,  # UR client library
    box_type=18,  # assumed: like the 16 of the UR16e
    home_q=(0.3745, -1.8885, -2.1327, 0.0584, 1.3092, 1.8419),  # (0.6, 0, 0.4)
    first_version="5.23.0",  # script of the UR client library that starts the maker's simulator
)


# The UR20. Its inertia tensors are also those of A.
UR20 = RobotModel(
    name="ur20",
    title="UR20",
    generation=E_SERIES,
    dh=dh_table(d1=0.2363, a2=-0.862, a3=-0.7287, d4=0.201, d5=0.1593, d6=0.1543),  # A
    links=(  # A: mass and centre of mass. B: inertia
        Link(16.343, (0.0, -0.061, 0.0062), (0.08866, 0.07632, 0.08418), (-0.00011, -0.00011, 0.0072)),
        Link(29.632, (0.5226, 0.0, 0.2098), (0.1467, 4.6659, 4.6348), (0.00019, -0.05163, 0.00004)),
        Link(7.879, (0.3234, 0.0, 0.0604), (0.02612, 0.75763, 0.75327), (-0.00005, -0.02898, -0.00001)),
        Link(3.054, (0.0, -0.0026, 0.0393), (0.00555, 0.00537, 0.00402), (-0.00001, -0.00002, 0.00036)),
        Link(3.126, (0.0, 0.0024, 0.0379), (0.00586, 0.00578, 0.00427), (-0.00001, -0.00002, -0.00037)),
        Link(0.846, (0.0, -0.0003, -0.0318), (0.00092, 0.00091, 0.00117)),
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
    **drives(BASE_OF_UR20, BASE_OF_UR20, ELBOW_OF_UR20, WRIST_OF_UR20, WRIST_OF_UR20, WRIST_OF_UR20),
    stop_deceleration=5.0,  # assumed: the UR10's, scaled by the reach
    servo_inertia=(27.6, 37.2, 14.7, 1.57, 1.46, 1.44),  # A, B
    payload_max=20.0,  # UR20 data sheet
    reach=1.75,
    robot_type=7,  # UR client library
    box_type=20,  # assumed: like the 16 of the UR16e
    home_q=(0.2153, -1.8582, -1.9758, -0.1047, 1.4192, 1.7242),  # (1.05, 0, 0.6)
    first_version="5.14.0",
)


# The UR30. Its masses and centres are those of B, turned back into the DH frames. The tensors there are a
# copy of another arm's and not used. Assumed: those of the UR20; of the arm's tubes scaled by mass and
# length, of wrist 3 by mass.
UR30 = replace(
    UR20,
    name="ur30",
    title="UR30",
    dh=dh_table(d1=0.2363, a2=-0.637, a3=-0.5037, d4=0.201, d5=0.1593, d6=0.1543),  # A
    links=(  # B: mass, centre of mass; inertia assumed
        Link(16.343, (-0.0001, -0.06, 0.0069), (0.08866, 0.07632, 0.08418), (-0.00011, -0.00011, 0.0072)),
        Link(28.542, (0.3894, 0.0, 0.2103), (0.1413, 2.4543, 2.4379), (0.00014, -0.03675, 0.00003)),
        Link(7.156, (0.2257, 0.0, 0.0629), (0.02372, 0.3288, 0.3269), (-0.00003, -0.01819, -0.00001)),
        Link(3.054, (0.0, -0.0048, 0.0353), (0.00555, 0.00537, 0.00402), (-0.00001, -0.00002, 0.00036)),
        Link(3.126, (0.0, 0.0046, 0.0341), (0.00586, 0.00578, 0.00427), (-0.00001, -0.00002, -0.00037)),
        Link(0.926, (0.0, 0.0, -0.0293), (0.00101, 0.001, 0.00128)),
    ),
    stop_deceleration=6.0,  # assumed: as for the UR10, of the same reach
    servo_inertia=(21.9, 26.2, 11.4, 1.57, 1.46, 1.44),  # A, B
    payload_max=30.0,  # UR30 data sheet
    reach=1.3,
    robot_type=8,  # UR client library
    box_type=30,  # assumed: like the 16 of the UR16e
    home_q=(0.3190, -1.7911, -2.1424, -0.0193, 1.3472, 1.8002),  # (0.75, 0, 0.5)
    first_version="5.15.0",
)

# The first runs the software of the generation where no arm is named.
ARMS = (UR5E, UR3E, UR7E, UR10E, UR12E, UR16E, UR8LONG, UR15, UR18, UR20, UR30)
