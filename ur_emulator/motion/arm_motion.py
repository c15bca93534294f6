"""The motion of the arm: along the path of the program, displaced by overlays; and its stops.

Must not know scripts or physics.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

from ur_emulator.models.robot_model import ZERO6, Vector6, six
from ur_emulator.motion.generators import DirectTorque, Generator, JointTarget, StopJ, StopL, TorqueCommand
from ur_emulator.motion.overlay import Overlay, OverlayChain
from ur_emulator.motion.path_motion import HOLD, PathMotion, ReturnToPath

# The way of a slow arm: at its speed for this long [s], so that rounding is less. Chosen.
_LEAST_LOOK_AHEAD = 0.02


class ArmMotion(PathMotion):
    """The motion state of the arm.

    When a program ends, is replaced or killed during a motion, the leading axis brakes with
    `stop_deceleration`. Users call the real stop "abrupt"; its value is not published. Chosen: the value of
    the maker's tests of stop category 0, from the model of the arm.

    Attributes:
        stop_deceleration: of the leading axis [rad/s^2].
        path: target along the path of the program, which generators work on.
        target: of the joints; the same object as `path` unless overlays displace it.
    """

    def __init__(self, q: Vector6, stop_deceleration: float) -> None:
        super().__init__(q)
        self.stop_deceleration = stop_deceleration
        self.target = self.path
        self._chain = OverlayChain()
        self._overlays = self._chain.overlays

    def way_to_rest(self, target: JointTarget) -> Iterator[Vector6]:
        """Yield the joint angles half way and at rest if the arm was stopped at a target [rad]."""
        allowed = inf if self.braking is None else self.braking(target)
        braking_time = max(map(abs, target.qd)) / (2.0 * min(self.stop_deceleration, allowed))
        for share in (0.5, 1.0):
            time = share * max(braking_time, _LEAST_LOOK_AHEAD)
            yield six([q + qd * time for q, qd in zip(target.q, target.qd, strict=True)])

    @property
    def is_moving(self) -> bool:
        """True while a generator or an overlay moves the arm, unless a pause has stopped it."""
        return (self._generator is not HOLD or bool(self._overlays)) and not self.is_paused

    @property
    def is_paused(self) -> bool:
        """True when a pause has brought the arm to rest."""
        return self._time_scaling.paused and not any(self.target.qd)

    @property
    def torque(self) -> TorqueCommand | None:
        """What the drives shall give; None where they follow `target`."""
        generator = self._generator
        return generator.command if isinstance(generator, DirectTorque) else None

    def command_torque(self, owner: object, generator: DirectTorque) -> None:
        """Drive the arm by torque for `owner` in the next cycle; overlays end.

        Raises:
            OwnershipError: another owner has the arm.
        """
        self.command(owner, generator)
        self._chain.clear()

    # --- stops

    def release(self, owner: object) -> None:
        """End the ownership of `owner`, if it has the arm, and stop its motion at once.

        A move whose instruction has returned for a blend continues to its waypoint: the end of a program is
        the same with and without a blend in its last move.
        """
        if self._owner is owner:
            move = self._move
            if move is not None and move.returned:
                self._owner = None
            else:
                self.stop(self.stop_deceleration)

    def stop(self, deceleration: float) -> None:
        """Take the arm from its owner and ramp it to rest, leading axis at `deceleration` [rad/s^2].

        All overlays and a pause end; the path continues from the displaced target.
        """
        self._abandon()
        self._brake(deceleration)
        self._time_scaling.reset()

    def place(self, q: Vector6, qd: Vector6 = ZERO6) -> None:
        """Set the target to `q` [rad], where the joints are without a motion of the program.

        If they still move, with `qd` [rad/s], they are ramped to rest. A paused move returns to its path from
        there.
        """
        if self._time_scaling.paused:
            self._suspend()
        else:
            self._abandon()
        self._owner = None
        self._generator = HOLD
        self._chain.clear()
        self.path = self.target = JointTarget(q, qd)
        if any(qd):
            self._generator = StopJ(self.stop_deceleration)

    def retract(self, target: JointTarget) -> None:
        """Undo the last step: `target` is the one before it."""
        self._chain.clear()
        self.path = self.target = target
        if (move := self._move) is not None:
            move.take_back()

    def _brake(self, deceleration: float) -> None:
        self._owner = None
        if self._generator is not HOLD or self._overlays:
            self._take_over_target()
            self._generator = StopJ(deceleration)

    def interrupt(self, deceleration: float) -> None:
        """Pause by a stop that leaves the path: leading axis at `deceleration` [rad/s^2].

        Overlays end, and with them a move that they displace.
        """
        if self._overlays:
            self._abandon()
        else:
            self._suspend()
        self._brake(deceleration)
        self._time_scaling.paused = self._is_special = True
        self._time_scaling.factor = 0.0

    def abort(self) -> None:
        """End a movej or movel, as one whose waypoint is where the arm comes to rest.

        The leading axis brakes with `stop_deceleration`. A real arm does not come to rest if the move has a
        blend radius: it blends into the next one.
        """
        if (move := self._move) is not None and not move.leg.process:
            self._abandon()
            self._brake(self.stop_deceleration)

    # --- overlays

    def add_overlay(self, overlay: Overlay) -> None:
        """Add an overlay from the next cycle on, after those that are active already."""
        self._chain.add(overlay, self.target)
        self._is_special = True

    def has_overlay(self, overlay: Overlay) -> bool:
        """True while an overlay is active."""
        return overlay in self._overlays

    def remove_overlay(self, overlay: Overlay) -> None:
        """End an overlay, if it is active; the arm keeps its last displacement.

        A move or another overlay continues with that displacement.
        """
        if overlay in self._overlays:
            self._chain.keep_last(overlay)
            if self._chain.all_ended and self._move is None:
                self._take_over_target()
                if self._generator is HOLD and any(self.path.qd):
                    self._generator = StopJ(self.stop_deceleration)

    def _may_settle(self) -> bool:
        """True when all overlays have ended, and the move that they displaced has ended at rest."""
        if not self._chain.all_ended or self._move is not None:
            return False
        return self._generator is not HOLD or not any(self.target.qd)

    def _take_over_target(self) -> None:
        self._chain.clear()
        self.path = self.target

    # --- cycle

    def step(self, dt: float, scale: float) -> JointTarget:
        """Advance one cycle and return the new target.

        Args:
            dt: duration of a cycle [s].
            scale: commanded speed scaling, 0..1; during a motion it is reached gradually.

        Raises:
            UnreachableError: the arm cannot reach the path there.
        """
        if self._is_special:
            return self._special_step(dt, scale)
        if self._generator is HOLD:
            if any(self.target.qd) or any(self.target.qdd):
                self.path = self.target = self.target.at_rest()
            self._scale = scale
            return self.target
        self.target = self._advance(dt, scale, 1.0)
        return self.target

    def _special_step(self, dt: float, scale: float) -> JointTarget:
        """Step with overlays or in a pause."""
        before = self.target
        time_factor = self._time_scaling.step(dt)
        if time_factor > 0.0 or _brakes(self._generator):
            path = self._advance(dt, scale, time_factor)
        else:
            path = self.path = self.path if not any(self.path.qd) else self.path.at_rest()
        if not self._overlays:
            self.target = path
        elif time_factor > 0.0 or any(path.qd):
            self.target = self._chain.displace(path, before, dt, time_factor)
            if self._may_settle():
                self._take_over_target()
        elif any(before.qd) or any(before.qdd):
            self.target = before.at_rest()
        self._is_special = bool(self._overlays) or not self._time_scaling.is_normal
        return self.target


def _brakes(generator: Generator) -> bool:
    """True for generators that brake; they do so in a pause too."""
    return isinstance(generator, StopJ | StopL) or (
        isinstance(generator, ReturnToPath) and generator.is_braking
    )
