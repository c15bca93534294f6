"""Who has the arm, as a table: the states of the arm's motion, what happens to it, and what follows.

A thread that moves the arm gets a `Command`, and learns from it what became of its motion. Only `ArmMotion`
changes it, by the rows of `TABLE`. What happens in a state that has no row for it changes nothing.

Letters: D documented (URScript manual CB3 3.15 and e-Series 5.25, user manuals), O observed, I inferred, C
chosen; see docs/fidelity.md.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from ur_emulator.models.robot_model import Vector6
from ur_emulator.motion.generators import Generator, Kind


class ArmState(Enum):
    """What the arm does along the path of the program; overlays may displace it in addition."""

    HOLDING = "stands still; no thread has it"
    MOVING = "follows the path of a move"
    STREAMING = "follows a velocity or position that is renewed in every cycle"
    BY_TORQUE = "follows the drives, which give a torque that is renewed in every cycle"
    BRAKING = "comes to rest; nothing goes on afterwards"
    SUSPENDING = "comes to rest; what was under way can go on afterwards"
    SUSPENDED = "stands still in a pause"
    RETURNING = "goes back to where a suspended move left its path"
    BY_HAND = "follows the hand that guides it; moves take their time without an effect"


class Event(Enum):
    """What happens to the motion of the arm."""

    COMMAND = "a thread commands a motion of this kind"
    DONE = "the move has arrived, or the ramp has ended"
    LOST = "the stream was not renewed in this cycle"
    RENEW = "a stream that was lost or paused is renewed before the arm rests"
    RELEASE = "the thread has ended or was killed"
    PAUSE = "the program pauses"
    STAND = "the pause has brought the arm to rest"
    RESUME = "the program goes on"
    INTERRUPT = "a stop that leaves the path, with the program paused"
    ABORT = "a client ends a movej or movel"
    END = "the program has ended, is replaced, or stops the arm"
    PLACE = "the set-point becomes the measured arm, at rest"
    GUIDE = "freedrive begins"
    LET_GO = "freedrive ends"
    LET_GO_IN_PAUSE = "freedrive ends in a pause"
    DRIFT = "an overlay that moved the arm has ended"


class Fate(Enum):
    """What became of a command."""

    ACTIVE = "moves the arm"
    SUSPENDED = "goes on later"
    DONE = "has come to its end"
    TAKEN = "was taken away: the arm does something else"


class Command:
    """A motion that a thread has commanded.

    Attributes:
        generator: computes it.
        owner: the thread; None when nobody waits for it any more.
        fate: what has become of it.
        is_renewed: its thread wants a stream in the next cycle too.
        left_at: where a suspended move has left its path [rad].
    """

    __slots__ = ("fate", "generator", "is_renewed", "kind", "left_at", "owner")

    def __init__(self, owner: object | None, generator: Generator, q: Vector6) -> None:
        self.owner = owner
        self.generator = generator
        self.kind = generator.kind
        self.fate = Fate.ACTIVE
        self.is_renewed = True
        self.left_at = q

    @property
    def is_over(self) -> bool:
        """True when it has come to its end, or was taken away: its instruction returns."""
        return self.fate is Fate.DONE or self.fate is Fate.TAKEN

    def renew(self) -> None:
        """Let a stream go on for one more cycle."""
        self.is_renewed = True


@dataclass(frozen=True, slots=True)
class Row:
    """What follows: the next state, and what becomes of the command that the arm had, if there was one."""

    after: ArmState
    fate: Fate
    why: str


class Entry(NamedTuple):
    """A row of the table, for a state, an event and the kinds of the command; None: there is none."""

    state: ArmState
    event: Event
    kinds: tuple[Kind | None, ...]
    row: Row


_S, _E, _K = ArmState, Event, Kind
_ACTIVE, _SUSPENDED, _DONE, _TAKEN = Fate
_ANY = (None, *Kind)
_STREAMS = (_K.STREAM, _K.TORQUE)
_COMMANDED = {
    _K.MOVE: _S.MOVING,
    _K.STREAM: _S.STREAMING,
    _K.TORQUE: _S.BY_TORQUE,
    _K.STOP: _S.BRAKING,
}


def _on(
    state: ArmState,
    event: Event,
    after: ArmState,
    fate: Fate,
    why: str,
    kinds: Iterable[Kind | None] = _ANY,
) -> Entry:
    return Entry(state, event, tuple(kinds), Row(after, fate, why))


def _commands() -> Iterable[Entry]:
    """Return what a command does: it takes effect in every state, unless a pause stands."""
    for state in (_S.HOLDING, _S.MOVING, _S.STREAMING, _S.BY_TORQUE, _S.BRAKING, _S.SUSPENDING):
        for kind, after in _COMMANDED.items():
            yield _on(state, _E.COMMAND, after, _ACTIVE, "D", [kind])
    yield _on(
        _S.BY_HAND, _E.COMMAND, _S.BY_HAND, _ACTIVE, "that it is not followed D, that it takes its time C"
    )


def _under_way() -> Iterable[Entry]:
    """Return what takes the arm away from a move or a stream, and what suspends it."""
    for state in (_S.MOVING, _S.STREAMING, _S.BY_TORQUE, _S.RETURNING):
        yield _on(state, _E.RELEASE, _S.BRAKING, _TAKEN, "abrupt O, deceleration C")
        yield _on(state, _E.END, _S.BRAKING, _TAKEN, "abrupt O, deceleration C")
        yield _on(
            state, _E.INTERRUPT, _S.SUSPENDING, _SUSPENDED, "stop category 2 D, that it leaves the path C"
        )
        yield _on(state, _E.GUIDE, _S.BY_HAND, _ACTIVE, "C")
        yield _on(state, _E.PLACE, _S.HOLDING, _TAKEN, "C")
    for state in (_S.MOVING, _S.RETURNING):
        yield _on(state, _E.ABORT, _S.BRAKING, _TAKEN, "D")
        yield _on(state, _E.STAND, _S.SUSPENDED, _SUSPENDED, "on the path D")
    for state in (_S.STREAMING, _S.BY_TORQUE):
        yield _on(state, _E.LOST, _S.SUSPENDING, _SUSPENDED, "stutter of slow drivers O, ramp I")
        yield _on(state, _E.PAUSE, _S.SUSPENDING, _SUSPENDED, "C")


TABLE: tuple[Entry, ...] = (
    *_commands(),
    *_under_way(),
    _on(_S.HOLDING, _E.PAUSE, _S.SUSPENDED, _ACTIVE, "D"),
    _on(_S.HOLDING, _E.INTERRUPT, _S.SUSPENDED, _ACTIVE, "D"),
    _on(_S.HOLDING, _E.GUIDE, _S.BY_HAND, _ACTIVE, "D"),
    _on(_S.HOLDING, _E.DRIFT, _S.BRAKING, _ACTIVE, "C"),
    _on(_S.MOVING, _E.DONE, _S.HOLDING, _DONE, "D"),
    _on(_S.RETURNING, _E.DONE, _S.MOVING, _ACTIVE, "C"),
    _on(_S.BRAKING, _E.DONE, _S.HOLDING, _DONE, "D"),
    _on(_S.BRAKING, _E.PAUSE, _S.SUSPENDING, _ACTIVE, "a stop ends in a pause too C"),
    _on(_S.BRAKING, _E.INTERRUPT, _S.SUSPENDING, _ACTIVE, "D"),
    _on(_S.BRAKING, _E.RELEASE, _S.BRAKING, _TAKEN, "C"),
    _on(_S.BRAKING, _E.END, _S.BRAKING, _TAKEN, "C"),
    _on(_S.BRAKING, _E.PLACE, _S.HOLDING, _DONE, "C"),
    _on(_S.BRAKING, _E.GUIDE, _S.BY_HAND, _ACTIVE, "C"),
    _on(_S.SUSPENDING, _E.RENEW, _S.STREAMING, _ACTIVE, "O", [_K.STREAM]),
    _on(_S.SUSPENDING, _E.RENEW, _S.BY_TORQUE, _ACTIVE, "I", [_K.TORQUE]),
    _on(_S.SUSPENDING, _E.RESUME, _S.BRAKING, _ACTIVE, "C", [_K.STOP, None]),
    _on(_S.SUSPENDING, _E.DONE, _S.RETURNING, _SUSPENDED, "rest first, then the way back C", [_K.MOVE]),
    _on(_S.SUSPENDING, _E.DONE, _S.HOLDING, _TAKEN, "the arm is free when it rests I", _STREAMS),
    _on(_S.SUSPENDING, _E.DONE, _S.HOLDING, _DONE, "D", [_K.STOP, None]),
    _on(_S.SUSPENDING, _E.STAND, _S.SUSPENDED, _SUSPENDED, "D", [_K.MOVE, *_STREAMS]),
    _on(_S.SUSPENDING, _E.STAND, _S.SUSPENDED, _DONE, "D", [_K.STOP, None]),
    _on(_S.SUSPENDING, _E.RELEASE, _S.SUSPENDING, _TAKEN, "C"),
    _on(_S.SUSPENDING, _E.ABORT, _S.SUSPENDING, _TAKEN, "D"),
    _on(_S.SUSPENDING, _E.INTERRUPT, _S.SUSPENDING, _SUSPENDED, "D", [_K.MOVE, *_STREAMS]),
    _on(_S.SUSPENDING, _E.INTERRUPT, _S.SUSPENDING, _ACTIVE, "D", [_K.STOP, None]),
    _on(_S.SUSPENDING, _E.END, _S.BRAKING, _TAKEN, "C"),
    _on(_S.SUSPENDING, _E.GUIDE, _S.BY_HAND, _SUSPENDED, "C"),
    _on(_S.SUSPENDED, _E.RESUME, _S.RETURNING, _SUSPENDED, "first back to its path C", [_K.MOVE]),
    _on(_S.SUSPENDED, _E.RESUME, _S.STREAMING, _ACTIVE, "C", [_K.STREAM]),
    _on(_S.SUSPENDED, _E.RESUME, _S.BY_TORQUE, _ACTIVE, "C", [_K.TORQUE]),
    _on(_S.SUSPENDED, _E.RESUME, _S.HOLDING, _ACTIVE, "D", [None]),
    _on(_S.SUSPENDED, _E.DRIFT, _S.SUSPENDING, _SUSPENDED, "C"),
    _on(_S.SUSPENDED, _E.RELEASE, _S.SUSPENDED, _TAKEN, "C"),
    _on(_S.SUSPENDED, _E.ABORT, _S.SUSPENDED, _TAKEN, "D"),
    _on(_S.SUSPENDED, _E.END, _S.HOLDING, _TAKEN, "D"),
    _on(_S.SUSPENDED, _E.GUIDE, _S.BY_HAND, _SUSPENDED, "C"),
    _on(_S.BY_HAND, _E.DONE, _S.BY_HAND, _DONE, "C"),
    _on(_S.BY_HAND, _E.LOST, _S.BY_HAND, _TAKEN, "C"),
    _on(_S.BY_HAND, _E.PAUSE, _S.BY_HAND, _TAKEN, "C"),
    _on(_S.BY_HAND, _E.RESUME, _S.BY_HAND, _ACTIVE, "C"),
    _on(_S.BY_HAND, _E.RELEASE, _S.BY_HAND, _TAKEN, "C"),
    _on(_S.BY_HAND, _E.ABORT, _S.BY_HAND, _TAKEN, "C"),
    _on(_S.BY_HAND, _E.END, _S.BY_HAND, _TAKEN, "freedrive of a client outlives a program C"),
    _on(_S.BY_HAND, _E.LET_GO, _S.BRAKING, _TAKEN, "that position control begins D, ramp C"),
    _on(_S.BY_HAND, _E.LET_GO_IN_PAUSE, _S.SUSPENDING, _SUSPENDED, "C"),
)  # fmt: skip
TRANSITIONS: dict[tuple[ArmState, Event, Kind | None], Row] = {
    (entry.state, entry.event, kind): entry.row for entry in TABLE for kind in entry.kinds
}
