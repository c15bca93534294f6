"""The motion of the arm: along the path of the program, displaced by overlays; its pauses and its stops.

`ownership.TABLE` says who has the arm and what takes it from whom: here is what computes the set-point. Only
one script thread moves the arm at a time. Must not know scripts or physics: an owner is any object, compared
by identity.
"""

from collections.abc import Callable, Iterator, Sequence
from math import inf

from ur_emulator.machine.models.robot_model import Vector6, six
from ur_emulator.machine.motion.generators import (
    DirectTorque,
    Generator,
    JointTarget,
    Kind,
    StopJ,
    Streamed,
    TorqueCommand,
)
from ur_emulator.machine.motion.leg import move_j
from ur_emulator.machine.motion.move import Move
from ur_emulator.machine.motion.overlay import Overlay, OverlayChain
from ur_emulator.machine.motion.ownership import TRANSITIONS, ArmState, Command, Event, Fate
from ur_emulator.machine.motion.path_time import PAUSE_RATE, PathTime
from ur_emulator.machine.motion.stream_delay import StreamDelay

# Leading axis on the return to the path [rad/s, rad/s^2]. Chosen: slow.
RETURN_SPEED, RETURN_ACCELERATION = 0.25, 1.0
# Rate of change of the speed scaling [1/s], so that the joint speeds have no step. Chosen.
SCALING_RATE = 4.0

# The way of a slow arm: at its speed for this long [s], so that rounding is less. Chosen.
_LEAST_LOOK_AHEAD = 0.02

_AT_REST = frozenset({ArmState.HOLDING, ArmState.SUSPENDED})
_IN_TIME = frozenset({ArmState.MOVING, ArmState.RETURNING})
_BRAKING, _BY_HAND = ArmState.BRAKING, ArmState.BY_HAND


class OwnershipError(Exception):
    """Another owner has the arm, or a pause stands."""


