"""Files of programs for the box ("chunks") with what is done to it and what is expected, as comments.

Chunks stand apart by a line `---`; lines count from the first of the chunk. A line ends in at most one mark:

    what is expected of the run
    #> text             the next text that textmsg shows (all texts, in order)
    #7> text            the same, in cycle 7 of the program; its first cycle is 0
    #! 3:5 text         an error at line 3, column 5, with exactly this text; `...` stands for anything;
                        several: all compile errors in order
    #sec! 1:5 text      the same of a secondary program
    #~ wire text        what the first error puts into the runtime-exception message
    #event text         the next thing the box reports beside texts: `C204A0 Protective Stop: ...` (`info`, `violation`
                        or `fault` before it if it is no warning),
                        `safety PROTECTIVE_STOP`, `popup title: text`, `asks integer: text`,
                        `log source: text` (all, in order)
    #life text          the next thing that happens to the program: `started p`, `stopped p` (all, if any)
    #cycles 25          how many cycles the program runs
    #paused             the program is left paused at the end
    #state name value   a value of the last snapshot, optionally with a tolerance
    #see 60 name value  a value of the snapshot of cycle 60; `#see 60..80 name value` in each of them; `< value`, `> value`;
                        `~ 0.1` for a tolerance; `name[2]` for one of several numbers; before the name `mean`, `most`
                        (the greatest size), `span` (greatest minus least), `step` (the greatest change from one cycle to
                        the next) or `gain` (last minus first); the chunk goes on to the last of these cycles
    #endless            the program is not waited for, nor the arm
    #sent "text"        all that the program sent, through all sockets, in order
    #called f [1, 2]    the next remote procedure called, with its arguments (all, in order)
    #modbus 3 6 100     what stands in a Modbus unit at the end: type of signal, address, value
    #custom 255 6 [0]   the next request sent to a unit as it is: its number, function code, data (all)

    what the box is and what is done to it
    #robot ur20         the arm
    #mode POWER_OFF     the robot mode at the beginning
    #before PROGRAM     a one-line program that has run before, what it reports is not compared
    #fidelity typical   ideal, if not given
    #seed 3             7, if not given
    #loaded             the program was loaded from a file; otherwise it came through a socket
    #do ACTION          before the program starts
    #at 5 ACTION        before cycle 5 of the program
    #then PROGRAM       a one-line program that runs after the last one has ended
    #answer 5           answer to the next question of a program, one cycle later; `close` for popups
    #peer "text"        sent by the peer of the program's next socket once it is connected;
                        `refuses` and `silent` for peers that do not take the connection
    #reply "ask" "text" sent by a peer when it has received `ask`
    #rpc f 5            result of a remote procedure; `#rpc f fails text`
    #software 5.11      3.15, if not given; the arm is a UR3, and a UR5e for 5.x

Actions: see `chunk_actions`.
"""

from __future__ import annotations

import re
from ast import literal_eval
from dataclasses import dataclass, field

_MARK = re.compile(
    r"#(\d*>|!|sec!|~|event|life|cycles|paused|state|see|endless|sent|called|modbus|custom|robot|mode|before|fidelity|seed"
    r"|loaded|do|at|then|answer|peer|reply|rpc|software)(?: (.*))?$"
)
_LOOK = re.compile(
    r"(\d+)(?:\.\.(\d+))? (?:(mean|most|span|step|gain) )?(\w+)(?:\[(\d+)\])? (?:([<>]) )?(.+?)(?: ~ (\S+))?"
)


@dataclass(frozen=True)
class Look:
    """What a quantity has in some cycles, as `#see` says."""

    cycles: range
    how: str
    name: str
    index: int | None
    relation: str
    value: str
    tolerance: float

    @classmethod
    def parse(cls, text):
        first, last, how, name, index, relation, value, tolerance = _LOOK.fullmatch(text).groups()
        cycles = range(int(first), int(last or first) + 1)
        place = None if index is None else int(index)
        return cls(cycles, how or "", name, place, relation or "", value, float(tolerance or 0.0))


