"""The arms of the CB3 generation, in numbers: sources stand above each arm and are cited by letter.

Links are rows of mass, centre of mass, inertia and products of inertia, see `Link`, in the order shoulder
(its housing stands along y of its frame), upper arm (from the elbow, its origin, back to the shoulder along
+x), forearm (from wrist 1 back to the elbow along +x), wrist 1 (from the forearm along +y to the axis of
wrist 2), wrist 2 (from wrist 1 along -y to the axis of wrist 3), wrist 3 (the tool flange at the origin,
facing +z). `home_q`: elbow up, tool forward and 45 degrees down (a UR3: over the middle of the recommended
work box); beside it, about where the flange is then [m].

Sources of all three, cited by letter:
 A  Universal Robots article "DH parameters for calculations of kinematics and dynamics", table of the arm.
 C  User manual 3.13 of the arm (CB3) and "max joint torques" article, as collected in joint_limits.yaml of
    UniversalRobots/Universal_Robots_ROS2_Description, config/ of the arm.
 G  Rough outline (tube and housing radii), assumed; only collisions depend on it.
"""

from math import pi

from ur_emulator.machine.models.generations import CB3
from ur_emulator.machine.models.robot_model import RANGE_END, Link, Outline, RobotModel, dh_table

# Ends where the installation sets no position limit: the least and the greatest number of revolutions [rad].
_FIRST_TURN, _LAST_TURN = -(2**31) * 2.0 * pi, (2**31 - 1) * 2.0 * pi


# The UR3 of the CB3 generation. Its own sources:
# B  physical_parameters.yaml beside C: cylinder estimates, because the vendor publishes no inertia tensors
#    for the UR3 and calls its sisters' negligible.
# D  Record files of a real UR3, 125 Hz (mkrssg/UniversalRobots, 2019): fits of the controller's own drive
#    model, `target_current` against `target_moment` and `target_qd`, residual below .005 A; rotors from
#    `target_moment`. Inferred: the slopes beyond the kink of shoulder, wrists 1 and 3, which no move reaches:
#    as much smaller as the base's. The arm itself: base and wrist 2 need .54 and .36 A at .8 and .88 rad/s,
#    the model says .50 and .40.
# E  UR3/CB3 user manual 3.10, stopping times and distances of category 0 (183 deg/s, arm stretched, 3 kg).
# H  Safety blocks of six real installations (3.5, 3.13, 3.15.8, 5.11).
UR3 = RobotModel(
    name="ur3",
    title="UR3",
    generation=CB3,
    dh=dh_table(d1=0.1519, a2=-0.24365, a3=-0.21325, d4=0.11235, d5=0.08535, d6=0.0819),  # A
    links=(  # A: mass and centre of mass. B: inertia, cylinder axis turned along the link in the DH frame
        Link(2.0, (0.0, -0.02, 0.0), (0.008093, 0.005625, 0.008093)),
        Link(3.42, (0.13, 0.0, 0.1157), (0.009619, 0.021728, 0.021728)),
        Link(1.26, (0.05, 0.0, 0.0238), (0.003544, 0.006547, 0.006547)),
        Link(0.8, (0.0, 0.0, 0.01), (0.001611, 0.00225, 0.001611)),
        Link(0.8, (0.0, 0.0, 0.01), (0.001572, 0.00225, 0.001572)),
        Link(0.35, (0.0, 0.0, -0.02), (0.000136, 0.000136, 0.000179)),
    ),
    outline=Outline(  # G
        base=(0.06, 0.075, 0.06),
        shoulder=(-0.01, 0.04, 0.055),
        upper_arm=(0.12, 0.048),
        forearm=(0.0275, 0.038),
        wrist=(0.04, 0.034),
        flange=(-0.036, -0.032, 0.032),
    ),
    tau_max=(56.0, 56.0, 28.0, 12.0, 12.0, 12.0),  # C
    qd_max=(pi, pi, pi, 2 * pi, 2 * pi, 2 * pi),  # C: 180 and 360 deg/s
    q_min=(*(-RANGE_END,) * 5, _FIRST_TURN),  # H: wrist 3 has no position limit
    q_max=(*(RANGE_END,) * 5, _LAST_TURN),
    armature=(0.6121, 0.6121, 0.2118, 0.0714, 0.0714, 0.0714),  # D
    viscous=(4.5, 5.1, 3.3, 0.5, 1.3, 0.8),  # D
    viscous_fast=(2.4, 2.7, 1.9, 0.3, 0.7, 0.4),  # D
    coulomb=(2.7, 2.7, 1.4, 0.7, 0.7, 0.9),  # D
    torque_constant=(11.48, 11.51, 8.44, 4.13, 3.9, 4.2),  # D
    stop_deceleration=20.0,  # E: base, 183 deg/s in 159 ms; shoulder and elbow stop no slower
    servo_inertia=(0.879, 0.909, 0.371, 0.0851, 0.0752, 0.0716),  # A, B
    payload_max=3.0,  # UR3 data sheet
    reach=0.5,
    has_point_masses=True,  # D
    robot_type=3,  # client interface sheet, configuration data
    box_type=6,
    home_q=(0.3944, -1.7645, -2.0996, -0.1030, 1.2950, 1.8570),  # (.35, 0, .25)
)


