r"""Robotiq grippers, without I/O: the text protocol of port 63352, and the registers behind it.

    request                             answer
    SET VAR value [VAR value ...]\n     ack            three bytes, no newline; one for all pairs
    GET VAR\n                           VAR value\n
    GET VAR                             value          no newline, of fixed width, as the maker's programs ask
    GET SID                             [9]            the grippers that are there, with or without a newline
    SET SID number\n                    ack            the gripper that this connection talks to

Programs send a SET in pieces, so a request ends at its newline. A GET without one is a request when a segment
ends with it; the newline that may follow later is ignored. A value that is not known, because the gripper has
no power, is `?`.

Sources: the maker's programs and public clients (reference `grippers.md`, 1.1 and 1.2). No source has the
answer to a wrong name or value: here it is `nak` to a SET, of which nothing is done, and `?` to a GET.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Final, NamedTuple

from protocol.errors import RemoteProtocolError

__all__ = [
    "ACK",
    "DEFAULT_SID",
    "INPUTS",
    "MAX_LINE",
    "NAK",
    "NOT_KNOWN",
    "OUTPUTS",
    "SID",
    "VARIABLES",
    "Access",
    "Fault",
    "Get",
    "GripperConnection",
    "Malformed",
    "Objects",
    "Set",
    "Status",
    "Variable",
    "decode_request",
    "encode_request",
    "encode_status",
    "encode_value",
    "take_answer",
]

ACK: Final = b"ack"
NAK: Final = b"nak"
NOT_KNOWN: Final = "?"
SID: Final = "SID"
DEFAULT_SID: Final = 9
"""The address on the serial line that a gripper has when it leaves the factory; gripper 1 of a program."""

MAX_LINE: Final = 1024
"""Longest line in bytes: all variables in one SET have a quarter of it."""


class Access(Enum):
    """What clients may do with a variable."""

    READ = "r"
    WRITE = "w"
    BOTH = "rw"


class Variable(NamedTuple):
    """A variable of port 63352.

    Attributes:
        meaning: for the documentation.
        most: the largest value; the least is 0. None: a text.
        width: digits of the answer to a GET without a newline; 0: as many as the value has.
    """

    meaning: str
    access: Access
    most: int | None = 255
    width: int = 0


VARIABLES: Final[Mapping[str, Variable]] = {
    "ACT": Variable("activation; 0 resets the gripper and its faults", Access.BOTH, 1, 1),
    "GTO": Variable("go to the requested position; 0 stops", Access.BOTH, 1, 1),
    "ATR": Variable("automatic release", Access.BOTH, 1, 1),
    "ARD": Variable("its direction: 0 opens, 1 closes", Access.BOTH, 1, 1),
    "MOD": Variable("0 automatic, 1 advanced, of vacuum grippers", Access.BOTH, 1, 1),
    "POS": Variable("SET the target, GET the position; 0 open, 255 closed", Access.BOTH, 255, 3),
    "SPE": Variable("speed", Access.BOTH, 255, 3),
    "FOR": Variable("force", Access.BOTH, 255, 3),
    "MSC": Variable("largest current, 10 mA; 0: the gripper's own limit", Access.BOTH),
    "LBP": Variable("lamp, blue pulses", Access.BOTH, 1, 1),
    "LRD": Variable("lamp, red", Access.BOTH, 1, 1),
    "LBL": Variable("lamp, blue", Access.BOTH, 1, 1),
    "LGN": Variable("lamp, green", Access.BOTH, 1, 1),
    "SCN_BLOCK": Variable("1 stops the search for grippers", Access.WRITE, 1, 1),
    "MUTE": Variable("1 stops the scan of the gripper", Access.WRITE, 1, 1),
    "TOOL": Variable("1 enables the tool connector", Access.WRITE, 1, 1),
    "PRE": Variable("the target as the gripper has it", Access.READ, 255, 3),
    "STA": Variable("0 reset, 1 activating, 3 active", Access.READ, 3, 1),
    "OBJ": Variable("0 moving, 1 or 2 contact while opening or closing, 3 at the target", Access.READ, 3, 1),
    "FLT": Variable("fault", Access.READ, 15, 2),
    "COU": Variable("motor current, 10 mA", Access.READ, 255, 3),
    "NCY": Variable("cycles", Access.READ, None),
    "SNU": Variable("serial number", Access.READ, None),
    "FWV": Variable("firmware", Access.READ, None),
    "VER": Variable("software of the port", Access.READ, None),
    "DST": Variable("0 init, 1 listen, 2 read info, 3 activation, 4 run", Access.READ, 4, 1),
    "PCO": Variable("1: the gripper does not answer", Access.READ, 1, 1),
}
"""All variables by name. Source: reference `grippers.md` 1.2; widths of POS, SPE, FOR and COU: as PRE."""


class Status(IntEnum):
    """STA."""

    RESET = 0
    ACTIVATING = 1
    ACTIVE = 3


class Objects(IntEnum):
    """OBJ."""

    MOVING = 0
    CONTACT_OPENING = 1
    CONTACT_CLOSING = 2
    AT_TARGET = 3


class Fault(IntEnum):
    """FLT. From `UNDER_VOLTAGE` on only a new activation helps. Source: maker's manual (D)."""

    NONE = 0
    ACTION_DELAYED = 5
    NOT_ACTIVATED = 7
    TOO_HOT = 8
    NO_COMMUNICATION = 9
    UNDER_VOLTAGE = 10
    RELEASING = 11
    INTERNAL = 12
    ACTIVATION = 13
    OVER_CURRENT = 14
    RELEASED = 15