class ArmMotion:
    """What the arm does, the command that has it, overlays, and the joint target that follows.

    When a program ends, is replaced or killed during a motion, the leading axis brakes with
    `stop_deceleration`. Users call the real stop "abrupt"; its value is not published. Chosen: the value of
    the maker's tests of stop category 0, from the model of the arm.

    Attributes:
        stop_deceleration: of the leading axis in every stop [rad/s^2].
        state: what the arm does along the path.
        path: target along the path of the program, which generators work on.
        target: of the joints; the same object as `path` unless overlays displace it or a hand guides the arm.
        overlays: those that are active, to be asked only.
        scale: speed scaling of the last cycle, 0..1.
        scaling_rate: rate of change of the speed scaling [1/s].
        braking: gives the greatest deceleration of the leading axis [rad/s^2] that the drives can give in a
            stop, in the direction of the path's velocity; at first infinite.
    """

    def __init__(
        self,
        q: Vector6,
        stop_deceleration: float,
        run_up_time: float = 0.0,
        dead_cycles: Sequence[int] = (0,),
    ) -> None:
        """Hold the arm at `q` [rad].

        Args:
            run_up_time: so long the time on the path of a program's first move runs up [s].
            dead_cycles: of streamed commands, see `StreamDelay`.
        """
        self.stop_deceleration = stop_deceleration
        self.path = self.target = JointTarget(q)
        self.braking: Callable[[JointTarget], float] = lambda target: inf
        self.scaling_rate = SCALING_RATE
        self.scale = 1.0
        self.state = ArmState.HOLDING
        self._command: Command | None = None
        # What brings the arm to rest, or back to its path.
        self._ramp: Generator = StopJ(stop_deceleration)
        self._delay = StreamDelay(dead_cycles)
        self._measure: Callable[[], JointTarget] = lambda: self.path
        self._has_followed_hand = False
        self._time = PathTime()
        self._run_up_time = run_up_time
        self._begins_program = False
        self._chain = OverlayChain()
        self.overlays = self._chain.overlays

    # --- what others ask

    @property
    def owner(self) -> object | None:
        """The object that has the arm, or None."""
        return None if self._command is None else self._command.owner

    @property
    def move(self) -> Move | None:
        """The current move, also while it is suspended."""
        command = self._command
        return command.generator if command is not None and isinstance(command.generator, Move) else None

    @property
    def goal(self) -> Vector6:
        """Joint angles at the next waypoint; those of the path if there is none [rad]."""
        goal = None if (move := self.move) is None else move.goal
        return self.path.q if goal is None else goal

    @property
    def is_moving(self) -> bool:
        """True while a command, a ramp or an overlay moves the arm, unless a pause has stopped it."""
        if self.state is _BY_HAND:
            return self._command is not None and not self._time.paused
        return (self.state not in _AT_REST or bool(self.overlays)) and not self.is_paused

    @property
    def is_paused(self) -> bool:
        """True when a pause has brought the arm to rest; a hand may still guide it."""
        time = self._time
        return time.paused and time.factor == 0.0 and self.state in (ArmState.SUSPENDED, _BY_HAND)

    @property
    def is_returning(self) -> bool:
        """True while a move that goes on comes to rest first, and then back to the path that it has left."""
        if self.state is _BRAKING:
            return self.move is not None and not self._time.paused
        return self.state is ArmState.RETURNING

    @property
    def is_compliant(self) -> bool:
        """True while the target follows the measured arm: in freedrive, and in control by torque."""
        return self.state is _BY_HAND or self.state is ArmState.BY_TORQUE

    @property
    def torque(self) -> TorqueCommand | None:
        """What the drives shall give; None where they follow `target`."""
        if self.state is ArmState.BY_TORQUE and self._command is not None:
            generator = self._command.generator
            return generator.command if isinstance(generator, DirectTorque) else None
        return None

    def way_to_rest(self, target: JointTarget) -> Iterator[Vector6]:
        """Yield the joint angles half way and at rest if the arm was stopped at a target [rad]."""
        deceleration = min(self.stop_deceleration, self.braking(target))
        braking_time = max(map(abs, target.qd)) / (2.0 * deceleration)
        for share in (0.5, 1.0):
            time = share * max(braking_time, _LEAST_LOOK_AHEAD)
            yield six([q + qd * time for q, qd in zip(target.q, target.qd, strict=True)])

    # --- what threads do

    def command_of(self, owner: object) -> Command | None:
        """Return the command of `owner`, if it has the arm."""
        return self._command if self._command is not None and self._command.owner is owner else None

    def command(self, owner: object, generator: Generator) -> Command:
        """Move the arm for `owner` from the next cycle on.

        OwnershipError if another owner has the arm, or a pause stands. Overlays end where torque begins.
        """
        before, kind = self._command, generator.kind
        if self._time.paused or (self.owner is not None and self.owner is not owner):
            raise OwnershipError
        if before is not None:
            if isinstance(before.generator, Streamed):
                before.generator.when_replaced(generator)
            before.fate = Fate.TAKEN
        self._command = command = Command(owner, generator, self.path.q)
        self._go(Event.COMMAND)
        if kind is Kind.STOP:
            self._ramp = generator
        elif kind is not Kind.STREAM:
            self._delay.clear()
            if kind is Kind.TORQUE:
                self._drop_overlays()
        if self._begins_program:
            self._begins_program = False
            if kind is Kind.MOVE:
                self._time.begin(1.0 / self._run_up_time, runs_up=True)
        return command

    def release(self, owner: object) -> None:
        """End the ownership of `owner`, if it has the arm, and stop its motion at once.

        A move whose instruction has returned for a blend continues to its waypoint: the end of a program is
        the same with and without a blend in its last move.
        """
        command = self.command_of(owner)
        if command is not None and isinstance(command.generator, Move) and command.generator.returned:
            command.owner = None
        elif command is not None:
            self._brake(Event.TAKEN, at_once=False)

    # --- programs: they begin, pause, go on and end

    def begin_program(self) -> None:
        """Let the time on the path run up in the first motion that follows, if that is a move."""
        self._begins_program = self._run_up_time > 0.0

    def pause(self, deceleration: float = 0.0) -> None:
        """Ramp the arm to rest on its path; a stream is stopped; overlays stand still too.

        `deceleration` of the leading axis [rad/s²], if that is faster than PAUSE_RATE.
        """
        time, generator = self._time, None if self._command is None else self._command.generator
        if time.paused:
            return
        time.paused = True
        self._delay.clear()
        speed = max(map(abs, self.target.qd))
        time.slowing = max(PAUSE_RATE, deceleration * time.factor / speed if speed > 0.0 else 0.0)
        if isinstance(generator, Streamed):
            self._go(Event.PAUSE, StopJ(deceleration) if deceleration else generator.when_paused())
        else:
            self._go(Event.PAUSE)
        if self.state not in _IN_TIME and not self.overlays:
            time.factor = 0.0

    def resume(self) -> None:
        """End a pause: a move continues, and a stream if it is renewed in this cycle."""
        if not self._time.paused:
            return
        self._time.resume()
        if self._command is not None:
            self._command.is_renewed = True
        self._go(Event.RESUME)
        self._turn_back()

    def interrupt(self) -> None:
        """Pause by a stop that leaves the path. Overlays end, and with them a move that they displace."""
        self.let_go()
        if self.overlays:
            if self.move is not None:
                self._brake(Event.TAKEN)
            self._drop_overlays()
        self._brake(Event.INTERRUPT)
        self._time.paused = True
        self._time.factor = 0.0

    def abort(self) -> None:
        """End a movej or movel, as one whose waypoint is where the arm comes to rest.

        The leading axis brakes with `stop_deceleration`. A real arm does not come to rest if the move has a
        blend radius: it blends into the next one.
        """
        if (move := self.move) is not None and not move.leg.process:
            self._brake(Event.TAKEN)

    def stop(self, *, at_once: bool = False) -> None:
        """Take the arm from its owner and ramp it to rest; all overlays and a pause end.

        Unless it is at once, the ramp has the dead time of a stream: a program that replaces another one in
        this cycle continues its stream without a gap.
        """
        self._begins_program = False
        self._drop_overlays()
        self._brake(Event.TAKEN, at_once=at_once)
        self._time = PathTime()
        self._go(Event.RESUME)

    def _brake(self, event: Event, *, at_once: bool = True) -> None:
        """Follow an event with the deceleration of every stop, also where only an overlay moved the arm."""
        ramp = StopJ(self.stop_deceleration)
        if at_once:
            self._delay.clear()
        self._go(event, ramp)
        if self.state in _AT_REST and any(self.path.qd):
            self._go(Event.DRIFT, ramp)

    # --- the arm is where nobody commanded it

    def place(self, q: Vector6) -> None:
        """Set the target to `q` [rad], where the joints are without a motion of the program, at rest.

        A hand lets go. A move that is suspended in a pause returns to its path from there.
        """
        self.let_go()
        if not self._time.paused:
            self._go(Event.TAKEN)
        self._chain.clear()
        self.path = self.target = JointTarget(q)
        if self.state is _BRAKING:
            self._arrive()

    def guide(self, measure: Callable[[], JointTarget]) -> None:
        """Let the arm follow a hand; `measure` gives the measured arm. Overlays end."""
        if self.state is not _BY_HAND:
            self._measure, self._has_followed_hand = measure, False
            self._drop_overlays()
            self._go(Event.GUIDE)
            if not self._time.paused:
                self._go(Event.RESUME)

    def let_go(self) -> None:
        """Hold the arm again, where a hand has left it; joints that still move are ramped to rest."""
        if self.state is _BY_HAND:
            if not self._time.paused:
                self._go(Event.TAKEN)
            self._chain.clear()
            if self._has_followed_hand:
                self.path = self.target = self._measure()
            self._brake(Event.LET_GO)

    def retract(self, target: JointTarget) -> None:
        """Undo the last step: `target` is the one before it."""
        self._chain.clear()
        self.path = self.target = target
        if self.state is ArmState.MOVING and (move := self.move) is not None:
            move.take_back()

    # --- overlays

    def add_overlay(self, overlay: Overlay) -> None:
        """Add an overlay from the next cycle on, after those that are active already."""
        self._chain.add(overlay, self.target)

    def remove_overlay(self, overlay: Overlay) -> None:
        """End an overlay, if it is active; the arm keeps its last displacement.

        A move or another overlay continues with that displacement.
        """
        if overlay in self.overlays:
            self._chain.keep_last(overlay)
            if self._chain.all_ended and self.move is None:
                self._drop_overlays()
                self._brake(Event.DRIFT)

    def _drop_overlays(self) -> None:
        """End all overlays; the path continues from the displaced target."""
        if self.overlays:
            self._chain.clear()
            self.path = self.target

    # --- transitions

    def _go(self, event: Event, ramp: Generator | None = None) -> None:
        """Follow the table; `ramp` brings the arm to rest where it has to brake."""
        command = self._command
        row = TRANSITIONS.get((self.state, event, None if command is None else command.generator.kind))
        if row is None:
            return
        self.state = row.after
        if ramp is not None and row.after is _BRAKING:
            self._ramp = ramp
        if command is not None and row.fate is not None:
            if row.fate is Fate.SUSPENDED and command.fate is Fate.ACTIVE:
                command.left_at, command.is_renewed = self.path.q, False
            command.fate = row.fate
            if command.is_over:
                self._command = None

    def _arrive(self) -> None:
        """The move has arrived, or the ramp has ended."""
        was, is_paused = self.state, self._time.paused
        self._go(Event.STAND if was is _BRAKING and is_paused else Event.DONE)
        self._delay.clear()
        if was is ArmState.RETURNING:
            self._ramp = StopJ(self.stop_deceleration)
            self._time.begin(PAUSE_RATE)
        self._turn_back()
        if is_paused:
            self._go(Event.PAUSE)

    def _turn_back(self) -> None:
        """Begin a return to the path; a move that has not left it goes on at once."""
        command, move = self._command, self.move
        if self.state is not ArmState.RETURNING or command is None or move is None:
            return
        if self.path.q == command.left_at:
            self._go(Event.DONE)
        else:
            way = move_j(self.path.q, command.left_at, move.leg.tool, a=RETURN_ACCELERATION, v=RETURN_SPEED)
            self._ramp = Move(way)

    # --- the cycle

    def step(self, dt: float, scale: float) -> JointTarget:
        """Advance one cycle of `dt` [s] and return the new target.

        `scale` is the commanded speed scaling, 0..1; during a motion it is reached gradually.
        UnreachableError if the arm cannot reach the path there.
        """
        path, before, time = self.path, self.target, self._time
        advance = rate = 1.0
        if time.paused or time.factor < 1.0:
            advance, rate = time.step(dt), time.factor
        if self.state in _AT_REST:
            self.scale = scale
            if any(path.qd) or any(path.qdd):
                path = JointTarget(path.q)
        else:
            if scale != self.scale:
                change = self.scaling_rate * dt
                self.scale = min(max(scale, self.scale - change), self.scale + change)
            path = (
                self._follow_hand(dt, advance) if self.state is _BY_HAND else self._advance(dt, advance, rate)
            )
        self.path = path
        if self.state is not _BY_HAND:
            if self.overlays:
                self._displace(before, dt, advance, rate)
            else:
                self.target = path
        return self.target

    def _advance(self, dt: float, advance: float, rate: float) -> JointTarget:
        """Return the path a cycle on; the factors of its time are those of the cycle's beginning and end."""
        command, scale = self._command, self.scale
        if self.state in _IN_TIME:
            move = self._ramp if self.state is ArmState.RETURNING or command is None else command.generator
            assert isinstance(move, Move)
            self.path = move.step(self.path, dt, scale * advance, scale * rate)
            if move.done:
                self._arrive()
            elif rate == 0.0 and self._time.paused:
                self._go(Event.STAND)
            return self.path
        is_renewed = False
        if command is not None and isinstance(stream := command.generator, Streamed):
            if self.state is _BRAKING and stream.scale != scale:
                stream.scale = 0.0  # a stop is not scaled: its speed is that of the scaling in force
            is_renewed, command.is_renewed = command.is_renewed and not self._time.paused, False
            if is_renewed and stream.fits(self.path, scale):
                self._go(Event.RENEWED)
                return self._delay.pass_on(stream, self._ramp).step(self.path, dt, scale)
            self._go(Event.LOST, stream.when_lost())
        ramp = self._delay.pass_on(self._ramp, self._ramp)
        if isinstance(ramp, StopJ):
            ramp.allowed = self.braking(self.path)
        self.path = ramp.step(self.path, dt, scale)
        ramp = self._ramp
        if ramp.done and is_renewed:
            self._go(Event.RENEWED)
        elif ramp.done:
            self._arrive()
        return self.path

    def _follow_hand(self, dt: float, advance: float) -> JointTarget:
        """Follow the measured arm; return the path of a command, which takes its time without effect."""
        self.target, self._has_followed_hand = self._measure(), True
        command = self._command
        if command is None or command.fate is Fate.SUSPENDED:
            return JointTarget(self.target.q)
        generator = command.generator
        path = generator.step(self.path, dt, self.scale * advance)
        if not isinstance(generator, Streamed):
            if generator.done:
                self._go(Event.DONE)
        elif not command.is_renewed:
            self._go(Event.TAKEN)
        command.is_renewed = False
        return path

    def _displace(self, before: JointTarget, dt: float, advance: float, rate: float) -> None:
        """Compute the target beside overlays; they stand still while the path's time does."""
        path = self.path
        if advance > 0.0 or rate > 0.0 or any(path.qd):
            self.target = self._chain.displace(path, before, dt, rate)
            # The move that ended overlays displaced has ended at rest.
            has_settled = self.move is None and (self.state not in _AT_REST or not any(self.target.qd))
            if has_settled and self._chain.all_ended:
                self._drop_overlays()
        elif any(before.qd) or any(before.qdd):
            self.target = JointTarget(before.q)
