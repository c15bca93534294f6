"""Loads: payload and push at the flange, true ones and those that the controller assumes."""

from collections.abc import Sequence
from math import isfinite, pi

import mujoco
import numpy as np
from numpy.typing import NDArray

from ur_emulator.errors import PlantError
from ur_emulator.machine.models.mjcf import FLANGE, GRAVITY, LINKS, PAYLOAD
from ur_emulator.machine.models.robot_model import ZERO6, Vector3, Vector6
from ur_hil.arithmetic import add_up
from ur_hil.tools import ToolModel

_DENSITY = 2700.0  # kg/m³, aluminium: gives a payload without a stated inertia a plausible one


def check_payload(mass: float, cog: Vector3) -> None:
    """Raise PlantError for a mass that is negative or a number that is not finite."""
    if not (isfinite(mass) and mass >= 0.0 and len(cog) == 3 and all(isfinite(x) for x in cog)):
        raise PlantError(
            f"payload of {mass} kg at {list(cog)} given: a mass >= 0 and three finite lengths needed"
        )


def set_payload_body(model: mujoco.MjModel, mass: float, cog: Vector3, inertia: Vector6 = ZERO6) -> None:
    """Set mass [kg], centre of gravity [m, flange frame] and inertia of the payload body.

    `inertia` is Ixx Iyy Izz Ixy Ixz Iyz about it, axes of the flange [kg m²]; zero for that of a solid ball.
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


class Loads:
    """The payload and the push on one arm, in the plant's model.

    The mass of tools is a part of the model; the controller knows it only as the payload that is declared.

    Attributes:
        is_unexpected: something acts that the controller does not expect: see `wrench`.
    """

    def __init__(self, tools: Sequence[ToolModel] = ()) -> None:
        self._push: NDArray[np.float64] | None = None
        self._push_point = np.zeros(3)
        self._push_wrench = np.zeros(6)
        self._tools = tuple((tool.mass, tool.at_flange(tool.cog)) for tool in tools)
        # What hangs on the flange; empty: what is declared does.
        self._true: tuple[tuple[float, Vector3], ...] = self._tools
        self._declared: tuple[float, Vector3] = (0.0, (0.0, 0.0, 0.0))
        self._weigh()

    def bind(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Act in this model and its state from now on."""
        self._model = model
        self._data = data
        self._flange_link: int = model.body(LINKS[5]).id
        site: int = model.site(FLANGE).id
        self._flange_position: NDArray[np.float64] = data.site_xpos[site]
        self._flange_rotation: NDArray[np.float64] = data.site_xmat[site].reshape(3, 3)

    def declare(self, mass: float, cog: Vector3, inertia: Vector6) -> None:
        """Set the payload that the controller assumes, and the true one unless `attach` has set it.

        Arguments and errors as in `set_payload_body` and `check_payload`.
        """
        check_payload(mass, cog)
        self._declared = (mass, cog)
        self._weigh()
        if not self._true:
            set_payload_body(self._model, mass, cog, inertia)

    def attach(self, mass: float, cog: Vector3) -> None:
        """Set the true payload, which the controller does not know; see `declare`."""
        check_payload(mass, cog)
        self._true = (*self._tools, (mass, cog))
        self._weigh()
        set_payload_body(self._model, mass, cog)

    def push(self, force: Sequence[float], point: Sequence[float]) -> None:
        """Push from now on; see `ArmPlant.push`."""
        self._push = np.array(force) if any(force) else None
        self._push_point = np.array(point)
        self._data.xfrc_applied[self._flange_link] = 0.0
        self._weigh()

    def apply(self) -> None:
        """Apply the push to its body in MuJoCo, for the pose at the start of this cycle."""
        force = self._push
        if force is None:
            return
        data = self._data
        lever = self._flange_rotation @ self._push_point
        self._push_wrench = np.concatenate([force, np.cross(lever, force)])
        from_com = self._flange_position + lever - data.xipos[self._flange_link]
        data.xfrc_applied[self._flange_link] = np.concatenate([force, np.cross(from_com, force)])

    @property
    def wrench(self) -> NDArray[np.float64]:
        """Wrench (6,) that the controller does not expect, at the flange in base axes [N, Nm]."""
        wrench = np.zeros(6) if self._push is None else self._push_wrench.copy()
        if self._true:
            x, y, _ = self._flange_rotation.dot(self._excess_weight).tolist()
            wrench[2:5] += (-self._excess_force, -y, x)
        return wrench

    def _weigh(self) -> None:
        """Compute what hangs on the flange beyond what is declared, and whether something is unexpected."""
        loads = [*self._true, (-self._declared[0], self._declared[1])]
        self._excess_force = GRAVITY * add_up(mass for mass, _ in loads)
        self._excess_weight = sum((GRAVITY * mass * np.array(cog) for mass, cog in loads), np.zeros(3))
        differs = bool(self._true) and (self._excess_force != 0.0 or bool(self._excess_weight.any()))
        self.is_unexpected = self._push is not None or differs
