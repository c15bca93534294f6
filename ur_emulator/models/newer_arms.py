"""The newer arms with the software of the e-Series, in numbers, as in `cb3_arms`."""

from __future__ import annotations

from dataclasses import replace
from math import pi

from ur_emulator.models.generations import E_SERIES
from ur_emulator.models.joint_sizes import (
    BASE_OF_UR20,
    ELBOW_OF_UR15,
    ELBOW_OF_UR20,
    WRIST_OF_UR15,
    WRIST_OF_UR20,
    drives,
)
from ur_emulator.models.robot_model import RANGE_END, Link, Outline, RobotModel, dh_table

# The UR15. Sources:
# A  ros-industrial/universal_robot, ur_description/config/ur15/default_kinematics.yaml: the controller's own
#    table, with its hash.
# B  physical_parameters.yaml beside it: masses, centres and tensors, turned back into the DH frames; the
#    offsets of the links, from which the outline follows.
# C  Drives: torques and speeds of joint_limits.yaml there; the rest assumed, see `joint_sizes.py`.
# G  Rough outline: radii by the bounding boxes of a UR8 Long's parts (public notes on their STL files); only
#    collisions depend on it.
UR15 = RobotModel(
    name="ur15",
    title="UR15",
    generation=E_SERIES,
    # A. The vendor's "a" and "d" in metres.
    dh=dh_table(d1=0.2186, a2=-0.6475, a3=-0.5164, d4=0.1824, d5=0.1361, d6=0.1434),
    # B: mass, centre of mass and inertia.
    links=(
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


# The UR8 Long. Sources:
# A  ros-industrial/universal_robot, ur_description/config/ur8long/default_kinematics.yaml: the controller's
#    own table, with its hash.
# B  physical_parameters.yaml beside it, as for the UR15.
# C  Assumed, no list of its limits is known: drives and speeds of the UR15, whose shoulder and wrists it has;
#    base and shoulder turn no faster than a UR20's, of the same reach.
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
        Link(
            17.0738,
            (0.565429, -7.4e-5, 0.19542),
            (0.056709, 2.44012, 2.432744),
            (2.92e-4, -0.054852, -1.4e-5),
        ),
        Link(7.6393, (0.416102, 5.8e-5, 0.065663), (0.022148, 0.633274, 0.625889), (5.2e-5, 0.019779, 3e-6)),
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


# The UR18. Sources:
# A  ros-industrial/universal_robot, ur_description/config/ur18/default_kinematics.yaml: the controller's own
#    table, with its hash.
# B  physical_parameters.yaml beside it, as for the UR15.
# C  Drives and speeds of the UR15: Universal_Robots_ROS2_Description, config/ur18/joint_limits.yaml.
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
        Link(
            14.2009,
            (0.308664, -8.8e-5, 0.190204),
            (0.045094, 0.630805, 0.625724),
            (1.79e-4, -0.024705, -2e-5),
        ),
        Link(5.52, (0.199652, 0.000021, 0.073101), (0.016891, 0.129732, 0.123451), (0.0, 0.009081, 0.000003)),
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


# The UR20. Sources:
# A  Universal Robots article "DH parameters for calculations of kinematics and dynamics" (UR20 table).
# B  The same article and UniversalRobots/Universal_Robots_ROS2_Description, config/ur20: inertia tensors.
# C  Drives: assumed, see `joint_sizes.py`.
# G  Rough outline (tube and housing radii), assumed; only collisions depend on it.
UR20 = RobotModel(
    name="ur20",
    title="UR20",
    generation=E_SERIES,
    # A. The vendor's "a" and "d" in metres.
    dh=dh_table(d1=0.2363, a2=-0.862, a3=-0.7287, d4=0.201, d5=0.1593, d6=0.1543),
    # A: mass and centre of mass. B: inertia.
    links=(
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


# The UR30. Sources:
# A  Universal Robots article "DH parameters for calculations of kinematics and dynamics" (UR30 table).
# B  UniversalRobots/Universal_Robots_ROS2_Description, config/ur30: masses and centres, turned back into the
#    DH frames. Its tensors are a copy of another arm's and not used.
# D  Assumed: the tensors of the UR20; those of the arm's tubes scaled by mass and length, of wrist 3 by mass.
# C  Drives: assumed, see `joint_sizes.py`.
UR30 = replace(
    UR20,
    name="ur30",
    title="UR30",
    # A. The vendor's "a" and "d" in metres.
    dh=dh_table(d1=0.2363, a2=-0.637, a3=-0.5037, d4=0.201, d5=0.1593, d6=0.1543),
    # B: mass, centre of mass. D: inertia.
    links=(
        Link(16.343, (-0.0001, -0.06, 0.0069), (0.08866, 0.07632, 0.08418), (-0.00011, -0.00011, 0.0072)),
        Link(28.542, (0.3894, 0.0, 0.2103), (0.1413, 2.4543, 2.4379), (0.00014, -0.03675, 0.00003)),
        Link(7.156, (0.2257, 0.0, 0.0629), (0.02372, 0.3288, 0.3269), (-0.00003, -0.01819, -0.00001)),
        Link(3.054, (0.0, -0.0048, 0.0353), (0.00555, 0.00537, 0.00402), (-0.00001, -0.00002, 0.00036)),
        Link(3.126, (0.0, 0.0046, 0.0341), (0.00586, 0.00578, 0.00427), (-0.00001, -0.00002, -0.00037)),
        Link(0.926, (0.0, 0.0, -0.0293), (0.00101, 0.001, 0.00128)),
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