# The UR5 of the CB3 generation; its DH rows are those of "serie 3" in the CB3 manual's appendix. Its own
# sources:
# B  physical_parameters.yaml beside C: cylinder estimates, and where the links lie along the joint axes.
# D  A public script that fits runs at constant speed of a real UR5's base, .02 to .2 rad/s: 8.7 to 9.1 Nm and
#    30 to 32.5 Nm s/rad, 13.6 Nm/A (O). Inferred: the same for shoulder and elbow, which have the same size;
#    beyond the kink the share of the UR3's.
# E  UR5/CB3 user manual 3.4.5, stopping times of category 0 (183 deg/s, arm stretched, 5 kg).
# F  Static currents of a real UR5 against gravity: 7.5 to 7.9 Nm/A of the wrists (O).
# H  Inferred from the joint sizes (3 for base, shoulder, elbow; 1 for the wrists): rotors as in the e-Series,
#    which the UR3's equal; the wrists' friction is that of the UR3's elbow.
UR5 = RobotModel(
    name="ur5",
    title="UR5",
    generation=CB3,
    dh=dh_table(d1=0.089159, a2=-0.425, a3=-0.39225, d4=0.10915, d5=0.09465, d6=0.0823),  # A
    links=(  # A: mass and centre of mass. B: inertia, cylinder axis turned along the link in the DH frame
        Link(3.7, (0.0, -0.02561, 0.00193), (0.014972, 0.010406, 0.014972)),
        Link(8.393, (0.2125, 0.0, 0.11336), (0.015107, 0.133886, 0.133886)),
        Link(2.33, (0.15, 0.0, 0.0265), (0.004095, 0.031217, 0.031217)),
        Link(1.219, (0.0, -0.0018, 0.01634), (0.002014, 0.002194, 0.002014)),
        Link(1.219, (0.0, 0.0018, 0.01634), (0.001831, 0.002194, 0.001831)),
        Link(0.1879, (0.0, 0.0, -0.001159), (0.0000806, 0.0000806, 0.0001321)),
    ),
    outline=Outline(  # G
        base=(0.0, 0.01, 0.075),
        shoulder=(-0.01, 0.05, 0.065),
        upper_arm=(0.136, 0.06),
        forearm=(0.0165, 0.048),
        wrist=(0.04, 0.04),
        flange=(-0.044, -0.04, 0.038),
    ),
    tau_max=(150.0, 150.0, 150.0, 28.0, 28.0, 28.0),  # C
    qd_max=(pi,) * 6,  # C: 180 deg/s
    armature=(1.93, 1.93, 1.93, 0.2118, 0.2118, 0.2118),  # H
    viscous=(31.0, 31.0, 31.0, 3.3, 3.3, 3.3),  # D, H
    viscous_fast=(16.5, 16.5, 16.5, 1.9, 1.9, 1.9),  # D, H
    coulomb=(8.9, 8.9, 8.9, 1.4, 1.4, 1.4),  # D, H
    torque_constant=(13.6, 13.6, 13.6, 7.7, 7.7, 7.7),  # D, F
    stop_deceleration=13.0,  # E: base, 183 deg/s in 244 ms
    servo_inertia=(2.88, 3.67, 2.59, 0.23, 0.216, 0.212),  # A, B
    payload_max=5.0,  # UR5 data sheet
    reach=0.85,
    has_point_masses=True,  # inferred, as the UR3 and the UR5e
    robot_type=1,  # client interface sheet, configuration data
    box_type=4,
    home_q=(0.2238, -1.7062, -1.8784, -0.3550, 1.4132, 1.7304),  # (.55, 0, .35)
)


