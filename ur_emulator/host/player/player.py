"""The program that is loaded, and what the buttons of PolyScope do with it: load, play, pause, stop.

Every action is done in steps (see `host.steps`). What cannot be done is refused, and the log says why. When
the box is switched on, the default installation of its folder says what is loaded and started.
"""

import re
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

from protocol.ur_types import ProgramState, RobotMode
from ur_emulator.errors import EmulatorError, FileMissingError, RefusedError, WorkerError
from ur_emulator.host.player.external_control import request_program
from ur_emulator.host.script_network.loop_network import LoopNetwork
from ur_emulator.host.served_box import ServedBox
from ur_emulator.host.steps import Steps
from ur_emulator.machine.commands.programs import (
    PROGRAM_RUNS,
    PauseProgram,
    ResumeProgram,
    SetUp,
    StopProgram,
    why_not_running,
)
from ur_emulator.machine.controller.events import ScriptFailed
from ur_emulator.machine.controller.io.lines import CONFIGURABLE, STANDARD, TOOL
from ur_emulator.machine.controller.safety.safety_state import limits_of
from ur_emulator.machine.controller.status_words import RUNNING_STATES
from ur_emulator.program_files.compiling import (
    CompileResult,
    compile_loaded,
    load_and_compile,
    load_installation_and_compile,
)
from ur_emulator.program_files.folder import ProgramFolder
from ur_emulator.program_files.installation import ExternalControlPc, Installation, StartUp
from ur_emulator.program_files.installation_reader import DEFAULT_NAME, NEW_BOX
from ur_emulator.program_files.variables_file import literal, write_variables

if TYPE_CHECKING:
    from ur_emulator.program_files.loading import LoadedProgram

_PAUSED = frozenset({ProgramState.PAUSING, ProgramState.PAUSED})
T = TypeVar("T")
# Who External Control asks if neither a client has sent `play` nor a node or the installation names a PC.
THIS_MACHINE = "127.0.0.1"
# Port of a PC's script sender when nothing names another. Source: the source text of the URCap.
SCRIPT_SENDER_PORT = 50002
# Modes in which the controller does not take programs yet.
_NOT_UP = frozenset(
    {RobotMode.NO_CONTROLLER, RobotMode.DISCONNECTED, RobotMode.CONFIRM_SAFETY, RobotMode.BOOTING}
)


class MissingFileRefusal(RefusedError):
    """A file is not loaded because there is none of that name."""


