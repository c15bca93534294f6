"""A RobotModel as a MuJoCo model: six hinges, six links, a place for the payload.

This is the bare mechanism, as both the physics and the controller's own dynamics need it. Friction, drives,
sensors and collision hulls are the plant's and are added there.

Each body of the chain has its frame at the previous DH frame turned by its joint angle, because a MuJoCo
hinge sits in its body's frame while DH puts it in the parent's. What a `Link` states in its DH frame is
therefore moved by the constant part Tz(d) Tx(a) Rx(alpha) of its row.
"""

from collections.abc import Sequence
from math import cos, sin

import mujoco
import numpy as np

from ur_emulator.machine.models.robot_model import DhRow, Link, RobotModel, Vector3

JOINTS = tuple(f"joint_{i}" for i in range(1, 7))
LINKS = tuple(f"link_{i}" for i in range(1, 7))
FLANGE = "flange"
PAYLOAD = "payload"

GRAVITY = 9.81  # m/s²


def arm_spec(robot: RobotModel, dh: Sequence[DhRow], mass_scale: Sequence[float]) -> mujoco.MjSpec:
    """Build the bare mechanism, of six DH rows and six factors on the links' masses and inertias.

    Returns:
        An editable specification with the joints JOINTS, the bodies LINKS and PAYLOAD (mass 0), and the
        site FLANGE at the tool flange.
    """
    spec = mujoco.MjSpec()
    spec.modelname = robot.name
    spec.option.gravity = [0.0, 0.0, -GRAVITY]
    parent = spec.worldbody
    position: Sequence[float] = (0.0, 0.0, 0.0)
    twist = 0.0
    for i, (row, link, scale) in enumerate(zip(dh, robot.links, mass_scale, strict=True)):
        body = parent.add_body(name=LINKS[i], pos=position, quat=_turn_x_then_z(twist, row.theta))
        body.explicitinertial = True
        body.mass = link.mass * scale
        body.ipos = to_body(row, link.com)
        if any(link.products):
            body.fullinertia = [scale * entry for entry in _body_tensor(row, link)]
        else:
            body.iquat = _turn_x_then_z(row.alpha, 0.0)
            body.inertia = [moment * scale for moment in link.inertia]
        body.add_joint(name=JOINTS[i], type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 0.0, 1.0])
        parent, position, twist = body, (row.a, 0.0, row.d), row.alpha
    flange_turn = _turn_x_then_z(twist, 0.0)
    parent.add_site(name=FLANGE, pos=position, quat=flange_turn)
    payload = parent.add_body(name=PAYLOAD, pos=position, quat=flange_turn)
    payload.explicitinertial = True
    payload.mass = 0.0
    return spec


def to_body(row: DhRow, point: Vector3) -> Vector3:
    """Move a point of a link's DH frame [m] into the frame of the link's MuJoCo body."""
    x, y, z = point
    c, s = cos(row.alpha), sin(row.alpha)
    return (x + row.a, c * y - s * z, s * y + c * z + row.d)


def _body_tensor(row: DhRow, link: Link) -> list[float]:
    """Inertia tensor xx, yy, zz, xy, xz, yz of a link [kg m²], along the axes of its MuJoCo body."""
    c, s = cos(row.alpha), sin(row.alpha)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    tensor = turn @ np.array(link.tensor) @ turn.T
    return [float(tensor[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def _turn_x_then_z(about_x: float, about_z: float) -> tuple[float, float, float, float]:
    """Quaternion (w, x, y, z) of Rx(about_x) Rz(about_z)."""
    cx, sx = cos(about_x / 2), sin(about_x / 2)
    cz, sz = cos(about_z / 2), sin(about_z / 2)
    return (cx * cz, sx * cz, -sx * sz, cx * sz)
