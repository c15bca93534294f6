"""A host without a robot: it records the calls of a program and answers from what they stored.

Moves take three cycles and reach their target, registers and outputs read back what was stored, sockets
deliver prepared data, interpreter mode ends at once. Used by `urscript run` and by tests; it models no
physics.
"""

from collections import deque
from collections.abc import Callable, Generator, Iterable, Mapping
from functools import partial
from math import ceil
from random import Random
from typing import Any, Final, NamedTuple

from urscript.catalogue import CB3_3_15, STEP_TIME, Builtin, Catalogue, TimeClass
from urscript.program import CompiledProgram, ProgramStatus, RunningProgram
from urscript.run.host import EnterMode, HostFunction
from urscript.run.threads import ScriptThread
from urscript.run.waits import NEXT_CYCLE, Blocked, Outside, Wait
from urscript.values import Pose, Struct

MOVE_CYCLES: Final = 3
"""Duration of a move without the argument `t`."""

_ZERO_POSE: Final = Pose(0, 0, 0, 0, 0, 0)

_HOME: Final = [0.0, -1.5708, 0.0, -1.5708, 0.0, 0.0]


class _NoStatements:
    """A queue into which nobody puts anything: interpreter mode ends at once."""

    is_ending = True
    is_clearing = clears_on_end = False

    def is_ready(self) -> bool:
        return False

    def take(self) -> None: ...
    def cleared(self) -> None: ...
    def leave(self) -> None: ...


class RecordedCall(NamedTuple):
    """One call of a builtin with an effect."""

    cycle: int
    thread: str
    name: str
    arguments: tuple[Any, ...]


class FakeSocket:
    """A peer that sends frames of integers, in order; `closed` after the last one."""

    def __init__(self, frames: Iterable[list[int]] = (), closed: bool = False) -> None:
        self.frames: deque[list[int]] = deque(frames)
        self.closed = closed

    def is_readable(self) -> bool:
        """Whether a read would return at once."""
        return bool(self.frames) or self.closed