@dataclass
class BoxChunk:
    """One program with all that belongs to it."""

    file: str
    first_line: int
    text: str
    messages: list[tuple[int | None, str]] = field(default_factory=list)
    errors: list[tuple[bool, int, int, str]] = field(default_factory=list)
    wire_text: str | None = None
    events: list[str] = field(default_factory=list)
    life: list[str] = field(default_factory=list)
    cycles: int | None = None
    paused: bool = False
    states: list[tuple[str, object, float]] = field(default_factory=list)
    looks: list[Look] = field(default_factory=list)
    endless: bool = False
    sent: bytes | None = None
    called: list[str] = field(default_factory=list)
    modbus: list[tuple[int, int, int]] = field(default_factory=list)
    custom: list[str] = field(default_factory=list)
    robot: str = ""
    mode: str = "RUNNING"
    before: str = ""
    fidelity: str = "ideal"
    seed: int = 7
    loaded: bool = False
    actions: list[tuple[int, str]] = field(default_factory=list)
    then: list[str] = field(default_factory=list)
    answers: list[str] = field(default_factory=list)
    peers: list[str] = field(default_factory=list)
    replies: list[tuple[bytes, bytes]] = field(default_factory=list)
    procedures: dict[str, str] = field(default_factory=dict)
    software: str = "3.15"

    def __str__(self):
        return f"{self.file}:{self.first_line}"


def load_box_chunks(*files):
    """All chunks of the given files."""
    return [chunk for file in files for chunk in _split(file)]


def latin(text):
    """The bytes that a quoted text stands for."""
    return literal_eval(text).encode("latin-1")


def _split(file):
    chunks, lines, first = [], [], 1
    text = file.read_bytes().decode("latin-1")
    for number, line in enumerate([*text.split("\n"), "---"], start=1):
        if line.rstrip() != "---":
            lines.append(line)
            continue
        if any(part.strip() for part in lines):
            chunks.append(_read_marks(BoxChunk(file.name, first, "\n".join(lines))))
        lines, first = [], number + 1
    return chunks


def _read_marks(chunk):
    for line in chunk.text.split("\n"):
        mark = _MARK.search(line)
        if mark is not None:
            _take(chunk, mark[1], mark[2] or "")
    return chunk


def _take(chunk, kind, rest):
    match kind:
        case "!" | "sec!":
            place = re.match(r"(\d+):(\d+) (.+)", rest)
            assert place, f"{chunk}: write '#! line:column text', not {rest!r}"
            chunk.errors.append((kind == "sec!", int(place[1]), int(place[2]), place[3]))
        case "~":
            chunk.wire_text = rest
        case "event":
            chunk.events.append(rest)
        case "life":
            chunk.life.append(rest)
        case "cycles":
            chunk.cycles = int(rest)
        case "state":
            name, value, tolerance = re.fullmatch(r"(\w+) (.+?)(?: ~ (\S+))?", rest).groups()
            chunk.states.append((name, literal_eval(value), float(tolerance or 0.0)))
        case "see":
            chunk.looks.append(Look.parse(rest))
        case "endless" | "paused" | "loaded":
            setattr(chunk, kind, True)
        case "robot" | "mode" | "before" | "fidelity" | "software":
            setattr(chunk, kind, rest)
        case "sent":
            chunk.sent = (chunk.sent or b"") + latin(rest)
        case "called":
            chunk.called.append(rest)
        case "modbus":
            chunk.modbus.append(tuple(map(int, rest.split())))
        case "custom":
            chunk.custom.append(rest)
        case "seed":
            chunk.seed = int(rest)
        case "do":
            chunk.actions.append((-1, rest))
        case "at":
            cycle, action = rest.split(" ", 1)
            chunk.actions.append((int(cycle), action))
        case "then":
            chunk.then.append(rest)
        case "answer":
            chunk.answers.append(rest)
        case "peer":
            chunk.peers.append(rest)
        case "reply":
            asked, text = re.fullmatch(r'("(?:[^"\\]|\\.)*") (".*")', rest).groups()
            chunk.replies.append((latin(asked), latin(text)))
        case "rpc":
            name, result = rest.split(" ", 1)
            chunk.procedures[name] = result
        case _:
            cycle = kind.rstrip(">")
            chunk.messages.append((int(cycle) if cycle else None, rest))
