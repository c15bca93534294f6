"""The surroundings of an arm: things, which it grips and pushes, obstacles, and a scene of a file.

A model of MuJoCo has a fixed size, so it is compiled anew when something is added or removed; the state of
everything else stays. What stands still in a scene stays for good.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from protocol.pose import rpy_to_rotvec
from ur_emulator.errors import ModelError, RefusedError
from ur_emulator.machine.models.mjcf import LINKS
from ur_emulator.machine.models.robot_model import Vector6, six
from ur_emulator.machine.models.things import BodyShape, Thing, ThingNow
from ur_emulator.machine.plant.physics_model import CONTACT_SOLIMP, CONTACT_SOLREF
from ur_emulator.machine.plant.shapes import SHAPES, quaternion
from ur_hil.cell import Cell, load_cell
from ur_hil.input_files import MIB, FileKind

MOST = {"thing": 32, "obstacle": 16}
PREFIX = "thing_"  # of bodies of a scene's file
OBSTACLE = "obstacle "  # of the bodies of obstacles

_SCENE = "scene"
_REFUSAL = {"thing": "be", "obstacle": "stand"}

# As the pads of a tool: what is squeezed must not sink in, see `hand.py`.
_SOLREF, _SOLIMP = (0.006, 1.0), (0.9, 0.99, 0.001, 0.5, 2.0)


class _Placed(NamedTuple):
    """What somebody has put around the arm.

    Attributes:
        body: its name in the model.
        thing: what it is; None: a body of a scene in MJCF.
    """

    body: str
    thing: Thing | None


class Scene:
    """What surrounds one arm; `recompile` makes the model anew after a change of its specification."""

    def __init__(self, spec: mujoco.MjSpec, recompile: Callable[[], None]) -> None:
        self._spec = spec
        self._recompile = recompile
        self._n_added = 0
        # By kind and name, in the order in which they were added.
        self._placed: dict[tuple[str, str], _Placed] = {}

    def bind(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Look at this model and its state from now on."""
        self._model, self._data = model, data

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the things that can be moved, in the order in which they were added."""
        return tuple(name for kind, name in self._placed if kind == "thing")

    @property
    def obstacles(self) -> tuple[BodyShape, ...]:
        """The obstacles, in the order in which they were added."""
        things = (placed.thing for placed in self._placed.values())
        return tuple(
            BodyShape(it.name, False, it.shape, it.size, it.pose) for it in things if it and not it.mass
        )

    def name_of(self, body: str) -> str:
        """What people call a body of the model."""
        names = (name for (_, name), placed in self._placed.items() if placed.body == body)
        return next(names, body.removeprefix(PREFIX))

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
            self._spec.geom("table").pos[2] = surroundings.floor_z
            _add_cell(body, surroundings)
            self._recompile()
            for solid in surroundings.things:
                pose = six([*solid.centre, *rpy_to_rotvec(solid.rpy)])
                self.put(Thing(solid.name, solid.shape, solid.sizes, solid.mass, solid.friction, pose))
        # The table is of the world.
        if any(self._arm in self._touching(body) for body in ("world", _SCENE)):
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
                self._placed["thing", name] = _Placed(PREFIX + name, None)
            self._spec.worldbody.add_frame().attach_body(own, PREFIX, "")

    def put(self, thing: Thing) -> None:
        """Add a thing, at rest; one of the same kind and name is replaced.

        Raises:
            RefusedError: there are too many, or it would overlap the arm; nothing changes then.
        """
        key, what = (thing.kind, thing.name), f"{thing.kind} {thing.name}"
        before = self._placed.get(key)
        if before is not None and before.thing is None:
            raise RefusedError(f"{what}: it is one of the scene's file, remove it first")
        most = MOST[thing.kind]
        if before is None and [kind for kind, _ in self._placed].count(thing.kind) >= most:
            raise RefusedError(f"{what}: there are {most} already, remove one first")
        # Beside the one that it replaces, which may have moved: that stays if this one is refused.
        self._n_added += 1
        name = f"{thing.kind} {self._n_added}"
        _add_body(self._spec, name, thing)
        self._recompile()
        touching = self._touching(name)
        # An obstacle, which cannot give way, must not touch anything.
        if touching and (self._arm in touching or not thing.mass):
            self._delete(name)
            raise RefusedError(f"{what}: the arm is where it should {_REFUSAL[thing.kind]}, move one of them")
        if before is not None:
            self.remove(*key)
        self._placed[key] = _Placed(name, thing)

    def remove(self, kind: str, name: str) -> None:
        """Take a thing or an obstacle away; RefusedError if there is none of this name."""
        self._delete(self._find(kind, name))
        del self._placed[kind, name]

    def _delete(self, body: str) -> None:
        self._spec.delete(self._spec.body(body))
        self._recompile()

    def _find(self, kind: str, name: str) -> str:
        if (kind, name) not in self._placed:
            known = [other for one, other in self._placed if one == kind]
            there = f"are {', '.join(known)}" if known else "is none"
            raise RefusedError(f"there is no {kind} {name!r}: there {there}")
        return self._placed[kind, name].body

    def move(self, name: str, pose: Vector6) -> None:
        """Put a thing elsewhere, at rest; RefusedError if there is none of this name."""
        joint = self._model.joint(self._find("thing", name))
        q, v = int(joint.qposadr[0]), int(joint.dofadr[0])
        self._data.qpos[q : q + 7] = (*pose[:3], *quaternion(pose[3:]))
        self._data.qvel[v : v + 6] = 0.0

    def state(self, name: str) -> ThingNow:
        """Where a thing is."""
        model, data = self._model, self._data
        body = self._find("thing", name)
        joint = model.joint(body)
        q, v = int(joint.qposadr[0]), int(joint.dofadr[0])
        turn, rotation = np.zeros(3), np.zeros(9)
        mujoco.mju_quat2Vel(turn, data.qpos[q + 3 : q + 7], 1.0)
        mujoco.mju_quat2Mat(rotation, data.qpos[q + 3 : q + 7])
        spin = rotation.reshape(3, 3) @ data.qvel[v + 3 : v + 6]  # MuJoCo has it in the thing's own axes
        return ThingNow(
            name,
            six([*data.qpos[q : q + 3].tolist(), *turn.tolist()]),
            six([*data.qvel[v : v + 3].tolist(), *spin.tolist()]),
            self._arm in self._touching(body),
        )

    @property
    def _arm(self) -> int:
        return int(self._model.body(LINKS[0]).id)

    def _touching(self, body: str) -> set[int]:
        """First bodies of the trees that touch that of a body; with itself, unless none does."""
        model = self._model
        pairs = model.body_rootid[model.geom_bodyid[self._data.contact.geom]]
        return set(pairs[(pairs == model.body(body).id).any(axis=1)].ravel().tolist())


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
    for wall in cell.walls:
        wide = body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_PLANE, size=[2.0, 2.0, 0.1], pos=np.multiply(wall.normal, wall.offset)
        )
        mujoco.mju_quatZ2Vec(wide.quat, np.array(wall.normal))
    for solid in cell.solids:
        geom = _add_shape(body, solid.shape, solid.sizes, solid.friction)
        geom.pos, geom.quat = solid.centre, quaternion(rpy_to_rotvec(solid.rpy))


def _add_body(spec: mujoco.MjSpec, name: str, thing: Thing) -> None:
    """Add a thing, or an obstacle, which is as stiff as the table."""
    body = spec.worldbody.add_body(name=name, pos=thing.pose[:3], quat=quaternion(thing.pose[3:]))
    geom = _add_shape(body, thing.shape, thing.size, thing.friction)
    geom.mass = thing.mass
    if not thing.mass:
        geom.solref, geom.solimp = CONTACT_SOLREF, CONTACT_SOLIMP
        return
    body.add_freejoint(name=name)
    geom.solref, geom.solimp, geom.condim = _SOLREF, _SOLIMP, 4


def _add_shape(body: mujoco.MjsBody, shape: str, size: tuple[float, ...], friction: float) -> mujoco.MjsGeom:
    kind = SHAPES[shape]
    return body.add_geom(type=kind.geom, size=kind.to_mujoco(size), friction=[friction, 0.005, 0.0001])
