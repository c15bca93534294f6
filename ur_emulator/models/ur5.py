"""The UR5 of the CB3 generation, in numbers.

Sources, cited by letter below:
 A  Universal Robots article "DH parameters for calculations of kinematics and dynamics" (UR5 table); the DH
    rows are those of "serie 3" in the CB3 manual's appendix.
 B  UniversalRobots/Universal_Robots_ROS2_Description, config/ur5/physical_parameters.yaml: cylinder
    estimates, and where the links lie along the joint axes.
 C  UR5/CB3 user manual 3.13 and "max joint torques" article, as collected in joint_limits.yaml beside B.
 D  kejianhong/UR5-External-Force-Estimation, UR5SimulationModel.cpp: friction set of a real UR5.
 E  UR5/CB3 user manual 3.4.5, stopping times of category 0 (183 deg/s, arm stretched, 5 kg).
 F  A printed state packet of a UR arm before 3.0: target torque per target current of large and small joints.
 G  Rough outline (tube and housing radii), assumed; only collisions depend on it.
 H  Assumed: rotor inertia for the joint sizes (3 for base, shoulder, elbow; 1 for the wrists), where the fit
    behind `ur3.py` gives .20 kg m² for size 1 and grows with the rated torque: .0075 kg m² per Nm.
"""

from __future__ import annotations

from math import pi

from ur_emulator.models.cb3 import CB3
from ur_emulator.models.joint_ranges import RANGE_END
from ur_emulator.models.robot_model import Link, Outline, RobotModel, dh_table

UR5 = RobotModel(
    name="ur5",
    title="UR5",
    generation=CB3,
    # A. The vendor's "a" and "d" in metres.
    dh=dh_table(d1=0.089159, a2=-0.425, a3=-0.39225, d4=0.10915, d5=0.09465, d6=0.0823),
    # A: mass and centre of mass. B: inertia, cylinder axis turned along the link in the DH frame.
    links=(
        Link(  # shoulder: the cylinder stands along y of its frame
            mass=3.7,
            com=(0.0, -0.02561, 0.00193),
            inertia=(0.014972, 0.010406, 0.014972),
        ),
        Link(  # upper arm: from the elbow (origin) back to the shoulder along +x
            mass=8.393,
            com=(0.2125, 0.0, 0.11336),
            inertia=(0.015107, 0.133886, 0.133886),
        ),
        Link(  # forearm: from wrist 1 (origin) back to the elbow along +x
            mass=2.33,
            com=(0.15, 0.0, 0.0265),
            inertia=(0.004095, 0.031217, 0.031217),
        ),
        Link(  # wrist 1: from the forearm along +y to the axis of wrist 2
            mass=1.219,
            com=(0.0, -0.0018, 0.01634),
            inertia=(0.002014, 0.002194, 0.002014),
        ),
        Link(  # wrist 2: from wrist 1 along -y to the axis of wrist 3
            mass=1.219,
            com=(0.0, 0.0018, 0.01634),
            inertia=(0.001831, 0.002194, 0.001831),
        ),
        Link(  # wrist 3 with the tool flange at the origin, facing +z
            mass=0.1879,
            com=(0.0, 0.0, -0.001159),
            inertia=(0.0000806, 0.0000806, 0.0001321),
        ),
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
    q_min=(-RANGE_END,) * 6,  # safety blocks of real installations
    q_max=(RANGE_END,) * 6,
    armature=(1.1, 1.1, 1.1, 0.20, 0.20, 0.20),  # H
    viscous=(6.24, 4.81, 7.65, 1.05, 1.59, 1.11),  # D
    coulomb=(7.23, 8.55, 8.47, 2.10, 2.02, 2.33),  # D
    coulomb_standstill=0.33,  # D: a sixth to a third of the full value at rest
    coulomb_speed=0.08,  # D: full value reached within .05-.15 rad/s
    torque_constant=(12.8, 12.8, 12.8, 9.95, 9.95, 9.95),  # F
    stop_deceleration=13.0,  # E: base, 183 deg/s in 244 ms
    servo_frequency=12.0,  # assumed, as for the UR3
    servo_damping=0.9,
    # Joint-space inertia diagonal at `home_q` by A and B plus the armature.
    servo_inertia=(2.05, 2.84, 1.76, 0.218, 0.204, 0.200),
    payload_max=5.0,  # UR5 data sheet
    reach=0.85,
    robot_type=1,  # client interface sheet, configuration data
    box_type=4,
    # Elbow up, tool forward and 45 degrees down, flange at about (.55, 0, .35) m.
    home_q=(0.2238, -1.7062, -1.8784, -0.3550, 1.4132, 1.7304),
)
