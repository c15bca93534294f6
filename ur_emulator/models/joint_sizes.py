"""JointSize: e-Series arms are built from joints of a few sizes; what all joints of a size have in common.

Sources, cited by letter below:
 A  Fits of the controller's own drive model to logs of a real UR10e (dynamic_calibration of S. Mamedov) and a
    real UR3e (dsn-2022-rad-artifact): target torque against target current. Size 2 is in both and agrees
    within 1 %.
 B  UniversalRobots/Universal_Robots_ROS2_Description, config/*/joint_limits.yaml.
 C  Assumed for the joints of the UR8 Long, UR15, UR18, UR20 and UR30, of which no log is known: the other
    sizes extrapolated by the rated torque. Rotor inertia grows with its power of 1.26; friction is
    proportional to it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypedDict

from ur_emulator.models.robot_model import Vector6, six


@dataclass(frozen=True, slots=True)
class JointSize:
    """One size.

    Attributes:
        tau_max: largest torque [Nm].
        torque_constant: joint torque per motor current, gear included [Nm/A].
        armature: rotor and gear inertia as felt at the joint [kg m²].
        coulomb: Coulomb friction [Nm].
        viscous: viscous friction up to the kink at 0.5 rad/s [Nm s/rad].
        viscous_fast: its slope beyond the kink [Nm s/rad].
    """

    tau_max: float
    torque_constant: float
    armature: float
    coulomb: float
    viscous: float
    viscous_fast: float


# A, B: wrists of a UR3e.
SIZE_0 = JointSize(
    tau_max=9.0, torque_constant=3.600, armature=0.0712, coulomb=0.69, viscous=0.61, viscous_fast=0.63
)
# A, B: elbow of a UR3e.
SIZE_1 = JointSize(
    tau_max=28.0, torque_constant=7.571, armature=0.2118, coulomb=1.52, viscous=2.08, viscous_fast=1.26
)
# A, B: wrists of a UR10e; base and shoulder of a UR3e have nearly the same numbers.
SIZE_2 = JointSize(
    tau_max=54.0, torque_constant=10.763, armature=0.61, coulomb=3.15, viscous=3.8, viscous_fast=2.6
)
# A, B: elbow of a UR10e.
SIZE_3 = JointSize(
    tau_max=150.0, torque_constant=9.839, armature=1.93, coulomb=6.43, viscous=12.2, viscous_fast=7.2
)
# A, B: base and shoulder of a UR10e.
SIZE_4 = JointSize(
    tau_max=330.0, torque_constant=11.976, armature=5.95, coulomb=16.9, viscous=24.4, viscous_fast=9.8
)

# B: torque. C: the rest.
WRIST_OF_UR15 = JointSize(
    tau_max=70.0, torque_constant=10.8, armature=0.85, coulomb=4.1, viscous=4.9, viscous_fast=3.4
)
ELBOW_OF_UR15 = JointSize(
    tau_max=204.0, torque_constant=9.8, armature=2.84, coulomb=8.7, viscous=16.6, viscous_fast=9.8
)
WRIST_OF_UR20 = JointSize(
    tau_max=107.0, torque_constant=10.8, armature=1.44, coulomb=5.5, viscous=8.0, viscous_fast=4.0
)
ELBOW_OF_UR20 = JointSize(  # base and shoulder of a UR15 have the same torque
    tau_max=433.0, torque_constant=12.0, armature=8.4, coulomb=22.0, viscous=32.0, viscous_fast=15.0
)
BASE_OF_UR20 = JointSize(
    tau_max=738.0, torque_constant=12.0, armature=16.4, coulomb=37.0, viscous=55.0, viscous_fast=24.0
)

_REVERSAL_SPEED = 0.006  # rad/s; A: the sign has changed within .01-.015 rad/s


class DriveNumbers(TypedDict):
    """Those fields of `RobotModel` that follow from the sizes of its joints."""

    tau_max: Vector6
    torque_constant: Vector6
    armature: Vector6
    coulomb: Vector6
    viscous: Vector6
    viscous_kink: float
    viscous_fast: Vector6
    reversal_speed: float
    friction_rise: float
    coulomb_standstill: float
    coulomb_speed: float
    servo_frequency: float
    servo_damping: float


def drives(*sizes: JointSize) -> DriveNumbers:
    """Return the numbers of the drives of an arm with joints of these six sizes, base first."""
    return DriveNumbers(
        tau_max=six([size.tau_max for size in sizes]),
        torque_constant=six([size.torque_constant for size in sizes]),
        armature=six([size.armature for size in sizes]),
        coulomb=six([size.coulomb for size in sizes]),
        viscous=six([size.viscous for size in sizes]),
        viscous_kink=0.5,  # A
        viscous_fast=six([size.viscous_fast for size in sizes]),
        reversal_speed=_REVERSAL_SPEED,
        # As fast as the compensation: that would push the joint ahead wherever friction lags behind it, and
        # A, which is within .12 mrad of its target, shows no such thing.
        friction_rise=_REVERSAL_SPEED,
        coulomb_standstill=1.0,  # A
        coulomb_speed=1.0,  # without effect, as nothing is lost at standstill
        servo_frequency=25.0,  # at 12 Hz the arm is further from its target than a real UR3e
        servo_damping=0.9,
    )
