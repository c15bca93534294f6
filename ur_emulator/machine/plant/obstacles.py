"""Obstacles: fixed shapes that can be added and removed at run time.

MuJoCo's models have a fixed size. So the model has SLOTS shapes from the beginning, on a fixed body of
their own; those that are not in use collide with nothing and are skipped as a whole when none is in use.
"""

from collections.abc import Sequence
from math import hypot

import mujoco
import numpy as np
from numpy.typing import NDArray

from ur_emulator.errors import RefusedError
from ur_emulator.machine.models.robot_model import Vector6
from ur_emulator.machine.models.things import BodyShape
from ur_emulator.machine.plant.shapes import SHAPES, contacts_at, quaternion

OBSTACLES = "obstacles"
SLOTS = 16
# One more, so that an obstacle stays until the one that replaces it is found to have room.
_N_SHAPES = SLOTS + 1
_UNUSED = 0.001  # size of a shape that is not in use [m]


def add_slots(spec: mujoco.MjSpec) -> None:
    """Reserve shapes in a model."""
    body = spec.worldbody.add_body(name=OBSTACLES)
    for i in range(_N_SHAPES):
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
        self._slots: dict[str, tuple[int, BodyShape]] = {}

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
        return tuple(shape for _, shape in self._slots.values())

    def name_of(self, geom: int) -> str:
        """The obstacle that a shape of the model is."""
        return next(name for name, (slot, _) in self._slots.items() if slot == geom - self._first)

    def put(self, name: str, shape: str, size: Sequence[float], pose: Vector6) -> None:
        """Add an obstacle, a shape with sizes as in `things.SIZES` [m]; one of the same name is replaced.

        The pose is that of its middle in the base frame [m, rad]. RefusedError if it would overlap the arm,
        or there are too many; nothing changes then.
        """
        if len(self._slots) == SLOTS and name not in self._slots:
            raise RefusedError(f"obstacle {name}: there are {SLOTS} already, remove one first")
        slot = min(set(range(_N_SHAPES)).difference(slot for slot, _ in self._slots.values()))
        geom = self._first + slot
        self._write(geom, shape, size, pose)
        if (contacts_at(self._model, self._q).contact.geom == geom).any():
            self._hide(geom)
            raise RefusedError(f"obstacle {name}: the arm is where it should stand, move one of them")
        if len(self._slots) == SLOTS:
            self._hide(self._first + self._slots[name][0])
        else:
            self.remove(name)
        self._slots[name] = slot, BodyShape(name, False, shape, tuple(size), pose)

    def remove(self, name: str) -> None:
        """Remove an obstacle, if it exists."""
        if name in self._slots:
            slot, _ = self._slots.pop(name)
            self._hide(self._first + slot)

    def _write(self, geom: int, name: str, size: Sequence[float], pose: Vector6) -> None:
        model, shape = self._model, SHAPES[name]
        of_mujoco = shape.to_mujoco(*size)
        half = shape.half_extent(*of_mujoco)
        model.geom_type[geom] = int(shape.geom)
        model.geom_size[geom] = of_mujoco
        model.geom_aabb[geom] = (0.0, 0.0, 0.0, *half)
        model.geom_rbound[geom] = hypot(*half)
        model.geom_pos[geom] = pose[:3]
        model.geom_quat[geom] = quaternion(pose[3:])
        # Left at "same frame as its body", the shape would not follow its own position.
        model.geom_sameframe[geom] = int(mujoco.mjtSameFrame.mjSAMEFRAME_NONE)
        self._switch(geom, True)

    def _hide(self, geom: int) -> None:
        self._model.geom_sameframe[geom] = int(mujoco.mjtSameFrame.mjSAMEFRAME_BODY)
        self._switch(geom, False)

    def _switch(self, geom: int, on: bool) -> None:
        model = self._model
        model.geom_contype[geom] = model.geom_conaffinity[geom] = int(on)
        any_on = int(model.geom_contype[self._first : self._first + _N_SHAPES].any())
        model.body_contype[self._body] = model.body_conaffinity[self._body] = any_on
