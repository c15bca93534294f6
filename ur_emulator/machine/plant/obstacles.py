"""Obstacles: fixed shapes that can be added and removed at run time.

MuJoCo's models have a fixed size. So the model has SLOTS shapes from the beginning, on a fixed body of
their own; those that are not in use collide with nothing and are skipped as a whole when none is in use.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import cos, hypot, inf, sin

import mujoco
import numpy as np
from numpy.typing import NDArray

from ur_emulator.errors import RefusedError
from ur_emulator.machine.models.robot_model import Vector6
from ur_emulator.machine.models.things import BodyShape

OBSTACLES = "obstacles"
SLOTS = 16

# A shape that is not in use, and the part of a plane that is drawn [m].
_UNUSED, _DRAWN = 0.001, 5.0


@dataclass(frozen=True, slots=True)
class Shape:
    """A kind of obstacle.

    Attributes:
        geom: MuJoCo's type.
        to_mujoco: its sizes, as `AddObstacle` has them, as MuJoCo's sizes.
        half_extent: half edges of the smallest box around it [m]; infinite for a plane.
    """

    geom: mujoco.mjtGeom
    to_mujoco: Callable[..., tuple[float, float, float]]
    half_extent: Callable[..., tuple[float, float, float]]


SHAPES: dict[str, Shape] = {
    "box": Shape(
        mujoco.mjtGeom.mjGEOM_BOX,
        lambda x, y, z: (x / 2, y / 2, z / 2),
        lambda x, y, z: (x / 2, y / 2, z / 2),
    ),
    "sphere": Shape(mujoco.mjtGeom.mjGEOM_SPHERE, lambda r: (r, 0.0, 0.0), lambda r: (r, r, r)),
    "capsule": Shape(
        mujoco.mjtGeom.mjGEOM_CAPSULE,
        lambda r, length: (r, length / 2, 0.0),
        lambda r, length: (r, r, length / 2 + r),
    ),
    # A wall without end; what is on the side of negative z is inside it.
    "plane": Shape(mujoco.mjtGeom.mjGEOM_PLANE, lambda: (_DRAWN, _DRAWN, 0.1), lambda: (inf, inf, inf)),
}


def add_slots(spec: mujoco.MjSpec) -> None:
    """Reserve shapes in a model."""
    body = spec.worldbody.add_body(name=OBSTACLES)
    for i in range(SLOTS):
        body.add_geom(
            name=f"{OBSTACLES}_{i}",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[_UNUSED, 0.0, 0.0],
            contype=0,
            conaffinity=0,
            mass=0.0,
        )


class Obstacles:
    """The obstacles of one arm, in a model with slots for them."""

    def __init__(self) -> None:
        self._slots: dict[str, int] = {}
        self._shapes: dict[str, BodyShape] = {}

    def bind(self, model: mujoco.MjModel, q: NDArray[np.float64]) -> None:
        """Be in this model from now on; `q` has the positions of all joints: none must overlap the arm."""
        self._model = model
        self._q = q
        self._body: int = model.body(OBSTACLES).id
        self._first: int = model.geom(f"{OBSTACLES}_0").id

    @property
    def names(self) -> tuple[str, ...]:
        """Their names, in the order in which they were added."""
        return tuple(self._slots)

    @property
    def shapes(self) -> tuple[BodyShape, ...]:
        """What they are, in the same order."""
        return tuple(self._shapes.values())

    def name_of(self, geom: int) -> str:
        """The obstacle that a shape of the model is."""
        return next(name for name, slot in self._slots.items() if slot == geom - self._first)

    def put(self, name: str, shape: str, size: Sequence[float], pose: Vector6) -> None:
        """Add an obstacle, one of SHAPES with sizes as it wants them [m]; one of the same name is replaced.

        The pose is that of its middle in the base frame [m, rad]. RefusedError if it would overlap the arm,
        or there are too many; nothing changes then.
        """
        slot = next(i for i in range(SLOTS + 1) if i not in self._slots.values())
        if slot == SLOTS and name not in self._slots:
            raise RefusedError(f"obstacle {name}: there are {SLOTS} already, remove one first")
        in_place = slot == SLOTS
        if in_place:
            slot = self._slots[name]
            before = self._read(slot)
        self._write(slot, SHAPES[shape], size, pose)
        if self._touches(slot):
            if in_place:
                self._restore(slot, before)
            else:
                self._hide(slot)
            raise RefusedError(f"obstacle {name}: the arm is where it should stand, move one of them")
        if not in_place:
            self.remove(name)
        self._slots[name] = slot
        self._shapes[name] = BodyShape(name, False, shape, tuple(size), pose)

    def remove(self, name: str) -> None:
        """Remove an obstacle, if it exists."""
        slot = self._slots.pop(name, None)
        self._shapes.pop(name, None)
        if slot is not None:
            self._hide(slot)

    def _write(self, slot: int, shape: Shape, size: Sequence[float], pose: Vector6) -> None:
        model, geom = self._model, self._first + slot
        half = shape.half_extent(*size)
        endless = half[0] == inf
        model.geom_type[geom] = int(shape.geom)
        model.geom_size[geom] = shape.to_mujoco(*size)
        model.geom_aabb[geom] = (0.0, 0.0, 0.0, *((0.0, 0.0, 0.0) if endless else half))
        model.geom_rbound[geom] = 0.0 if endless else hypot(*half)
        model.geom_pos[geom] = pose[:3]
        model.geom_quat[geom] = quaternion(pose[3:])
        # Left at "same frame as its body", the shape would not follow its own position.
        model.geom_sameframe[geom] = int(mujoco.mjtSameFrame.mjSAMEFRAME_NONE)
        self._switch(geom, True)

    def _hide(self, slot: int) -> None:
        geom = self._first + slot
        self._model.geom_sameframe[geom] = int(mujoco.mjtSameFrame.mjSAMEFRAME_BODY)
        self._switch(geom, False)

    def _switch(self, geom: int, on: bool) -> None:
        model = self._model
        model.geom_contype[geom] = model.geom_conaffinity[geom] = int(on)
        own = slice(self._first, self._first + SLOTS)
        any_on = int(model.geom_contype[own].any())
        model.body_contype[self._body] = model.body_conaffinity[self._body] = any_on

    def _read(self, slot: int) -> list[np.ndarray]:
        return [np.copy(field[self._first + slot]) for field in self._fields()]

    def _restore(self, slot: int, values: list[np.ndarray]) -> None:
        for field, value in zip(self._fields(), values, strict=True):
            field[self._first + slot] = value

    def _fields(self) -> tuple[np.ndarray, ...]:
        m = self._model
        return m.geom_type, m.geom_size, m.geom_aabb, m.geom_rbound, m.geom_pos, m.geom_quat

    def _touches(self, slot: int) -> bool:
        data = mujoco.MjData(self._model)
        data.qpos[:] = self._q
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        mujoco.mj_collision(self._model, data)
        geom = self._first + slot
        return any(geom in data.contact[i].geom for i in range(data.ncon))


def quaternion(vector: Sequence[float]) -> tuple[float, float, float, float]:
    """Quaternion (w, x, y, z) of a rotation vector [rad]."""
    angle = hypot(*vector)
    x, y, z = vector
    share = sin(angle / 2) / angle if angle > 0.0 else 0.5
    return (cos(angle / 2), share * x, share * y, share * z)
