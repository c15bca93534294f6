"""Who has the arm, as a table: the states of the arm's motion, what happens to it, and what follows.

A thread that moves the arm gets a `Command`, and learns from it what became of its motion. Only `ArmMotion`
changes it, by the rows of `TABLE`. What happens in a state that has no row for it changes nothing.
"""

from dataclasses import dataclass
from enum import Enum

from ur_emulator.machine.models.robot_model import Vector6
from ur_emulator.machine.motion.generators import Generator, Kind


class ArmState(Enum):
    """What the arm does along the path of the program; overlays may displace it in addition."""

    HOLDING = "stands still, and no thread has it"
    MOVING = "follows the path of a move"
    STREAMING = "follows a velocity or a position that is renewed in every cycle"
    BY_TORQUE = "follows its drives, which give a torque that is renewed in every cycle"
    BRAKING = "comes to rest"
    SUSPENDED = "stands still in a pause"
    RETURNING = "goes back to where a suspended move has left its path"
    BY_HAND = "follows the hand that guides it; commands take their time, but have no effect"


class Event(Enum):
    """What happens to the motion of the arm."""

    COMMAND = "a thread commands a motion"
    DONE = "a move has arrived, or a ramp has ended"
    LOST = "a stream was not renewed in this cycle"
    RENEWED = "a stream is renewed before the arm rests"
    TAKEN = "the thread has ended, a client ends its move, or something stops the arm"
    PAUSE = "the program pauses"
    STAND = "the pause has brought the arm to rest"
    RESUME = "the pause ends"
    INTERRUPT = "a stop that leaves the path"
    DRIFT = "an overlay that moved the resting arm has ended"
    GUIDE = "freedrive begins"
    LET_GO = "freedrive ends"


class Fate(Enum):
    """What has become of a command."""

    ACTIVE = "moves the arm"
    SUSPENDED = "can go on later"
    DONE = "has come to its end"
    TAKEN = "has lost the arm"


@dataclass(slots=True, eq=False)
class Command:
    """A motion that a thread has commanded.

    Attributes:
        owner: the thread; None when nobody waits for it any more.
        generator: computes it.
        left_at: where it was when it was suspended [rad].
        is_renewed: its thread wants a stream to go on in this cycle; it sets it anew in each.
    """

    owner: object | None
    generator: Generator
    left_at: Vector6
    fate: Fate = Fate.ACTIVE
    is_renewed: bool = True

    @property
    def is_over(self) -> bool:
        """True when its instruction returns: it has come to its end, or has lost the arm."""
        return self.fate is Fate.DONE or self.fate is Fate.TAKEN


@dataclass(frozen=True, slots=True)
class Row:
    """A row of the table.

    Attributes:
        states: in which it happens.
        kinds: of the command that has the arm, of a new one in COMMAND; None: there is none.
        after: the state that follows.
        fate: what becomes of the command; None: it stays as it is.
        why: source: D documented, O observed, I inferred, C chosen.
    """

    states: tuple[ArmState, ...]
    event: Event
    kinds: tuple[Kind | None, ...]
    after: ArmState
    fate: Fate | None
    why: str


_S, _E, _K, _F = ArmState, Event, Kind, Fate
_ANY: tuple[Kind | None, ...] = (None, *Kind)
_STREAMS = (_K.STREAM, _K.TORQUE)
_HELD = (_S.HOLDING, _S.MOVING, _S.RETURNING, _S.STREAMING, _S.BY_TORQUE, _S.BRAKING)
_UNDER_WAY = (_S.MOVING, _S.RETURNING, _S.STREAMING, _S.BY_TORQUE)

