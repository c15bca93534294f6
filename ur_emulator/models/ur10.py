"""The UR10 of the CB3 generation, in numbers.

Sources, cited by letter below:
 A  Universal Robots article "DH parameters for calculations of kinematics and dynamics" (UR10 table).
 B  UniversalRobots/Universal_Robots_ROS2_Description, config/ur10/physical_parameters.yaml: tensors that the
    vendor took from its own simulator (here without their small products of inertia), and where the links
    lie along the joint axes.
 C  UR10/CB3 user manual 3.13 and "max joint torques" article, as collected in joint_limits.yaml beside B.
 F  A printed state packet of a UR arm before 3.0: target torque per target current of large joints. The value
    for size 2 (wrists) is that of `ur3.py`.
 G  Rough outline (tube and housing radii), assumed; only collisions depend on it.
 H  Assumed: rotor inertia and friction for the joint sizes (4 for base and shoulder, 3 for the elbow, 2 for
    the wrists). Sizes 2 and 3 as in `ur3.py` and `ur5.py`; size 4 by its rated torque.
"""

from __future__ import annotations

from math import pi

from ur_emulator.models.cb3 import CB3
from ur_emulator.models.joint_ranges import RANGE_END
from ur_emulator.models.robot_model import Link, Outline, RobotModel, dh_table

UR10 = RobotModel(
    name="ur10",
    title="UR10",
    generation=CB3,
    # A. The vendor's "a" and "d" in metres.
    dh=dh_table(d1=0.1273, a2=-0.612, a3=-0.5723, d4=0.163941, d5=0.1157, d6=0.0922),
    # A: mass and centre of mass. B: inertia.
    links=(
        Link(  # shoulder: the housing stands along y of its frame
            mass=7.1,
            com=(0.021, 0.0, 0.027),
            inertia=(0.03408, 0.03529, 0.02156),
        ),
        Link(  # upper arm: from the elbow (origin) back to the shoulder along +x
            mass=12.7,
            com=(0.38, 0.0, 0.158),
            inertia=(0.02814, 0.77068, 0.76943),
        ),
        Link(  # forearm: from wrist 1 (origin) back to the elbow along +x
            mass=4.27,
            com=(0.24, 0.0, 0.068),
            inertia=(0.01014, 0.30928, 0.30646),
        ),
        Link(  # wrist 1: from the forearm along +y to the axis of wrist 2
            mass=2.0,
            com=(0.0, 0.007, 0.018),
            inertia=(0.00296, 0.00222, 0.00258),
        ),
        Link(  # wrist 2: from wrist 1 along -y to the axis of wrist 3
            mass=2.0,
            com=(0.0, 0.007, 0.018),
            inertia=(0.00296, 0.00222, 0.00258),
        ),
        Link(  # wrist 3 with the tool flange at the origin, facing +z
            mass=0.365,
            com=(0.0, 0.0, -0.026),
            inertia=(0.0004, 0.00041, 0.00034),
        ),
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
    q_min=(-RANGE_END,) * 6,  # safety blocks of real installations
    q_max=(RANGE_END,) * 6,
    armature=(2.5, 2.5, 1.1, 0.45, 0.45, 0.45),  # H
    viscous=(12.0, 12.0, 7.6, 5.0, 5.0, 5.0),  # H
    coulomb=(16.0, 16.0, 8.5, 4.3, 4.3, 4.3),  # H
    coulomb_standstill=0.33,  # as for the UR5
    coulomb_speed=0.08,
    torque_constant=(12.8, 12.8, 12.8, 12.0, 12.0, 12.0),  # F
    stop_deceleration=6.0,  # assumed: the UR5's scaled by reach and load; its manual's table was not at hand
    servo_frequency=12.0,  # assumed, as for the UR3
    servo_damping=0.9,
    # Joint-space inertia diagonal at `home_q` by A and B plus the armature.
    servo_inertia=(6.2, 8.4, 3.5, 0.487, 0.455, 0.450),
    payload_max=10.0,  # UR10 data sheet
    reach=1.3,
    robot_type=2,  # client interface sheet, configuration data
    box_type=5,
    # Elbow up, tool forward and 45 degrees down, flange at about (.8, 0, .45) m.
    home_q=(0.2250, -1.8005, -1.8700, -0.2692, 1.4124, 1.7312),
)
