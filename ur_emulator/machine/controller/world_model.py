"""WorldModel: named frames, what they are attached to, and what they weigh.

A frame has a parent and a pose in it. The origin of the world stays; "base" begins there and programs may
move it; "flange" and "tcp" follow from the target of the arm. Frames stay when a program ends.
Source: script manual e-Series 5.2x, module world model; the maker's MotionPlus 1.1 and 1.2, world model (what
attaching, deleting and moving does). Chosen: flange and TCP are those of the target; the axes of `get_pose`
are those of its second frame if it gets no third one; a payload is what hangs on flange or TCP.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from protocol.pose import Pose, pose_inv, pose_trans, rotvec_to_matrix
from ur_emulator.machine.controller.settings import Payload, ToolSettings
from ur_emulator.machine.models.robot_model import ZERO6, six
from ur_hil.arithmetic import add_up

WORLD, BASE, FLANGE, TCP = "world", "base", "flange", "tcp"
_OWN = (WORLD, BASE, FLANGE, TCP)
# Frames that programs can add: the pose of one at the end of a chain of so many takes 80 µs.
MAX_FRAMES = 50


class WorldModelError(ValueError):
    """A program asks for what the frames do not allow; the message names the frame."""


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame that programs can move; its pose is in its parent, the frame that it is attached to."""

    parent: str = WORLD
    pose: Pose = ZERO6


