"""The payload body of a compiled MuJoCo arm."""

from __future__ import annotations

from math import isfinite, pi

import mujoco

from ur_emulator.errors import PlantError
from ur_emulator.models.mjcf import PAYLOAD
from ur_emulator.models.robot_model import Vector3

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


def set_payload_body(model: mujoco.MjModel, mass: float, cog: Vector3) -> None:
    """Make the payload body a solid ball of this mass [kg] with its centre at cog [m] in the flange frame."""
    body = model.body(PAYLOAD)
    radius = (3.0 * mass / (4.0 * pi * _DENSITY)) ** (1.0 / 3.0)
    body.mass[:] = mass
    body.ipos[:] = cog
    body.inertia[:] = 0.4 * mass * radius**2
    # Derived constants (subtree masses and the like) are taken at the reference pose, on scratch data.
    mujoco.mj_setConst(model, mujoco.MjData(model))
