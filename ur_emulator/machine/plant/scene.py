"""The surroundings of an arm: things that can be moved, which it grips and pushes, and a scene of a file.

A model of MuJoCo has a fixed size, so it is compiled anew when a thing is added or removed; the state of
everything else stays. What stands still and comes and goes are obstacles (`obstacles.py`); what stands still
in a scene stays.
"""

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np

from protocol.pose import rpy_to_rotvec
from ur_emulator.errors import ModelError, RefusedError
from ur_emulator.machine.models.robot_model import Vector6, six
from ur_emulator.machine.models.things import Thing, ThingState
from ur_emulator.machine.plant.shapes import SHAPES, collide, quaternion
from ur_hil.cell import Cell, load_cell
from ur_hil.input_files import MIB, FileKind

MOST_THINGS = 32
PREFIX = "thing_"

_SCENE = "scene"

# As the pads of a tool: what is squeezed must not sink in, see `hand.py`.
_SOLREF, _SOLIMP = (0.006, 1.0), (0.9, 0.99, 0.001, 0.5, 2.0)


class Scene:
    """The things of one arm; `recompile` makes the model anew after a change of its specification."""

    def __init__(self, spec: mujoco.MjSpec, recompile: Callable[[], None]) -> None:
        self._spec = spec
        self._recompile = recompile
        # None: a body of a scene in MJCF.
        self._things: dict[str, Thing | None] = {}

    def bind(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Look at this model and its state from now on."""
        self._model, self._data = model, data

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the things, in the order in which they were added."""
        return tuple(self._things)

    def furnish(self, surroundings: Cell | Path) -> None:
        """Put what a cell describes, or a fragment of MJCF, around the arm for good; things can be moved.

        Raises:
            RefusedError: the arm is where something should stand, or there are too many things.
            ModelError: the fragment makes no sense.
        """
        body = self._spec.worldbody.add_body(name=_SCENE)
        if isinstance(surroundings, Path):
            self._attach(surroundings, body)
            self._recompile()
        else:
            self._model.geom("table").pos[2] = surroundings.floor_z
            _add_cell(body, surroundings)
            self._recompile()
            for solid in surroundings.things:
                pose = six([*solid.centre, *rpy_to_rotvec(solid.rpy)])
                self.put(Thing(solid.name, solid.shape, solid.sizes, solid.mass, solid.friction, pose))
        collide(self._model, self._data)
        standing = (0, self._model.body(_SCENE).id)  # the table is of the world
        if self._arm_touches(lambda geom: self._model.geom_bodyid[geom] in standing):
            raise RefusedError("scene: the arm is where something should stand, move one of them")

    def _attach(self, path: Path, body: mujoco.MjsBody) -> None:
        """Add the bodies of a fragment of MJCF; those with a free joint are things."""
        try:
            fixed, moving = mujoco.MjSpec.from_file(str(path)), mujoco.MjSpec.from_file(str(path))
            if any((moving.actuators, moving.sensors, moving.keys, moving.plugins)):
                raise ValueError("a scene has no actuators, sensors, keys and plugins, remove them")
            fixed.compile()
        except ValueError as error:
            raise ModelError(f"{path}: {' '.join(str(error).split())[:200]}; give a file of MJCF") from error
        for own in list(fixed.worldbody.bodies):
            fixed.delete(own)
        self._spec.attach(fixed, frame=body.add_frame(), prefix=f"{_SCENE}_")
        for i, own in enumerate(moving.worldbody.bodies):
            name = own.name or f"body {i + 1}"
            free = [joint for joint in own.joints if joint.type == mujoco.mjtJoint.mjJNT_FREE]
            own.name = name
            for joint in free:
                joint.name = name
                self._things[name] = None
            self._spec.worldbody.add_frame().attach_body(own, PREFIX, "")

    def put(self, thing: Thing) -> None:
        """Add a thing at rest; one of the same name is replaced.

        Raises:
            RefusedError: there are too many, or it would overlap the arm; nothing changes then.
        """
        before = self._things.get(thing.name)
        if before is None and thing.name in self._things:
            raise RefusedError(f"thing {thing.name}: it is one of the scene's file, remove it first")
        if before is None and len(self._things) >= MOST_THINGS:
            raise RefusedError(f"thing {thing.name}: there are {MOST_THINGS} already, remove one first")
        # Beside the one that it replaces, which may have moved: that stays if this one is refused.
        name = PREFIX if before is not None else PREFIX + thing.name
        body = self._spec.worldbody.add_body(name=name, pos=thing.pose[:3], quat=quaternion(thing.pose[3:]))
        joint = body.add_freejoint(name=name)
        geom = _add_shape(body, thing.shape, thing.size, thing.friction)
        geom.mass = thing.mass
        geom.solref, geom.solimp, geom.condim = _SOLREF, _SOLIMP, 4
        self._recompile()
        collide(self._model, self._data)
        if self._touches(name):
            self._spec.delete(body)
            self._recompile()
            raise RefusedError(f"thing {thing.name}: the arm is where it should be, move one of them")
        self.remove(thing.name)
        if before is not None:
            body.name = joint.name = PREFIX + thing.name
            self._recompile()
        self._things[thing.name] = thing

    def remove(self, name: str) -> None:
        """Take a thing away, if it exists."""
        if name in self._things:
            del self._things[name]
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
            self._touches(PREFIX + name),
        )

    def _touches(self, body: str) -> bool:
        """Whether the body of a thing touches the arm or its tool."""
        model = self._model
        thing = model.body(body).id
        return self._arm_touches(lambda geom: model.body_rootid[model.geom_bodyid[geom]] == thing)

    def _arm_touches(self, is_it: Callable[[int], bool]) -> bool:
        model, data = self._model, self._data
        arm = model.body("link_1").id
        for i in range(data.ncon):
            one, other = data.contact[i].geom.tolist()
            for geom, against in ((one, other), (other, one)):
                if model.body_rootid[model.geom_bodyid[geom]] == arm and is_it(against):
                    return True
        return False


def load_scene(path: Path) -> Cell | Path:
    """Read a scene: a cell file in TOML; a file of MJCF (.xml) is read when it is put around an arm.

    Raises:
        ModelError: the file cannot be read or makes no sense.
    """
    if path.suffix == ".toml":
        return load_cell(path, FileKind(MIB, ModelError, "100 bodies have less than 0.1 MiB"))
    if path.suffix == ".xml":
        return path
    raise ModelError(f"{path}: give a cell file (.toml, as examples/scene.toml) or a fragment of MJCF (.xml)")


def _add_cell(body: mujoco.MjsBody, cell: Cell) -> None:
    """Add walls and solids of a cell."""
    for wall in cell.walls:
        wide = body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_PLANE, size=[2.0, 2.0, 0.1], pos=np.multiply(wall.normal, wall.offset)
        )
        mujoco.mju_quatZ2Vec(wide.quat, np.array(wall.normal))
    for solid in cell.solids:
        geom = _add_shape(body, solid.shape, solid.sizes, solid.friction)
        geom.pos, geom.quat = solid.centre, quaternion(rpy_to_rotvec(solid.rpy))


def _add_shape(body: mujoco.MjsBody, shape: str, size: tuple[float, ...], friction: float) -> mujoco.MjsGeom:
    kind = SHAPES[shape]
    return body.add_geom(type=kind.geom, size=kind.to_mujoco(*size), friction=[friction, 0.005, 0.0001])
