"""JointRange: the joint ranges of an arm that are in force; one record that all who keep them share."""

from dataclasses import dataclass

from ur_emulator.machine.models.robot_model import Vector6


@dataclass(slots=True)
class JointRange:
    """Ends of the joint ranges [rad]; at first those of the robot, then those of its installation."""

    q_min: Vector6
    q_max: Vector6
