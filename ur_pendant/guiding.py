"""The arm in somebody's hand: joints that are jogged, a tool that is dragged, and pulls at the arm.

All of it is done by the thread of the window but errands, which only read what they use.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Set
from dataclasses import replace
from enum import Enum
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from pc_client.arrays import Array
from pc_client.kinematics.model import RobotModel, solve_ik
from protocol.pose import pose_inv, pose_to_T
from protocol.ur_types import ProgramState, RobotMode
from ur_emulator.machine.commands.surroundings import MAX_FORCE
from ur_pendant.drawing import ArmDrawing, RobotDrawing
from ur_pendant.hands import ACCELERATION, Errands, HandError, Hands
from ur_pendant.robot import Robot, numbers
from ur_pendant.server import PageServer

JOG_RATE = 10.0  # How often a button that is held is heard [Hz],
_RELEASED = 0.3  # and for how long it is not, when it has been released [s].
AHEAD = 0.15  # By how much a button may ask a joint to be ahead of itself [rad].
_LAG = 0.06  # From a measurement to its effect on the goal [s].
JUMP = 0.5  # How far a joint may go for a step of a tool that is dragged [rad].
STIFFNESS = 200.0  # Of the spring that pulls at the arm, as hard as a box can be pushed [N/m].
_PUSH_EVERY, _PUSH_LASTS = 0.2, 0.3  # s


class Workspace(NamedTuple):
    """A robot of a window, what shows it, and what has something done to it."""

    server: PageServer
    robot: Robot
    hands: Hands
    drawing: RobotDrawing
    errands: Errands


class Hold(Enum):
    """How the arm is held."""

    FREE, JOGGED, DRAGGED, PULLED = range(4)


NEXT: Mapping[Hold, Mapping[str, Hold]] = {
    Hold.FREE: {"jog": Hold.JOGGED, "drag": Hold.DRAGGED, "pull": Hold.PULLED},
    Hold.JOGGED: {"jog": Hold.JOGGED, "drag": Hold.DRAGGED, "pull": Hold.PULLED, "jog end": Hold.FREE},
    Hold.DRAGGED: {"jog": Hold.JOGGED, "drag": Hold.DRAGGED, "pull": Hold.PULLED, "drag end": Hold.FREE},
    Hold.PULLED: {"jog": Hold.JOGGED, "drag": Hold.DRAGGED, "pull": Hold.PULLED, "pull end": Hold.FREE},
}
"""By what people do: the newest hand takes the arm, and only its own end lets it go."""


def jogged(goal: Array, q: Array, joint: int, step: float, model: RobotModel) -> Array:
    """The goal (6,) after a step of a joint, with the joints at q (6,) now [rad]."""
    limits, wanted = model.limits, goal.copy()
    ahead = np.clip(goal[joint] + step, q[joint] - AHEAD, q[joint] + AHEAD)
    wanted[joint] = np.clip(ahead, limits.q_min[joint], limits.q_max[joint])
    return wanted


def reached(model: RobotModel, T_base_flange: Array, q: Array) -> Array:
    """The posture (6,) near q (6,) [rad] with the flange at a pose (4, 4). HandError without one."""
    found, limits = solve_ik(replace(model, tcp_frame=model.flange_frame), T_base_flange, q), model.limits
    is_near = (found.q >= limits.q_min) & (found.q <= limits.q_max) & (np.abs(found.q - q) <= JUMP)
    if not (found.converged and is_near.all()):
        raise HandError("the arm stays: there is out of reach, beyond a joint's limit, or too far at once")
    return found.q


def pulled(grip: Array, end: Array) -> Array:
    """The force (3,) of a spring from one point to another (3,) [N, m]."""
    force = STIFFNESS * (end - grip)
    return force * min(1.0, MAX_FORCE / max(float(np.linalg.norm(force)), 1e-9))


class Guiding:
    """A frame at the tool of an arm, to be dragged, an arrow where it is pulled, and what moves the arm."""

    def __init__(self, workspace: Workspace, arm: ArmDrawing) -> None:
        server, self._robot, self._hands, self._drawing, self._errands = workspace
        self.arm = arm
        self.hold = Hold.FREE
        self._heard = self._pushed = 0.0
        self._placed = np.zeros((4, 4))
        self._followed = np.empty(6)
        self._pull: Any = None
        self._grip = np.zeros(3)
        name, scene = self._drawing.root.name, server.scene
        self.frame = scene.add_transform_controls(f"{name}/hand", 0.25, depth_test=False, visible=False)
        look = {"shaft_radius": 0.006, "head_radius": 0.014, "head_length": 0.03, "visible": False}
        self.arrow = scene.add_arrows(f"{name}/pull", np.zeros((1, 2, 3)), (230, 60, 160), **look)
        self.frame.on_update(server.events.entry(self._drag, _read_drag))
        self._enter_pull = server.events.entry(self._take, lambda event: (event,))
        self._pullable: Set[str] = frozenset()

    def remove(self) -> None:
        """Take the frame and the arrow away."""
        for node in self._drawing.solids:
            node.remove_drag_callback(self._enter_pull)
        self.frame.remove()
        self.arrow.remove()

    # --- what people do

    def jog(self, client: Any, joint: int, step: float) -> None:
        """Take a button that is held: the joint goes on by a step [rad]."""
        self._change("jog")
        self._heard = time.monotonic()
        self._errands.ask(client, partial(self._step, joint, step), "jog")

    def release(self, client: Any = None) -> None:
        """Take the end of it."""
        self._change("jog end")
        self._errands.ask(client, self._rest, "jog")

    def go(self, client: Any, q: Array, kind: str = "go") -> None:
        """Have the arm go to a posture (6,) [rad]."""
        self._errands.ask(client, partial(self._go, q), kind)

    def _drag(self, client: Any, phase: str, T_base_tcp: Array) -> None:
        """Take where the frame is: the arm follows to each pose in reach, its way says with which posture."""
        self._change("drag end" if phase == "end" else "drag")
        self._placed = T_base_tcp
        if phase == "start":
            self._followed = self._measured("actual_q")
            return
        T_tcp_flange = pose_to_T(pose_inv(numbers(self._robot.values, "tcp_offset") or (0.0,) * 6))
        try:
            self._followed = reached(self.arm.model, T_base_tcp @ T_tcp_flange, self._followed)
        except HandError as error:
            self._errands.tell(client, "Not done", str(error))
        else:
            self.go(client, self._followed, "drag")

    def _take(self, client: Any, event: Any) -> None:
        """Take where somebody pulls at what the flange carries; a box is pushed nowhere else."""
        if event.target.name in {link.name for link in self.arm.links[:-1]}:
            if event.phase == "start":
                refusal = "pull at the last link or at the tool: a box is pushed there"
                self._errands.tell(client, "Not done", refusal)
            return
        self._change("pull end" if event.phase == "end" else "pull")
        flange, base = self.arm.T_base_flange, self._drawing.root.position
        self._grip = (np.array(event.start_position) - base - flange[:3, 3]) @ flange[:3, :3]
        self._pull = event

    def _change(self, what: str) -> None:
        self.hold = NEXT[self.hold].get(what, self.hold)

    # --- thirty times a second

    def update(self, *, can_drag: bool) -> None:
        """Show the frame and the arrow, push, and hear that a button is held no more."""
        now, T = time.monotonic(), self._drawing.T_base_tcp
        if self.hold is Hold.JOGGED and now - self._heard > _RELEASED:
            self.release()
        mode, program = (self._robot.values.get(name) for name in ("robot_mode", "runtime_state"))
        is_free = program == ProgramState.STOPPED or self._hands.goal is not None  # no program has the arm
        self.frame.visible = can_drag and mode == RobotMode.RUNNING and is_free
        if self.frame.visible and self.hold is not Hold.DRAGGED and np.abs(T - self._placed).max() > 1e-5:
            self._placed = T
            self.frame.position, self.frame.wxyz = T[:3, 3], np.roll(pin.Quaternion(T[:3, :3]).coeffs(), 1)
        self.arrow.visible = self.hold is Hold.PULLED
        if self.hold is Hold.PULLED:
            self._push(now)

    def _push(self, now: float) -> None:
        flange = self.arm.T_base_flange
        point = flange[:3, :3] @ self._grip + flange[:3, 3]
        force = pulled(point, np.array(self._pull.end_position) - self._drawing.root.position)
        self.arrow.points = np.array([[point, point + force / STIFFNESS]])
        if now - self._pushed >= _PUSH_EVERY:
            self._pushed = now
            given = {"force": force.tolist(), "point": self._grip.tolist(), "duration": _PUSH_LASTS}
            self._errands.ask(self._pull.client, partial(self._hands.operate, "push", **given), "push")

    def offer_pulls(self) -> None:
        """Let people pull at what is there now."""
        nodes = {node.name: node for node in self._drawing.solids}
        for name in nodes.keys() - self._pullable:
            nodes[name].on_drag("left")(self._enter_pull)
        self._pullable = nodes.keys()

    # --- errands

    def _step(self, joint: int, step: float) -> None:
        goal = self._measured("target_q") if self._hands.goal is None else self._hands.goal
        self._go(jogged(goal, self._measured("actual_q"), joint, step, self.arm.model))

    def _rest(self) -> None:
        """Let the arm come to rest: the goal is where its ramp ends."""
        qd = self._measured("target_qd")
        if self._hands.goal is not None:
            self._hands.follow(self._measured("target_q") + qd * (_LAG + np.abs(qd) / (2.0 * ACCELERATION)))

    def _go(self, q: Array) -> None:
        if self._robot.values.get("robot_mode") != RobotMode.RUNNING:
            raise HandError("the arm must be RUNNING: power it on, release the brakes")
        self._hands.follow(q)

    def _measured(self, name: str) -> Array:
        return np.array(numbers(self._robot.values, name))


def _read_drag(event: Any) -> tuple[str, Array]:
    """Phase of a drag, and where the frame is (4, 4) below the base."""
    frame = event.target
    pose = pin.XYZQUATToSE3(np.append(frame.position, np.roll(frame.wxyz, -1)))
    return event.phase, pose.homogeneous