class ProgramPlayer:
    """Holds the loaded program and its installation, and plays it.

    Every action raises `RefusedError` when it cannot be done.

    Attributes:
        loaded: the program, as it was in its file when it was loaded.
        installation: the one that was loaded last.
    """

    def __init__(
        self, box: ServedBox, folder: ProgramFolder, network: LoopNetwork, *, skip_unknown: bool = False
    ) -> None:
        """Begin with no program; the network connects to the PCs of External Control."""
        self._skip_unknown = skip_unknown
        self._box = box
        self._network = network
        self.folder = folder
        self.loaded: LoadedProgram | None = None
        self.installation = NEW_BOX
        self._ready: CompileResult | None = None
        self._loading: list[Steps[Any]] = []
        self._catalogue = box.identity.software.catalogue

    # --- state

    @property
    def is_running(self) -> bool:
        """True while a program plays, also one that a client has sent."""
        return self._box.snapshot.runtime_state in RUNNING_STATES

    @property
    def is_paused(self) -> bool:
        """True while a program is paused, or about to be."""
        return self._box.snapshot.runtime_state in _PAUSED

    @property
    def script(self) -> str:
        """Script of the loaded program, with a comment where a PC's part belongs; "" without one."""
        return self.loaded.script(lambda pc: "# External Control") if self.loaded else ""

    # --- actions

    def load(self, name: str, *, stops: bool = False) -> Steps[None]:
        """Load a program and its installation; what was loaded, and runs, stays if that fails.

        `stops`: a program that runs is stopped once the file is read.
        """
        yield from self._in_turn(self._load(name, stops=stops))

    def load_installation(self, name: str) -> Steps[None]:
        """Load an installation; the one before stays if that fails."""
        yield from self._in_turn(self._load_installation(name))

    def load_default(self) -> Steps[StartUp]:
        """Load the default installation and the program that it names; return what is to happen next."""
        return (yield from self._in_turn(self._load_default()))

    def _load_default(self) -> Steps[StartUp]:
        yield from self._load_installation(DEFAULT_NAME)
        start = self.installation.start_up
        if start.program:
            yield from self._load(start.program)
        return start

    def _load(self, name: str, *, stops: bool = False) -> Steps[None]:
        what = f"load {name}"
        if not stops:
            self._must_be_stopped(what)
        loaded, ready, set_up = yield from self._read(what, load_and_compile, name, self._skip_unknown)
        if stops:
            with suppress(RefusedError):  # when the controller is not up, there is nothing to stop
                yield from self.stop()
        installation = loaded.installation or self.installation
        yield from self._set_up(what, installation, set_up)
        self.loaded, self._ready = loaded, ready
        for note in (f"Loaded program: {loaded.wire_path}", *loaded.notes):
            self._box.note(note)
        self._use(installation, set_up)
        if isinstance(ready, ScriptFailed):
            self._box.note(f"{loaded.file_name} will not start: {ready.log_text or ready.text}")

    def _load_installation(self, name: str) -> Steps[None]:
        what = f"load installation {name}"
        self._must_be_stopped(what)
        installation, set_up = yield from self._read(what, load_installation_and_compile, name)
        yield from self._set_up(what, installation, set_up)
        self._box.note(f"Loaded installation: {installation.wire_path}")
        self._use(installation, set_up)

    def play(self, client: str) -> Steps[None]:
        """Let a paused program go on, or start the loaded one from the top.

        `client` is the address of who wants it; External Control asks there if no PC is named.
        """
        asked = time.monotonic()
        self._must_be_able_to_play()
        if self.is_paused:
            try:
                yield from self._box.apply(ResumeProgram())
            except RefusedError:
                if self.is_paused:  # otherwise another client has resumed it already
                    raise
            return
        try:
            program = yield from self._prepare(client)
        except WorkerError as error:
            self._refuse("play", error)
        if isinstance(program, ScriptFailed):
            self._box.announce(program)
            self._refuse("play", "the program does not compile")
        self._must_be_able_to_play()  # it took a while to get here
        if self.is_paused:
            self._refuse("play", "a program is paused")
        yield from self._box.start(program, asked, loaded=True)
        if self.installation.variables:
            self._box.start_alone(self._keep_variables())

    def pause(self) -> Steps[None]:
        """Pause the program that plays, and end when the arm rests."""
        if not self.is_running or self.is_paused:
            self._refuse("pause", "no program plays")
        with suppress(RefusedError):  # it has ended meanwhile
            yield from self._box.apply(PauseProgram())
        while self._box.snapshot.runtime_state == ProgramState.PAUSING:
            yield
        if not self._box.controller.programs.is_running:
            self._refuse("pause", "the program has ended")

    def stop(self) -> Steps[None]:
        """Stop the program, if one is running or paused, and end when the arm rests."""
        if self._box.snapshot.robot_mode in _NOT_UP:
            self._refuse("stop", "the controller is not up")
        stopped = self._box.controller.programs.latest
        yield from self._box.apply(StopProgram())
        while (
            self._box.snapshot.runtime_state == ProgramState.STOPPING
            and self._box.controller.programs.latest is stopped
        ):
            yield

    # --- how

    def _in_turn(self, work: Steps[T]) -> Steps[T]:
        """Load after all that was asked for before: each loading begins with what that has left."""
        self._loading.append(work)
        try:
            while self._loading[0] is not work:
                yield
            return (yield from work)
        finally:
            self._loading.remove(work)

    def _read(self, what: str, read: Callable[..., T], name: str, *arguments: bool) -> Steps[T]:
        """Read a file in the worker process; refuse the action if it cannot be used."""
        try:
            return (
                yield from self._box.in_worker(
                    read, self.folder, name, self.installation, self._catalogue, *arguments
                )
            )
        except (EmulatorError, OSError) as error:
            self._refuse(what, error)

    def _set_up(self, what: str, installation: Installation, set_up: CompileResult | None) -> Steps[None]:
        """Make an installation effective, and end when it is; not while a program runs."""
        self._must_be_stopped(what)  # the file has taken a while
        if set_up is not None and not isinstance(set_up, ScriptFailed):
            limits = limits_of(self._box.controller.state.robot).within(installation.safety)
            try:
                yield from self._box.apply(SetUp(set_up, limits, installation.safety.inputs))
            except RefusedError as error:
                self._refuse(what, error)

    def _use(self, installation: Installation, set_up: CompileResult | None) -> None:
        """Take an installation that is effective; the log says what of it is not."""
        if installation is not self.installation:
            self._declare(installation)
            self._box.start_alone(self._follow_inputs(installation.input_actions))
        if isinstance(set_up, ScriptFailed):
            self._box.note(f"{installation.wire_path} has no effect: {set_up.log_text or set_up.text}")
        elif set_up is not None:
            for setting in installation.safety.unwatched:
                self._box.note(f"{installation.wire_path}: {setting} not watched")

    def _declare(self, installation: Installation) -> None:
        """Take an installation; the loaded program begins with what it declares from the next start on."""
        self.installation = installation
        loaded = self.loaded
        if loaded is not None and loaded.installation not in (None, installation):
            self.loaded = replace(loaded, installation=installation)
            self._ready = None

    def _follow_inputs(self, declared: tuple[tuple[str, int, str], ...]) -> Steps[None]:
        """Do what the inputs of the installation ask for, until another one is loaded.

        Each is declared by its group, as in the names of builtins, its index and its action. It acts on a
        rising edge. Source: the user manuals' page of I/O set-up, from memory. FREEDRIVE acts in the
        controller.
        """
        lines = self._box.controller.state.io_configuration
        acts = {"START": self._start_by_input, "PAUSE": self.pause, "STOP": self.stop}
        inputs = [(group, index, acts[action]) for group, index, action in declared if action in acts]
        before = [True] * len(inputs)
        while inputs and self.installation.input_actions is declared:
            levels = [lines.is_high(group, index) for group, index, _ in inputs]
            for (_, _, act), was_high, is_high in zip(inputs, before, levels, strict=True):
                if is_high and not was_high:
                    self._box.start_alone(act())
            before = levels
            yield

    def _start_by_input(self) -> Steps[None]:
        if not self._box.controller.state.pendant.remote_period:
            self._refuse("play", "an input starts programs only in remote control")
        yield from self.play(THIS_MACHINE)

    def _keep_variables(self) -> Steps[None]:
        """Wait for the end of the program, then keep the values of the installation's variables."""
        installation, programs = self.installation, self._box.controller.programs
        run = programs.latest
        while programs.is_running and programs.latest is run:
            yield
        if self.installation is not installation or run is None:
            return
        values = dict(installation.variables)
        for name in values.keys() & set(run.program.declared_globals):
            values[name] = literal(run.read_global(name)) or values[name]
        if values == installation.variables:
            return
        self._declare(replace(installation, variables=values))
        try:
            yield from self._box.in_worker(write_variables, self.folder, installation.wire_path, values)
        except (EmulatorError, OSError) as error:
            self._box.note(f"the variables of {installation.wire_path} are not saved: {error}")
        else:
            self._box.note(f"Saved the variables of {installation.wire_path}")

    def _must_be_stopped(self, what: str) -> None:
        if self._box.controller.programs.is_running:
            self._refuse(what, PROGRAM_RUNS)

    def _must_be_able_to_play(self) -> None:
        """Refuse to play while something stands against it: the first of these."""
        state = self._box.controller.state
        obstacle = why_not_running(state)
        undefined = "" if self.loaded is None else self.loaded.undefined
        for stands, why in (
            (bool(obstacle), obstacle),
            (self.is_running and not self.is_paused, "a program plays already"),
            (bool(state.pendant.requests), "a popup waits to be closed, or a question for its answer"),
            (self.loaded is None and not self.is_paused, "no program is loaded"),
            (bool(undefined) and not self.is_paused, f"{undefined}; fill it in with PolyScope"),
        ):
            if stands:
                self._refuse("play", why)

    def _prepare(self, client: str) -> Steps[CompileResult]:
        """Return the loaded program ready to start; parts that PCs have are fetched now."""
        loaded = self.loaded
        assert loaded is not None
        if self._ready is not None:
            return self._ready
        received: dict[ExternalControlPc, str] = {}
        default = self.installation.pc.over(ExternalControlPc(client, SCRIPT_SENDER_PORT))
        for pc in loaded.pcs:
            received[pc] = yield from request_program(self._network, pc.over(default))
        return (yield from self._box.in_worker(compile_loaded, loaded, received, self._catalogue))

    def _refuse(self, what: str, why: str | Exception) -> NoReturn:
        """Refuse an action, and write into the log why."""
        text = f"{what} failed: {why if isinstance(why, str | EmulatorError) else repr(why)}"
        self._box.note(text)
        raise MissingFileRefusal(text) if isinstance(why, FileMissingError) else RefusedError(text)


