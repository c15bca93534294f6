"""Freedrive: the torque of the drives while a person guides the arm by hand.

No joint holds a position. The drives carry the arm against gravity, as the controller's model with the
declared payload knows it, take away a part of the friction, and push back near the limits of a joint's range
and speed.

Source: UR3/CB3 manual, chapter "Freedrive mode": close to limits of position and speed the user feels a
repelling force that grows towards the limit and can be overcome. How strong it is, and how much of the
friction is compensated, is not published and chosen here.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ur_emulator.models.robot_model import RobotModel, Vector6

# Part of the modelled Coulomb friction that is compensated. With any error of the model (see `Friction`,
# 70 % at most) it is less than the true friction: a joint never moves by itself.
FRICTION_SHARE = 0.5
# The push back begins this far before the end of the range [rad], and at this part of the rated speed.
RANGE_MARGIN = 0.15
SPEED_MARGIN = 0.7
# It has grown to this part of the rated torque at the limit.
LIMIT_SHARE = 0.6
# The torque on a resting joint is only a part of that; it is full while the joint moves outwards at this
# speed [rad/s]. A spring alone would throw the arm back.
_REST_SHARE, _FULL_SPEED = 0.3, 0.1


class Freedrive:
    """Torque of the drives in freedrive.

    Args:
        robot: gives ranges, rated speeds and torques.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._strength = LIMIT_SHARE * np.array(robot.tau_max)
        self.set_range(robot.q_min, robot.q_max)
        self._free_speed = SPEED_MARGIN * np.array(robot.qd_max)
        self._braking_speed = (1.0 - SPEED_MARGIN) * np.array(robot.qd_max)

    def set_range(self, q_min: Vector6, q_max: Vector6) -> None:
        """Set the joint ranges [rad] at whose ends the drives push back; at first those of the robot."""
        self._low = np.array(q_min) + RANGE_MARGIN
        self._high = np.array(q_max) - RANGE_MARGIN

    def torque(
        self,
        gravity: NDArray[np.float64],
        dry_friction: NDArray[np.float64],
        q: NDArray[np.float64],
        qd: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Return the torque of the drives (6,) [Nm].

        Args:
            gravity: that the controller's model expects at q (6,) [Nm].
            dry_friction: Coulomb friction that the controller expects at qd (6,) [Nm].
            q: joint angles (6,) [rad].
            qd: joint speeds (6,) [rad/s].
        """
        beyond = np.maximum(q - self._high, 0.0) + np.minimum(q - self._low, 0.0)
        depth = np.clip(beyond / RANGE_MARGIN, -1.0, 1.0)
        outwards = np.clip(qd * np.sign(depth) / _FULL_SPEED, 0.0, 1.0)
        repelling = depth * np.abs(depth) * (_REST_SHARE + (1.0 - _REST_SHARE) * outwards)
        excess = np.maximum(np.abs(qd) - self._free_speed, 0.0) / self._braking_speed
        push_back = repelling + np.sign(qd) * excess
        torque: NDArray[np.float64] = gravity + FRICTION_SHARE * dry_friction - self._strength * push_back
        return torque