class WorldModel:
    """The frames of a controller; `flange_pose` gives the pose of the flange in the base.

    All methods raise WorldModelError for a frame that does not exist.
    """

    def __init__(self, flange_pose: Callable[[], Pose], tool: ToolSettings) -> None:
        self._flange_pose = flange_pose
        self._tool = tool
        self.reset()

    def reset(self) -> None:
        """Delete all that was added, and put the base at the origin."""
        self._frames = {BASE: Frame()}
        self._masses: dict[str, Payload] = {}

    def __contains__(self, name: str) -> bool:
        return name in _OWN or name in self._frames

    def parent(self, name: str) -> str:
        """Return what a frame is attached to; WorldModelError for the world."""
        return self._placed(name).parent

    def children(self, name: str) -> list[str]:
        """Return the frames that are attached to one, the oldest first."""
        self._require(name)
        return [frame for frame in (*self._frames, FLANGE, TCP) if self.parent(frame) == name]

    def pose(self, name: str, seen_from: str = WORLD) -> Pose:
        """Return the pose of a frame in another one."""
        self._require(name)
        self._require(seen_from)
        above = set(self._chain(seen_from))
        common = next(frame for frame in self._chain(name) if frame in above)
        return pose_trans(pose_inv(self._pose_in(common, seen_from)), self._pose_in(common, name))

    def relative_pose(self, name: str, seen_from: str, axes_of: str) -> Pose:
        """Return the pose of a frame in another one, its vectors turned into the axes of a third one."""
        pose = self.pose(name, seen_from)
        if axes_of == seen_from:
            return pose
        turn = rotvec_to_matrix(self.pose(seen_from, axes_of)[3:])
        return six([*(turn @ pose[:3]).tolist(), *(turn @ pose[3:]).tolist()])

    def convert(self, pose: Pose, from_frame: str, to_frame: str) -> Pose:
        """Return a pose of one frame in another one."""
        return pose_trans(self.pose(from_frame, to_frame), pose)

    def add(self, name: str, pose: Pose, reference: str) -> None:
        """Add a frame to the world, at a pose in the reference frame, to which it is not attached.

        WorldModelError if the name is taken or empty, or if there are too many frames.
        """
        if not name or name in self:
            raise WorldModelError(f'"{name}" is no name for a new frame; allowed: one that no frame has')
        if len(self._frames) > MAX_FRAMES:
            raise WorldModelError(f"there are {MAX_FRAMES} frames already, delete one first")
        self._frames[name] = Frame(pose=pose_trans(self.pose(reference), pose))

    def attach(self, child: str, parent: str) -> None:
        """Attach a frame to another one; it stays where it is. WorldModelError: the chain would be closed."""
        frame = self._movable(child)
        self._require(parent)
        if child in self._chain(parent):
            raise WorldModelError(f'"{child}" cannot be attached to "{parent}", which is attached to it')
        self._frames[child] = replace(frame, parent=parent, pose=self.pose(child, parent))

    def move(self, name: str, pose: Pose, reference: str) -> None:
        """Place a frame anew, at a pose in the reference frame; what is attached to it comes along.

        WorldModelError for a frame that programs cannot move.
        """
        frame = self._movable(name)
        in_world = pose_trans(self.pose(reference), pose)
        in_parent = pose_trans(self.pose(WORLD, frame.parent), in_world)
        self._frames[name] = replace(frame, pose=in_parent)

    def delete(self, name: str) -> None:
        """Delete a frame; what is attached to it stays where it is, attached to the world.

        WorldModelError for a frame of the robot.
        """
        self._require(name)
        if name in _OWN:
            raise WorldModelError(f'"{name}" cannot be deleted, it belongs to the robot')
        in_world = self.pose(name)
        for child, frame in list(self._frames.items()):
            if frame.parent == name:
                self._frames[child] = Frame(pose=pose_trans(in_world, frame.pose))
        del self._frames[name]
        self._masses.pop(name, None)

    def delete_all(self) -> None:
        """Delete all frames that were added."""
        self.attach(BASE, WORLD)
        self._frames = {BASE: self._frames[BASE]}
        self._masses = {name: payload for name, payload in self._masses.items() if name in _OWN}

    def set_mass(self, name: str, payload: Payload) -> None:
        """Set mass, centre of gravity and inertia of a frame, in its own axes."""
        self._require(name)
        self._masses[name] = payload

    def attached_payload(self) -> Payload:
        """Return what all frames that hang on flange or TCP weigh together, in the flange frame."""
        parts = [
            (payload, self.pose(name, FLANGE))
            for name, payload in self._masses.items()
            if FLANGE in self._chain(name) and payload.mass > 0.0
        ]
        mass = add_up(payload.mass for payload, _ in parts)
        if not parts:
            return Payload()
        places = [np.array(pose_trans(pose, (*payload.cog, 0.0, 0.0, 0.0))[:3]) for payload, pose in parts]
        weighted = [payload.mass * place for (payload, _), place in zip(parts, places, strict=True)]
        cog = np.sum(weighted, axis=0) / mass
        total = np.zeros((3, 3))
        for (payload, pose), place in zip(parts, places, strict=True):
            turn = rotvec_to_matrix(pose[3:])
            xx, yy, zz, xy, xz, yz = payload.inertia
            arm = place - cog
            total += turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
            total += payload.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        x, y, z = cog.tolist()
        inertia = (*np.diag(total).tolist(), float(total[0, 1]), float(total[0, 2]), float(total[1, 2]))
        return Payload(mass, (x, y, z), inertia=six(inertia))

    def _require(self, name: str) -> None:
        if name not in self:
            raise WorldModelError(f'there is no frame "{name}", add it with add_frame')

    def _movable(self, name: str) -> Frame:
        self._require(name)
        if name not in self._frames:
            raise WorldModelError(f'"{name}" cannot be placed by a program; allowed: "base" and added frames')
        return self._frames[name]

    def _placed(self, name: str) -> Frame:
        """Return where a frame is that has a parent."""
        if name == FLANGE:
            return Frame(BASE, self._flange_pose())
        if name == TCP:
            return Frame(FLANGE, self._tool.tcp_offset)
        self._require(name)
        if name == WORLD:
            raise WorldModelError('"world" is attached to nothing')
        return self._frames[name]

    def _chain(self, name: str) -> Iterator[str]:
        """Yield a frame, what it is attached to, and so on up to the world."""
        while name != WORLD:
            yield name
            name = self.parent(name)
        yield WORLD

    def _pose_in(self, above: str, name: str) -> Pose:
        """Return the pose of a frame in one that it is attached to, through others perhaps."""
        pose = ZERO6
        while name != above:
            frame = self._placed(name)
            pose = pose_trans(frame.pose, pose)
            name = frame.parent
        return pose
