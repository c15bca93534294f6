"""Contact forces of the surroundings on the arm, as one wrench at the flange."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray


def contact_wrench(
    model: mujoco.MjModel, data: mujoco.MjData, flange: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the sum of the contact forces of fixed bodies (table, base, obstacles) on the arm.

    Contacts between two links of the arm do not count: they are internal forces.

    Args:
        model: the plant's model.
        data: its state after a step.
        flange: the point that moments refer to, in the base frame (3,) [m].

    Returns:
        Wrench (6,) on the arm, base axes, force first [N, Nm].
    """
    wrench = np.zeros(6)
    fixed_to = model.body_weldid
    in_contact_frame = np.zeros(6)
    for i in range(data.ncon):
        contact = data.contact[i]
        first, second = (int(fixed_to[model.geom_bodyid[geom]]) for geom in contact.geom)
        if (first == 0) == (second == 0):
            continue
        mujoco.mj_contactForce(model, data, i, in_contact_frame)
        # MuJoCo gives the force on the second body, in the contact's axes (rows of `frame`).
        force = contact.frame.reshape(3, 3).T @ in_contact_frame[:3]
        if second == 0:
            force = -force
        fx, fy, fz = force.tolist()
        rx, ry, rz = (contact.pos - flange).tolist()
        wrench += (fx, fy, fz, ry * fz - rz * fy, rz * fx - rx * fz, rx * fy - ry * fx)
    return wrench