TABLE: tuple[Row, ...] = (
    Row(_HELD, _E.COMMAND, (_K.MOVE,), _S.MOVING, _F.ACTIVE, "D"),
    Row(_HELD, _E.COMMAND, (_K.STREAM,), _S.STREAMING, _F.ACTIVE, "D"),
    Row(_HELD, _E.COMMAND, (_K.TORQUE,), _S.BY_TORQUE, _F.ACTIVE, "D"),
    Row(_HELD, _E.COMMAND, (_K.STOP,), _S.BRAKING, _F.ACTIVE, "D"),
    Row((_S.BY_HAND,), _E.COMMAND, _ANY, _S.BY_HAND, _F.ACTIVE, "no effect D, takes its time C"),

    Row((_S.MOVING,), _E.DONE, _ANY, _S.HOLDING, _F.DONE, "D"),
    Row((_S.RETURNING,), _E.DONE, _ANY, _S.MOVING, _F.ACTIVE, "C"),
    Row((_S.BRAKING,), _E.DONE, (None, _K.STOP), _S.HOLDING, _F.DONE, "D"),
    Row((_S.BRAKING,), _E.DONE, (_K.MOVE,), _S.RETURNING, None, "rest first, then the way back C"),
    Row((_S.BRAKING,), _E.DONE, _STREAMS, _S.HOLDING, _F.TAKEN, "a resting arm is free I"),
    Row((_S.BY_HAND,), _E.DONE, _ANY, _S.BY_HAND, _F.DONE, "C"),

    Row((_S.STREAMING, _S.BY_TORQUE), _E.LOST, _STREAMS, _S.BRAKING, _F.SUSPENDED, "slow drivers stutter O"),
    Row((_S.BRAKING,), _E.RENEWED, (_K.STREAM,), _S.STREAMING, _F.ACTIVE, "slow drivers stutter O"),
    Row((_S.BRAKING,), _E.RENEWED, (_K.TORQUE,), _S.BY_TORQUE, _F.ACTIVE, "I"),

    Row((*_UNDER_WAY, _S.BRAKING), _E.TAKEN, _ANY, _S.BRAKING, _F.TAKEN, "abrupt O, deceleration C"),
    Row((_S.SUSPENDED,), _E.TAKEN, _ANY, _S.SUSPENDED, _F.TAKEN, "I"),
    Row((_S.BY_HAND,), _E.TAKEN, _ANY, _S.BY_HAND, _F.TAKEN, "freedrive of a client outlives a program C"),

    Row((_S.HOLDING,), _E.PAUSE, _ANY, _S.SUSPENDED, None, "D"),
    Row((_S.STREAMING, _S.BY_TORQUE), _E.PAUSE, _STREAMS, _S.BRAKING, _F.SUSPENDED, "C"),
    Row((_S.BY_HAND,), _E.PAUSE, _ANY, _S.BY_HAND, _F.TAKEN, "C"),
    Row((_S.MOVING, _S.RETURNING), _E.STAND, _ANY, _S.SUSPENDED, _F.SUSPENDED, "on the path D"),
    Row((_S.BRAKING,), _E.STAND, (None, _K.STOP), _S.SUSPENDED, _F.DONE, "I"),
    Row((_S.BRAKING,), _E.STAND, (_K.MOVE, *_STREAMS), _S.SUSPENDED, None, "D"),
    Row((_S.SUSPENDED,), _E.RESUME, (None,), _S.HOLDING, None, "D"),
    Row((_S.SUSPENDED,), _E.RESUME, (_K.MOVE,), _S.RETURNING, None, "an arm that left its path C"),
    Row((_S.SUSPENDED,), _E.RESUME, (_K.STREAM,), _S.STREAMING, _F.ACTIVE, "C"),
    Row((_S.SUSPENDED,), _E.RESUME, (_K.TORQUE,), _S.BY_TORQUE, _F.ACTIVE, "C"),
    Row((_S.BY_HAND,), _E.RESUME, _ANY, _S.BY_HAND, _F.ACTIVE, "C"),

    Row(_UNDER_WAY, _E.INTERRUPT, _ANY, _S.BRAKING, _F.SUSPENDED, "stop category 2 D, leaves the path C"),
    Row((_S.BRAKING,), _E.INTERRUPT, _ANY, _S.BRAKING, None, "D"),
    Row((_S.HOLDING,), _E.INTERRUPT, _ANY, _S.SUSPENDED, None, "D"),
    Row((_S.HOLDING, _S.SUSPENDED), _E.DRIFT, _ANY, _S.BRAKING, None, "C"),

    Row(tuple(_S), _E.GUIDE, _ANY, _S.BY_HAND, None, "D; that a command goes on without effect C"),
    Row((_S.BY_HAND,), _E.LET_GO, _ANY, _S.BRAKING, _F.SUSPENDED, "position control D, ramp C"),
)  # fmt: skip
TRANSITIONS: dict[tuple[ArmState, Event, Kind | None], Row] = {
    (state, row.event, kind): row for row in TABLE for state in row.states for kind in row.kinds
}