# --- the text protocol


@dataclass(frozen=True, slots=True)
class Get:
    """GET; `bare` is one without a newline."""

    name: str
    bare: bool


@dataclass(frozen=True, slots=True)
class Set:
    """SET of one or more variables, in the order of the request; SID stands alone."""

    values: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class Malformed:
    """A line that is no request; `is_set` if it begins like a SET. `text` has at most 60 characters."""

    text: str
    is_set: bool


Request = Get | Set | Malformed


class GripperConnection:
    """The gripper's side of one connection."""

    def __init__(self) -> None:
        self._inbox = bytearray()
        self._skips_newline = False

    def receive(self, segment: bytes) -> list[Request]:
        """Return the requests that a segment completes, in order.

        Of a line that is longer than MAX_LINE one `Malformed` is returned, and its rest is a line of its own.
        """
        self._inbox += segment
        requests: list[Request] = []
        while (end := self._inbox.find(b"\n")) >= 0 or len(self._inbox) > MAX_LINE:
            line = bytes(self._inbox[: MAX_LINE if end < 0 else min(end, MAX_LINE)])
            del self._inbox[: len(line) + (end == len(line))]
            text = line.decode("ascii", "replace").strip()
            if text or not self._skips_newline:
                requests.append(_parse(text))
            self._skips_newline = False
        words = self._inbox.decode("ascii", "replace").split()
        if len(words) == 2 and words[0] == "GET" and (words[1] in VARIABLES or words[1] == SID):
            self._inbox.clear()
            self._skips_newline = True
            requests.append(Get(words[1], bare=True))
        return requests


def encode_value(request: Get, value: int | str) -> bytes:
    """Return the answer to a GET: the value of a variable, NOT_KNOWN if it has none, or the text of SID."""
    if request.name != SID and not request.bare:
        return f"{request.name} {value}\n".encode()
    if isinstance(value, str):
        return value.encode()
    return f"{value:0{VARIABLES[request.name].width}d}".encode()


def encode_request(request: Get | Set) -> bytes:
    """Return what a client sends."""
    if isinstance(request, Get):
        return f"GET {request.name}".encode() + (b"" if request.bare else b"\n")
    return f"SET {' '.join(f'{name} {value}' for name, value in request.values)}\n".encode()


def take_answer(inbox: bytearray, request: Get | Set) -> int | str | None:
    """Take the answer to a SET, or to the GET of a number with a newline, off what has come to a client.

    Returns:
        The number or NOT_KNOWN; of a SET "ack"; None: more bytes must come.

    Raises:
        RemoteProtocolError: it is no answer to this request.
    """
    end = len(ACK) if isinstance(request, Set) else inbox.find(b"\n") + 1 or MAX_LINE
    if len(inbox) < end:
        return None
    answer = inbox[:end].decode("ascii", "replace").strip()
    del inbox[:end]
    name, _, value = answer.partition(" ")
    match request:
        case Set() if answer == ACK.decode():
            return answer
        case Get() if name == request.name and value == NOT_KNOWN:
            return value
        case Get() if name == request.name and (number := _number(value)) is not None:
            return number
    raise RemoteProtocolError(f"{answer[:60]!r} is no answer to {encode_request(request)!r}")


def _parse(text: str) -> Request:
    """Return the request of a line without its newline."""
    verb, *words = text.split() or [""]
    if verb == "GET" and len(words) == 1:
        name = words[0]
        if name == SID or (name in VARIABLES and VARIABLES[name].access is not Access.WRITE):
            return Get(name, bare=False)
    elif verb == "SET" and words and len(words) % 2 == 0:
        pairs = [(name, _number(value)) for name, value in zip(words[::2], words[1::2], strict=True)]
        if all(_may_set(name, value, len(pairs)) for name, value in pairs):
            return Set(tuple((name, value) for name, value in pairs if value is not None))
    return Malformed(text[:60], verb == "SET")


def _number(text: str) -> int | None:
    return int(text) if text.isascii() and text.isdigit() and len(text) <= 5 else None


def _may_set(name: str, value: int | None, n_pairs: int) -> bool:
    if value is None:
        return False
    if name == SID:
        return n_pairs == 1 and 1 <= value <= 247
    variable = VARIABLES.get(name)
    return (
        variable is not None
        and variable.access is not Access.READ
        and variable.most is not None
        and value <= variable.most
    )


# --- registers of the serial line

INPUTS: Final = 0x03E8
"""First of the registers that are written."""

OUTPUTS: Final = 0x07D0
"""First of the registers with the status."""


def decode_request(registers: Sequence[int]) -> dict[str, int]:
    """Return the variables that registers 03E8, 03E9 and 03EA set."""
    action, position, motion = registers
    bits = {"ACT": 0, "MOD": 1, "GTO": 3, "ATR": 4, "ARD": 5}
    return {name: action >> 8 + bit & 1 for name, bit in bits.items()} | {
        "POS": position & 0xFF,
        "SPE": motion >> 8,
        "FOR": motion & 0xFF,
    }


def encode_status(
    *,
    active: bool,
    going: bool,
    status: Status,
    objects: Objects,
    fault: Fault,
    requested: int,
    position: int,
    current: int,
) -> tuple[int, int, int]:
    """Return registers 07D0, 07D1 and 07D2. Source: maker's manual; reference `grippers.md` 2."""
    state = active | going << 3 | status << 4 | objects << 6
    return state << 8, fault << 8 | requested, position << 8 | current
