"""Where the arm is asked to go: along the path of the program, displaced by overlays; and its stops.

Must not know scripts or physics.
"""

from __future__ import annotations

from ur_emulator.models.robot_model import ZERO6, Vector6
from ur_emulator.motion.generators import Generator, StopJ
from ur_emulator.motion.overlay import Overlay, OverlayChain
from ur_emulator.motion.path_motion import HOLD, PathMotion
from ur_emulator.motion.pause import ReturnToPath
from ur_emulator.motion.speed_l import StopL
from ur_emulator.motion.target import JointTarget


class ArmMotion(PathMotion):
    """The motion state of the arm.

    When a program ends, is replaced or killed while the arm moves, the leading axis brakes with
    `stop_deceleration`. Users call the real stop "abrupt"; its number is not published. Chosen: that of the
    maker's tests of stop category 0, which the model of the arm holds.

    Attributes:
        stop_deceleration: of the leading axis [rad/s^2].
        path: target along the path of the program; what generators see.
        target: what the joints get; the same object as `path` unless overlays displace it.
    """

    def __init__(self, q: Vector6, stop_deceleration: float) -> None:
        super().__init__(q)
        self.stop_deceleration = stop_deceleration
        self.target = self.path
        self._chain = OverlayChain()
        self._overlays = self._chain.overlays

    @property
    def is_moving(self) -> bool:
        """True unless the target stands still and nothing is about to move it."""
        return (self._generator is not HOLD or bool(self._overlays)) and not self.is_paused

    @property
    def is_paused(self) -> bool:
        """True when a pause has brought the arm to rest."""
        return self._time_scaling.paused and not any(self.target.qd)

    # --- stops

    def release(self, owner: object) -> None:
        """End the ownership of `owner`, if it has it; a motion still under way is stopped at once.

        A move whose instruction has ended for a blend is on its last way to the waypoint and may arrive: a
        program that ends with it is no different from one whose last move does not blend.
        """
        if self._owner is owner:
            move = self._move
            if move is not None and move.returned:
                self._owner = None
            else:
                self.stop(self.stop_deceleration)

    def stop(self, deceleration: float) -> None:
        """Take the arm from whoever has it and ramp it to rest, leading axis at `deceleration` [rad/s^2].

        All overlays end; where they have led the arm is part of the path from then on. So does a pause.
        """
        self._abandon()
        self._brake(deceleration)
        self._time_scaling.reset()

    def place(self, q: Vector6, qd: Vector6 = ZERO6) -> None:
        """Set the target to `q` [rad], without a path: the joints were moved by something else.

        If they still move, with `qd` [rad/s], they are ramped to rest. In a pause, what was under way goes on
        from there.
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
        """Take back the last step: `target` is the one from before it."""
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
        """Pause without regard for the path: ramp to rest, leading axis at `deceleration` [rad/s^2].

        Overlays end, and with them a move that they have led away from its path.
        """
        if self._overlays:
            self._abandon()
        else:
            self._suspend()
        self._brake(deceleration)
        self._time_scaling.paused = self._is_special = True
        self._time_scaling.factor = 0.0

    # --- overlays

    def add_overlay(self, overlay: Overlay) -> None:
        """Let an overlay displace the tool from the next cycle on, after those that are active already."""
        self._chain.add(overlay, self.target)
        self._is_special = True

    def has_overlay(self, overlay: Overlay) -> bool:
        """True while an overlay is active."""
        return overlay in self._overlays

    def remove_overlay(self, overlay: Overlay) -> None:
        """End an overlay, if it is active; the arm stays where it has led it.

        A move under way, or another overlay, goes on displaced by what there is of this one.
        """
        if overlay in self._overlays:
            self._chain.keep_last(overlay)
            if self._chain.all_ended and self._move is None:
                self._take_over_target()
                if self._generator is HOLD and any(self.path.qd):
                    self._generator = StopJ(self.stop_deceleration)

    def _may_settle(self) -> bool:
        """True when no overlay acts any more, no move is on a displaced path nor has only just ended."""
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
            scale: speed scaling of the trajectory asked for, 0..1; a moving arm takes it on gradually.

        Raises:
            UnreachableError: the move's path leads where the arm cannot be.
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
        """Do a cycle with overlays or in a pause."""
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
    """True for what comes to rest by itself, in a pause too."""
    return isinstance(generator, StopJ | StopL) or (
        isinstance(generator, ReturnToPath) and generator.is_braking
    )
