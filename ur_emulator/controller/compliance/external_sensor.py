"""A force sensor at the flange whose readings come through the RTDE input `external_force_torque`.

Source: URScript manual CB3 3.15, ft_rtde_input_enable: the reading is a wrench at the sensor's measuring
point, in the axes of the flange. Chosen: the reading is the external wrench; mass and centre of
gravity of the sensor are kept, but its weight is not subtracted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from protocol.pose import rotvec_to_matrix
from ur_emulator.models.robot_model import ZERO6, Vector3, Vector6, six

VARIABLE = "external_force_torque"


@dataclass(frozen=True, slots=True)
class ExternalSensor:
    """An enabled sensor.

    Attributes:
        mass: of the sensor [kg].
        offset: measuring point in the flange frame [m].
        cog: centre of gravity of the sensor in the flange frame [m].
        lever_sign: 1; -1 for the deprecated builtin, which kept a sign error of the moments.
    """

    mass: float
    offset: Vector3
    cog: Vector3
    lever_sign: float = 1.0

    def wrench_at_flange(self, reading: Vector6, flange_pose: Vector6) -> Vector6:
        """Return the wrench at the flange in base axes [N, Nm] for a reading; zero if it is not finite."""
        if not all(map(math.isfinite, reading)):
            return ZERO6
        fx, fy, fz, mx, my, mz = reading
        x, y, z = (self.lever_sign * r for r in self.offset)
        moment = (mx + y * fz - z * fy, my + z * fx - x * fz, mz + x * fy - y * fx)
        rotation = rotvec_to_matrix(flange_pose[3:])
        return six([float(v) for part in ((fx, fy, fz), moment) for v in rotation @ part])