_LINE = re.compile(r"([a-z_]+)\[(\d)\]")
_GROUPS = {"digital_in": STANDARD, "config_in": CONFIGURABLE, "tool_in": TOOL}


def start_up(box: ServedBox, player: ProgramPlayer) -> Steps[None]:
    """Load the default installation and the program that it names, and start that when its line changes.

    What cannot be done is in the log. That the line starts the program once: chosen.
    """
    if not player.folder.exists or not player.folder.has(DEFAULT_NAME):
        return
    with suppress(RefusedError):
        start = yield from player.load_default()
        program = player.loaded
        if program is None or not start.start_line:
            return
        bit = _input_bit(player.installation.lines.get(start.start_line, start.start_line))
        if bit is None:
            box.note(f"{start.program} is not started by {start.start_line!r}: it is no digital input")
            return
        lines = box.controller.state.io
        before = lines.read_digital_in(bit)
        while lines.read_digital_in(bit) is before or before is start.start_level:
            before = lines.read_digital_in(bit)
            yield
        if player.loaded is not None and player.loaded.wire_path == program.wire_path:
            yield from player.play(THIS_MACHINE)


def _input_bit(line: str) -> int | None:
    """Return the bit of a digital input in the word of all; None for a line that is none."""
    match = _LINE.fullmatch(line)
    group = _GROUPS.get(match[1]) if match else None
    if match is None or group is None or int(match[2]) >= group.count:
        return None
    return group.bits[int(match[2])]
