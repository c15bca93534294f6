"""The UR3 of the CB3 generation, in numbers.

Sources, cited by letter below:
 A  Universal Robots article "DH parameters for calculations of kinematics and dynamics" (UR3 table).
 B  UniversalRobots/Universal_Robots_ROS2_Description, config/ur3/physical_parameters.yaml: cylinder
    estimates, because the vendor publishes no inertia tensors for the UR3 and calls its sisters' negligible.
 C  UR3/CB3 user manual 3.13 and "max joint torques" article, as collected in joint_limits.yaml beside B.
 D  Least-squares fit of a current model to a logged move of a real UR3e (kevinhpham/DalESelfEBot); R² .995.
    All such figures are good to about 30 %; size 0 joints could not be separated and assume 3 Nm/A.
 E  UR3/CB3 user manual 3.10, stopping times and distances of category 0 (183 deg/s, arm stretched, 3 kg).
 F  UR5 friction set in kejianhong/UR5-External-Force-Estimation: friction falls towards standstill.
 G  Rough outline (tube and housing radii), assumed; only collisions depend on it.
 H  Safety blocks of six real installations (3.5, 3.13, 3.15.8, 5.11).
"""

from __future__ import annotations

from math import pi

from ur_emulator.models.cb3 import CB3
from ur_emulator.models.joint_ranges import FIRST_TURN, LAST_TURN, RANGE_END
from ur_emulator.models.robot_model import Link, Outline, RobotModel, dh_table

UR3 = RobotModel(
    name="ur3",
    title="UR3",
    generation=CB3,
    # A. The vendor's "a" and "d" in metres.
    dh=dh_table(d1=0.1519, a2=-0.24365, a3=-0.21325, d4=0.11235, d5=0.08535, d6=0.0819),
    # A: mass and centre of mass. B: inertia, cylinder axis turned along the link in the DH frame.
    links=(
        Link(  # shoulder: the cylinder stands along y of its frame
            mass=2.0,
            com=(0.0, -0.02, 0.0),
            inertia=(0.008093, 0.005625, 0.008093),
        ),
        Link(  # upper arm: from the elbow (origin) back to the shoulder along +x
            mass=3.42,
            com=(0.13, 0.0, 0.1157),
            inertia=(0.009619, 0.021728, 0.021728),
        ),
        Link(  # forearm: from wrist 1 (origin) back to the elbow along +x
            mass=1.26,
            com=(0.05, 0.0, 0.0238),
            inertia=(0.003544, 0.006547, 0.006547),
        ),
        Link(  # wrist 1: from the forearm along +y to the axis of wrist 2
            mass=0.8,
            com=(0.0, 0.0, 0.01),
            inertia=(0.001611, 0.00225, 0.001611),
        ),
        Link(  # wrist 2: from wrist 1 along -y to the axis of wrist 3
            mass=0.8,
            com=(0.0, 0.0, 0.01),
            inertia=(0.001572, 0.00225, 0.001572),
        ),
        Link(  # wrist 3 with the tool flange at the origin, facing +z
            mass=0.35,
            com=(0.0, 0.0, -0.02),
            inertia=(0.000136, 0.000136, 0.000179),
        ),
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
    q_min=(*(-RANGE_END,) * 5, FIRST_TURN),  # H: wrist 3 has no position limit
    q_max=(*(RANGE_END,) * 5, LAST_TURN),
    armature=(0.45, 0.45, 0.20, 0.08, 0.08, 0.08),  # D
    viscous=(5.0, 5.0, 2.0, 0.9, 0.9, 0.9),  # D
    coulomb=(4.5, 4.2, 1.7, 0.6, 0.6, 0.6),  # D
    coulomb_standstill=0.33,  # F: a sixth to a third of the full value at rest
    coulomb_speed=0.08,  # F: full value reached within .05-.15 rad/s
    torque_constant=(
        11.7,
        12.3,
        9.0,
        3.0,
        3.0,
        3.0,
    ),  # D; elbow: moving fit 6.4, static 9-11
    stop_deceleration=20.0,  # E: base, 183 deg/s in 159 ms; shoulder and elbow stop no slower
    servo_frequency=12.0,  # assumed: a position loop of 10-30 Hz fits the delays that drivers report
    servo_damping=0.9,
    # Joint-space inertia diagonal at a work pose by A and B plus the armature.
    servo_inertia=(0.88, 0.95, 0.39, 0.095, 0.083, 0.08),
    payload_max=3.0,  # UR3 data sheet
    reach=0.5,
    robot_type=3,  # client interface sheet, configuration data
    box_type=6,
    # Elbow-up branch over the middle of the recommended work box, flange at about (.35, 0, .25) m.
    home_q=(0.3944, -1.7645, -2.0996, -0.1030, 1.2950, 1.8570),
)
