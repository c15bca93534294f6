"""The things around an arm that can be moved: bodies with mass and friction, which it grips and pushes.

A model of MuJoCo has a fixed size, so it is compiled anew when a thing is added or removed; the state of
everything else stays. Things that stand still for ever are obstacles (`obstacles.py`).
"""

from collections.abc import Callable

import mujoco
import numpy as np

from ur_emulator.errors import RefusedError
from ur_emulator.models.robot_model import Vector6, six
from ur_emulator.models.things import Thing, ThingState
from ur_emulator.plant.obstacles import quaternion

MOST_THINGS = 32
PREFIX = "thing_"

_GEOMS: dict[str, tuple[mujoco.mjtGeom, Callable[..., tuple[float, float, float]]]] = {
    "box": (mujoco.mjtGeom.mjGEOM_BOX, lambda x, y, z: (x / 2, y / 2, z / 2)),
    "cylinder": (mujoco.mjtGeom.mjGEOM_CYLINDER, lambda r, length: (r, length / 2, 0.0)),
    "sphere": (mujoco.mjtGeom.mjGEOM_SPHERE, lambda r: (r, 0.0, 0.0)),
}

# As the pads of a tool: what is squeezed must not sink in, see `hand.py`.
_SOLREF, _SOLIMP = (0.006, 1.0), (0.9, 0.99, 0.001, 0.5, 2.0)


class Scene:
    """The things of one arm; `recompile` makes the model anew after a change of its specification."""

    def __init__(self, spec: mujoco.MjSpec, recompile: Callable[[], None]) -> None:
        self._spec = spec
        self._recompile = recompile
        self._things: dict[str, Thing] = {}

    def bind(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Look at this model and its state from now on."""
        self._model, self._data = model, data

    @property
    def things(self) -> tuple[Thing, ...]:
        """All of them, as they were put, in the order in which they were added."""
        return tuple(self._things.values())

    def put(self, thing: Thing) -> None:
        """Add a thing at rest; one of the same name is replaced.

        Raises:
            RefusedError: there are too many, or it would overlap the arm; nothing changes then.
        """
        before = self._things.get(thing.name)
        if before is None and len(self._things) >= MOST_THINGS:
            raise RefusedError(f"thing {thing.name}: there are {MOST_THINGS} already, remove one first")
        if before is not None:
            self.remove(thing.name)
        kind, to_mujoco = _GEOMS[thing.shape]
        body = self._spec.worldbody.add_body(
            name=PREFIX + thing.name, pos=thing.pose[:3], quat=quaternion(thing.pose[3:])
        )
        body.add_freejoint(name=PREFIX + thing.name)
        body.add_geom(
            name=PREFIX + thing.name,
            type=kind,
            size=to_mujoco(*thing.size),
            mass=thing.mass,
            friction=[thing.friction, 0.005, 0.0001],
            solref=_SOLREF,
            solimp=_SOLIMP,
            condim=4,
        )
        self._recompile()
        self._things[thing.name] = thing
        if self._overlaps_arm(thing.name):
            self.remove(thing.name)
            if before is not None:
                self.put(before)
            raise RefusedError(f"thing {thing.name}: the arm is where it should be, move one of them")

    def remove(self, name: str) -> None:
        """Take a thing away, if it exists."""
        if self._things.pop(name, None) is not None:
            self._spec.delete(self._spec.body(PREFIX + name))
            self._recompile()

    def move(self, name: str, pose: Vector6) -> None:
        """Put a thing elsewhere, at rest."""
        joint = self._model.joint(PREFIX + name)
        q, v = int(joint.qposadr[0]), int(joint.dofadr[0])
        self._data.qpos[q : q + 7] = (*pose[:3], *quaternion(pose[3:]))
        self._data.qvel[v : v + 6] = 0.0

    def state(self, name: str) -> ThingState:
        """Where a thing is."""
        model, data = self._model, self._data
        joint = model.joint(PREFIX + name)
        q, v = int(joint.qposadr[0]), int(joint.dofadr[0])
        turn, rotation = np.zeros(3), np.zeros(9)
        mujoco.mju_quat2Vel(turn, data.qpos[q + 3 : q + 7], 1.0)
        mujoco.mju_quat2Mat(rotation, data.qpos[q + 3 : q + 7])
        spin = rotation.reshape(3, 3) @ data.qvel[v + 3 : v + 6]  # MuJoCo has it in the thing's own axes
        return ThingState(
            six([*data.qpos[q : q + 3].tolist(), *turn.tolist()]),
            six([*data.qvel[v : v + 3].tolist(), *spin.tolist()]),
            self._touches(name),
        )

    def _touches(self, name: str) -> bool:
        """Whether it touches the arm or its tool."""
        model, data = self._model, self._data
        geom, arm = model.geom(PREFIX + name).id, model.body("link_1").id
        for i in range(data.ncon):
            pair = data.contact[i].geom.tolist()
            if geom in pair:
                other = pair[1 - pair.index(geom)]
                if model.body_rootid[model.geom_bodyid[other]] == arm:
                    return True
        return False

    def _overlaps_arm(self, name: str) -> bool:
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_collision(self._model, self._data)
        return self._touches(name)