# The UR10 of the CB3 generation. Its own sources:
# B  physical_parameters.yaml beside C: tensors that the vendor took from its own simulator (here without
#    their small products of inertia), and where the links lie along the joint axes.
# D  Currents of a real UR10 at .2, .5 and 1 rad/s: base .87 1.53 2.11, wrist 2 .28 .35 .46 A (O). Inferred:
#    the same for the other joints of the size.
# F  Drive gains identified on a real UR10 (unisa-acg/inverse-dynamics-solver) (O).
# H  Inferred from the joint sizes (4 for base and shoulder, 3 for the elbow, 2 for the wrists): rotors as in
#    the e-Series, which the UR3's equal; the elbow's friction is that of the UR5.
UR10 = RobotModel(
    name="ur10",
    title="UR10",
    generation=CB3,
    dh=dh_table(d1=0.1273, a2=-0.612, a3=-0.5723, d4=0.163941, d5=0.1157, d6=0.0922),  # A
    links=(  # A: mass and centre of mass. B: inertia
        Link(7.1, (0.021, 0.0, 0.027), (0.03408, 0.03529, 0.02156)),
        Link(12.7, (0.38, 0.0, 0.158), (0.02814, 0.77068, 0.76943)),
        Link(4.27, (0.24, 0.0, 0.068), (0.01014, 0.30928, 0.30646)),
        Link(2.0, (0.0, 0.007, 0.018), (0.00296, 0.00222, 0.00258)),
        Link(2.0, (0.0, 0.007, 0.018), (0.00296, 0.00222, 0.00258)),
        Link(0.365, (0.0, 0.0, -0.026), (0.0004, 0.00041, 0.00034)),
    ),
    outline=Outline(  # G
        base=(0.01, 0.03, 0.095),
        shoulder=(-0.01, 0.09, 0.085),
        upper_arm=(0.2, 0.075),
        forearm=(0.049, 0.06),
        wrist=(0.05, 0.048),
        flange=(-0.05, -0.046, 0.045),
    ),
    tau_max=(330.0, 330.0, 150.0, 56.0, 56.0, 56.0),  # C
    qd_max=(2 * pi / 3, 2 * pi / 3, pi, pi, pi, pi),  # C: 120 and 180 deg/s
    armature=(5.95, 5.95, 1.93, 0.61, 0.61, 0.61),  # H
    viscous=(30.0, 30.0, 31.0, 2.75, 2.75, 2.75),  # D, H
    viscous_fast=(15.7, 15.7, 16.5, 2.6, 2.6, 2.6),  # D, H
    coulomb=(5.8, 5.8, 8.9, 2.75, 2.75, 2.75),  # D, H
    torque_constant=(13.58, 14.3, 11.37, 11.24, 11.77, 11.77),  # F
    stop_deceleration=6.0,  # assumed: the UR5's scaled by reach and load; its manual's table was not at hand
    servo_inertia=(9.67, 11.9, 4.33, 0.647, 0.615, 0.61),  # A, B
    payload_max=10.0,  # UR10 data sheet
    reach=1.3,
    robot_type=2,  # client interface sheet, configuration data
    box_type=5,
    home_q=(0.2250, -1.8005, -1.8700, -0.2692, 1.4124, 1.7312),  # (.8, 0, .45)
)

# The first runs the software of the generation where no arm is named.
ARMS = (UR3, UR5, UR10)
