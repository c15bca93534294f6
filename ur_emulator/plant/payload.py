"""The payload body of a compiled MuJoCo arm."""

from __future__ import annotations

from math import isfinite, pi

import mujoco
import numpy as np

from ur_emulator.errors import PlantError
from ur_emulator.models.mjcf import PAYLOAD
from ur_emulator.models.robot_model import ZERO6, Vector3, Vector6

_DENSITY = 2700.0  # kg/m³, aluminium: gives a payload without a stated inertia a plausible one


def check_payload(mass: float, cog: Vector3) -> None:
    """Check a payload.

    Raises:
        PlantError: when the mass is negative or a number is not finite.
    """
    if not (isfinite(mass) and mass >= 0.0 and len(cog) == 3 and all(isfinite(x) for x in cog)):
        raise PlantError(
            f"payload of {mass} kg at {list(cog)} given: a mass >= 0 and three finite lengths needed"
        )


def set_payload_body(model: mujoco.MjModel, mass: float, cog: Vector3, inertia: Vector6 = ZERO6) -> None:
    """Set mass, centre of gravity and inertia of the payload body.

    Args:
        model: of the arm.
        mass: [kg].
        cog: centre of gravity in the flange frame [m].
        inertia: Ixx Iyy Izz Ixy Ixz Iyz about it, axes of the flange [kg m²]; zero for that of a solid ball.
    """
    body = model.body(PAYLOAD)
    radius = (3.0 * mass / (4.0 * pi * _DENSITY)) ** (1.0 / 3.0)
    body.mass[:] = mass
    body.ipos[:] = cog
    body.inertia[:] = 0.4 * mass * radius**2
    if any(inertia):
        xx, yy, zz, xy, xz, yz = inertia
        moments, axes = np.linalg.eigh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        axes[:, 2] *= np.linalg.det(axes)  # right-handed
        body.inertia[:] = np.maximum(moments, 0.0)
        mujoco.mju_mat2Quat(body.iquat, axes.ravel())
    # Derived constants (subtree masses and the like) are taken at the reference pose, on scratch data.
    mujoco.mj_setConst(model, mujoco.MjData(model))