class RecordingHost:
    """A host that records.

    Attributes:
        cycle: Control cycles run so far by `run`.
        calls: Calls with an effect on a robot, in order.
        step_time: Length of a control cycle in s, that of the catalogue's generation.
        messages: Texts of textmsg, in order.
        sockets: Peers by socket name; socket_open succeeds for these names only.
        q: Joint positions (rad) that moves reach and getters report.
        tcp_pose: Tool pose that moves reach and getters report.
    """

    def __init__(
        self,
        *,
        catalogue: Catalogue = CB3_3_15,
        sockets: Mapping[str, FakeSocket] | None = None,
        seed: int = 0,
        on_message: Callable[[str], None] | None = None,
        on_call: Callable[[RecordedCall], None] | None = None,
    ) -> None:
        self.cycle = 0
        self.step_time = STEP_TIME[catalogue.version.generation]
        self.calls: list[RecordedCall] = []
        self.messages: list[str] = []
        self.ended_threads: list[ScriptThread] = []
        self.ended_programs = 0
        self.sockets = dict(sockets or {})
        self.q: list[float] = list(_HOME)
        self.tcp_pose = _ZERO_POSE
        self._catalogue = catalogue
        self._stored: dict[tuple[str, str], Any] = {}
        self._random = Random(seed)
        self._on_message = on_message
        self._on_call = on_call

    # --- interface of a host --------------------------------------------------------------------------

    def builtins(self) -> Mapping[str, HostFunction]:
        """Every builtin of the catalogue that is not pure."""
        offered: dict[str, HostFunction] = {}
        for builtin in self._catalogue:
            if builtin.time is TimeClass.MOTION:
                offered[builtin.name] = partial(self._move, builtin)
            elif builtin.may_wait:
                offered[builtin.name] = partial(self._answer_later, builtin)
            elif not builtin.module.startswith("urmath") and not builtin.name.startswith(("str_", "to_")):
                offered[builtin.name] = partial(self._answer, builtin)
        offered["socket_open"] = self._socket_open
        offered["socket_read_binary_integer"] = self._socket_read
        offered["pause"] = self._pause
        offered["random"] = lambda thread: self._random.random()
        offered["interpreter_mode"] = self._interpreter_mode
        return offered

    def textmsg(self, text: str) -> None:
        """Keep the text."""
        self.messages.append(text)
        if self._on_message:
            self._on_message(text)

    def thread_ended(self, thread: ScriptThread) -> None:
        """Keep the thread."""
        self.ended_threads.append(thread)

    def program_ended(self) -> None:
        """Count the end."""
        self.ended_programs += 1

    # --- running -----------------------------------------------------------------------------------------

    def run(self, program: CompiledProgram, max_cycles: int = 10_000) -> RunningProgram:
        """Run `program` at full speed until it ends, waits for a peer, or `max_cycles` have passed."""
        running = program.start(self)
        for _ in range(max_cycles):
            if running.step() is not ProgramStatus.RUNNING or running.waits_outside:
                break
            self.cycle += 1
        return running

    def names_called(self) -> list[str]:
        """Names of the recorded calls, in order."""
        return [call.name for call in self.calls]

    # --- answers -----------------------------------------------------------------------------------------

    def _record(self, thread: ScriptThread, name: str, arguments: tuple[Any, ...]) -> None:
        call = RecordedCall(self.cycle, thread.name, name, arguments)
        self.calls.append(call)
        if self._on_call:
            self._on_call(call)

    def _answer(self, builtin: Builtin, thread: ScriptThread, *arguments: Any) -> Any:
        """Getters report what setters stored; everything else is recorded."""
        name = builtin.name
        if name == "get_steptime":
            return self.step_time
        if name == "time":
            seconds, rest = divmod(self.cycle * round(self.step_time * 1e6), 1_000_000)
            return Struct({"sec": seconds, "nanosec": rest * 1000})
        if builtin.returns == "None" or name.startswith("socket_"):
            self._record(thread, name, arguments)
            if arguments:
                self._stored[_register_name(name), str(arguments[0])] = arguments[-1]
            return True if name.startswith("socket_send") else None
        if name.startswith("get_") and "joint_positions" in name:
            return self.q
        if name.startswith("get_") and "tcp_pose" in name:
            return self.tcp_pose
        key = str(arguments[0]) if arguments else ""
        return self._stored.get((_register_name(name), key), _default(builtin))

    def _answer_later(
        self, builtin: Builtin, thread: ScriptThread, *arguments: Any
    ) -> Generator[Wait, None, Any]:
        self._record(thread, builtin.name, arguments)
        yield NEXT_CYCLE
        return _default(builtin)

    def _pause(self, thread: ScriptThread) -> Generator[Wait, None, None]:
        """The statement `pause`: recorded, and the program goes on in the next cycle."""
        self._record(thread, "pause", ())
        yield NEXT_CYCLE

    def _move(self, builtin: Builtin, thread: ScriptThread, *arguments: Any) -> Generator[Wait, None, None]:
        self._record(thread, builtin.name, arguments)
        cycles = MOVE_CYCLES
        for parameter, value in zip(builtin.params, arguments, strict=True):
            if parameter.name == "t" and value:
                cycles = ceil(value / self.step_time - 1e-9)
        for _ in range(cycles):
            yield NEXT_CYCLE
        if builtin.name in ("movej", "movel", "movep", "servoj", "movec"):
            goal = arguments[1 if builtin.name == "movec" else 0]
            if isinstance(goal, Pose):
                self.tcp_pose = goal
            else:
                self.q = goal

    def _interpreter_mode(self, thread: ScriptThread, *arguments: Any) -> EnterMode:
        self._record(thread, "interpreter_mode", arguments)
        return lambda scope: _NoStatements()

    def _socket_open(
        self, thread: ScriptThread, address: str, port: int, socket_name: str
    ) -> Generator[Wait, None, bool]:
        self._record(thread, "socket_open", (address, port, socket_name))
        yield NEXT_CYCLE
        return socket_name in self.sockets

    def _socket_read(
        self, thread: ScriptThread, number: int, socket_name: str, timeout: float
    ) -> Generator[Wait, None, list[int]]:
        peer = self.sockets.get(socket_name)
        if peer is not None and not peer.is_readable():
            yield Blocked(peer.is_readable, Outside.PEER)
        if peer is None or not peer.frames:
            return [0] + [-1] * number
        return [number, *peer.frames.popleft()]


def _register_name(name: str) -> str:
    """The common part of setter and getter: `set_standard_digital_out` -> `standard_digital_out`."""
    for prefix in ("set_", "get_", "write_", "read_"):
        name = name.removeprefix(prefix)
    return name


def _default(builtin: Builtin) -> Any:
    """A value of the type that `builtin` returns."""
    kind = builtin.returns
    if kind.startswith("struct("):
        names = kind.removeprefix("struct(").removesuffix(")").split(", ")
        return Struct(dict.fromkeys(names, 0.0))
    return next((value for prefix, value in _DEFAULTS.items() if kind.startswith(prefix)), None)


_DEFAULTS: Final = {
    "bool": False,
    "int": 0,
    "float": 0.0,
    "number": 0.0,
    "string": "",
    "pose": _ZERO_POSE,
    "list of 3": [0.0] * 3,
    "list": [0.0] * 6,
}
"""How the type of a result begins -> a value of it."""
