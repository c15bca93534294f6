"""Random walks: programs at work, and everything that people, clients and surroundings do to a box, at random times.

A walk is a list of steps that a seed makes; it is made before it is walked, so a part of it can be walked again.
"""

import contextlib
import random
import shutil
import struct
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from walk_box import JOURNAL, KINDS, WalkBox, rtde
from walk_programs import KEPT_OUTPUT, program, statements_of
from walk_rules import BrokenRule, Rules

sys.path.append(str(Path(__file__).parent.parent / "ur_emulator"))
from dashboard_support import external_control, installation, urp

from protocol.ur_types import ProgramState, RobotMode, SafetyMode, SoftwareVersion
from ur_emulator.host.replay import replay
from ur_emulator.machine.commands.client_writes import WriteInputs

LOADED = 9  # program files of a walk; the last one asks a PC for its program


@dataclass(frozen=True)
class Step:
    """Something that happens, and the cycles that pass after it."""

    action: str
    arguments: tuple[Any, ...] = ()
    cycles: int = 1

    def __str__(self) -> str:
        shown = ", ".join(_short(argument) for argument in self.arguments)
        return f"{self.action}({shown}) then {self.cycles} cycles"


def _short(argument: object) -> str:
    text = repr(argument)
    return text if len(text) < 60 else f"<program of {text.count(chr(92))} lines>"


@dataclass(frozen=True)
class Walk:
    """A box, its program files, and what happens."""

    kind: str
    seed: int
    files: tuple[str, ...]
    steps: tuple[Step, ...]


# --- what can happen: how often, and what is drawn for it

Make = Callable[[random.Random], str]  # makes the text of a program


def _sent(rng: random.Random, make: Make) -> tuple[str, str]:
    return (rng.choice(["secondary", "primary", "realtime"]), make(rng))


def _line(rng: random.Random, make: Make) -> tuple[str]:
    lines = ["movej({home}, a=2, v=1)", "speedj([0,0,0,0,0,0.3], 2, 0.2)", "stopj(3)", "end_interpreter()"]
    lines += ["skipbuffer", "clear_interpreter()", "abort", "sleep(0.2)", "nonsense("]
    return (rng.choice(lines),)


_OPERATIONS: tuple[tuple[int, str, dict[str, list[Any]]], ...] = (
    (4, "protective_stop", {}),
    (5, "unlock_protective_stop", {}),
    (2, "emergency_stop", {"kind": ["robot", "system"]}),
    (3, "release_emergency_stop", {}),
    (3, "safeguard_stop", {"active": [True, False]}),
    (2, "safeguard_stop", {"active": [True, False], "safeguard": ["automatic mode"]}),
    (2, "reduced_mode", {"active": [True, False]}),
    (1, "trigger_violation", {}),
    (1, "trigger_fault", {}),
    (2, "restart_safety", {}),
    (1, "power_on", {}),
    (1, "power_off", {}),
    (4, "release_brakes", {}),
    (6, "pause_program", {}),
    (8, "resume_program", {}),
    (2, "stop_program", {}),
    (5, "set_speed", {"fraction": [0.0, 0.05, 0.3, 1.0, 1.0]}),
    (4, "close_popups", {}),
    (2, "answer", {"value": [3]}),
    (3, "press_button", {"button": ["teach"], "pressed": [True, False]}),
    (3, "push", {"force": [(0, 0, 40), (30, 0, 0), (0, -250, 0)], "duration": [0.1, 0.5]}),
    (1, "attach_payload", {"mass": [0.0, 0.5, 3.0]}),
    (1, "set_operational_mode", {"mode": ["none", "manual", "automatic"]}),
    (1, "enabling_device", {"position": ["none", "released", "pressed", "fully pressed"]}),
    (1, "require_safeguard_reset", {"required": [True, False]}),
    (1, "reset_safeguard", {}),
    (2, "set_digital_input", {"group": ["standard"], "n": [0, 1, 2], "level": [True, False]}),
    (1, "change_safety_settings", {}),
    (1, "confirm_safety", {}),
)
_ACTIONS: tuple[tuple[int, str, Callable[[random.Random, Make], tuple[Any, ...]] | None], ...] = (
    (6, "play", None),
    (1, "load", lambda rng, make: (rng.randrange(LOADED),)),
    (3, "player pause", None),
    (1, "player stop", None),
    (2, "send", _sent),
    (
        3,
        "secondary",
        lambda rng, make: (rng.choice(["speedj([0,0,0,0,0,0.2], 2)", "protective_stop()", "x = 1"]),),
    ),
    (4, "interpreter", _line),
    (3, "freedrive by a client", lambda rng, make: (rng.random() < 0.5,)),
    (
        2,
        "connect",
        lambda rng, make: (rng.choice(["primary", "realtime", "rtde", "dashboard", "secondary_ro"]),),
    ),
    (
        2,
        "leave",
        lambda rng, make: (rng.choice(["primary", "realtime", "rtde", "dashboard", "secondary_ro"]),),
    ),
    (2, "rtde slider", lambda rng, make: (rng.choice([0.0, 0.2, 1.0]),)),
    (
        2,
        "gripper",
        lambda rng, make: (rng.choice(["SET ACT 1 GTO 1", "SET POS 255", "SET POS 0", "GET POS"]),),
    ),
    (2, "obstacle", lambda rng, make: (rng.choice([True, False]),)),
)


def make_walk(kind_name: str, seed: int, length: int) -> Walk:
    """Make a walk of so many steps."""
    rng = random.Random(f"{kind_name} {seed}")
    kind = KINDS[kind_name]
    with _tempdir() as folder, contextlib.closing(WalkBox(kind, 0, folder, "exact")) as box:
        home, version = box.controller.state.robot.home_q, box.served.identity.software
        names = statements_of(version.catalogue)

    def make(rng: random.Random) -> str:
        chosen = rng.sample(names, rng.randint(1, 4))
        return program(rng, chosen, home, "{port}")

    table: list[tuple[int, str, Any]] = [
        (weight, "operation", (name, drawn)) for weight, name, drawn in _OPERATIONS
    ]
    table += [(weight, name, drawn) for weight, name, drawn in _ACTIONS]
    weights = [weight for weight, _, _ in table]
    steps = []
    for _ in range(length):
        if rng.random() < 0.25:
            # A program is at work for a while, before anything happens to it.
            started = (
                Step("send", _sent(rng, make))
                if rng.random() < 0.3
                else Step("start", (rng.randrange(LOADED),))
            )
            steps += [Step("recover"), replace(started, cycles=rng.randint(1, 300))]
            continue
        _, name, drawn = rng.choices(table, weights)[0]
        if name == "operation":
            operation, values = drawn
            arguments: tuple[Any, ...] = (
                operation,
                tuple((key, rng.choice(some)) for key, some in values.items()),
            )
        else:
            arguments = drawn(rng, make) if drawn else ()
            arguments = tuple(
                a.replace("{home}", str(list(home))) if isinstance(a, str) else a for a in arguments
            )
        cycles = rng.choice([1, 1, 2, 3, 5, 10, 30, 60, 120])
        steps.append(Step(name, arguments, cycles))
    files = tuple(make(rng) for _ in range(LOADED - 1))
    return Walk(kind_name, seed, files, (*steps, Step("recover"), Step("new program")))


# --- walking it


class Walker:
    """Does the steps of a walk on a box."""

    def __init__(self, box: WalkBox) -> None:
        self._box = box
        self._version = SoftwareVersion(*box.served.identity.software.version)
        self.rules = Rules(box, self._version)

    def step(self, step: Step) -> None:
        getattr(self, "_" + step.action.replace(" ", "_"))(*step.arguments)
        self._box.tick(step.cycles)
        self._box.read()

    def _operation(self, name: str, arguments: Sequence[tuple[str, object]]) -> None:
        self._box.perform(name, **dict(arguments))

    def _play(self) -> None:
        self._box.steps(self._box.player.play("walk"))

    def _load(self, number: int) -> None:
        self._box.steps(self._box.player.load(f"walk{number}.urp"))

    def _start(self, number: int) -> None:
        self._player_stop()
        self._load(number)
        self._play()

    def _player_pause(self) -> None:
        self._box.steps(self._box.player.pause())

    def _player_stop(self) -> None:
        self._box.steps(self._box.player.stop())

    def _send(self, port: str, text: str) -> None:
        self._box.send(port, self._text(text).encode())

    def _secondary(self, statement: str) -> None:
        self._box.send("secondary", f"sec beside():\n  {statement}\nend\n".encode())

    def _interpreter(self, line: str) -> None:
        self._box.send("interpreter", line.encode() + b"\n")

    def _freedrive_by_a_client(self, on: bool) -> None:
        self._box.send("dashboard", b"set robotmode freedrive\n" if on else b"set robotmode run\n")

    def _connect(self, name: str) -> None:
        self._box.connect(name)
        if name == "rtde" and name in self._box.clients:
            self._box.send(
                name, rtde("V", b"\0\2") + rtde("O", struct.pack(">d", 125.0) + b"actual_q,safety_mode")
            )
            self._box.send(name, rtde("I", b"speed_slider_mask,speed_slider_fraction") + rtde("S"))

    def _leave(self, name: str) -> None:
        self._box.leave(name)

    def _rtde_slider(self, fraction: float) -> None:
        if "rtde" not in self._box.clients:
            self._connect("rtde")
        self._box.send("rtde", rtde("U", struct.pack(">BId", 1, 1, fraction)))

    def _gripper(self, line: str) -> None:
        self._box.send("gripper", line.encode() + b"\n")

    def _obstacle(self, is_there: bool) -> None:
        if is_there:
            self._operation("add_obstacle", (("name", "walk"), ("shape", "box"), ("size", (0.1, 0.1, 0.1)),
                                             ("pose", (0.25, -0.3, 0.05, 0.0, 0.0, 0.0))))  # fmt: skip
        else:
            self._operation("remove_obstacle", (("name", "walk"),))

    def _recover(self) -> None:
        """Whatever has happened: what manuals tell to do leads back to a program at work, or to one that has ended.

        A program may stop the arm again and again; then it is stopped.
        """
        for attempt in range(3):
            if attempt == 2:
                self._operation("stop_program", ())
            self._clear_everything()
            if not self._is_stopped():
                break
        now = self._box.now
        self._claim(now.robot_mode == RobotMode.RUNNING, f"robot mode {RobotMode(now.robot_mode).name}")
        self._claim(now.safety_mode == SafetyMode.NORMAL, f"safety mode {SafetyMode(now.safety_mode).name}")

    def _clear_everything(self) -> None:
        box = self._box
        undoing: tuple[tuple[str, dict[str, object]], ...] = (
            ("release_emergency_stop", {}),
            ("set_operational_mode", {"mode": "none"}),
            ("enabling_device", {"position": "none"}),
            ("require_safeguard_reset", {"required": False}),
            ("safeguard_stop", {"active": False, "safeguard": "automatic mode"}),
            ("safeguard_stop", {"active": False}),
            ("reset_safeguard", {}),
            ("press_button", {"button": "teach", "pressed": False}),
            ("reduced_mode", {"active": False}),
            ("push", {"force": (0, 0, 0)}),
            ("attach_payload", {"mass": 0.0}),
            ("remove_obstacle", {"name": "walk"}),
            ("confirm_safety", {}),
            ("remote_control", {"on": True}),
        )
        for name, arguments in undoing:
            box.perform(name, **arguments)
        for name in ("primary", "secondary", "realtime", "dashboard", "interpreter"):
            box.leave(name)  # those that connected in local control are not obeyed
        box.tick(round(6.0 / box.controller.period_s) if self._is_stopped() else 20)
        box.perform("unlock_protective_stop")
        if self._is_stopped() or box.now.safety_mode == SafetyMode.RECOVERY:
            box.perform("restart_safety")
        box.perform("release_brakes")
        box.tick(round(3.0 / box.controller.period_s))
        self._freedrive_by_a_client(False)
        for n in range(3):
            box.perform("set_digital_input", group="standard", n=n, level=False)
        box.perform("set_speed", fraction=1.0)
        for _ in range(5):
            box.perform("close_popups")
            box.perform("answer", value=3)
            box.tick(2)
        self._interpreter("end_interpreter()")
        if box.now.runtime_state in (ProgramState.PAUSED, ProgramState.PAUSING):
            box.perform("resume_program")
        self._expect_progress()

    def _expect_progress(self) -> None:
        """A program that plays gets on now, or ends; the rules know how long that may take."""
        box = self._box
        before = self.rules.n_places
        while not self._is_stopped() and self.rules.n_places < before + 3:
            if box.now.runtime_state in (ProgramState.STOPPED, ProgramState.PAUSED):
                break
            self._interpreter("end_interpreter()")
            box.perform("close_popups")
            box.perform("answer", value=3)
            box.tick(round(0.2 / box.controller.period_s))

    def _new_program(self) -> None:
        """The box takes a new program, and moves."""
        box = self._box
        self._recover()
        home = box.controller.state.robot.home_q
        goal = [home[0] + 0.3, *home[1:]]
        for _ in range(3):  # an arm that stands at a limit, or near something, is stopped once more
            self._box.send(
                "secondary", f"def fresh():\n  movej({list(home)})\n  movej({goal})\nend\n".encode()
            )
            box.tick(round(12.0 / box.controller.period_s))
            if max(abs(a - b) for a, b in zip(box.now.target_q, goal, strict=True)) < 1e-6:
                break
            self._recover()
        else:
            self._claim(False, f"a new program leaves the arm at {box.now.target_q}")
        state = ProgramState(box.now.runtime_state)
        self._claim(state is ProgramState.STOPPED, f"a new program is {state.name}")

    def _is_stopped(self) -> bool:
        return self._box.now.safety_mode not in (SafetyMode.NORMAL, SafetyMode.REDUCED)

    def _claim(self, holds: bool, text: str) -> None:
        if not holds:
            raise BrokenRule(f"tick {self._box.now.tick}: after a recovery: {text}")

    def _text(self, text: str) -> str:
        return text.replace("{port}", str(self._box.port))


def walk(made: Walk, show: Callable[[str], object] = lambda text: None) -> tuple[int, AssertionError] | None:
    """Walk, then replay the journal; return the step that broke a rule and what it was, or None."""
    with _tempdir() as folder:
        found = _walk(made, folder, show)
        if found is None:
            replayed = replay(folder / JOURNAL)
            if replayed.difference is not None or replayed.end:
                return len(made.steps) - 1, BrokenRule(f"the journal does not explain the walk: {replayed}")
    return found


def _walk(made: Walk, folder: Path, show: Callable[[str], object]) -> tuple[int, AssertionError] | None:
    kind = KINDS[made.kind]
    with contextlib.closing(WalkBox(kind, made.seed, folder)) as box:
        for number, text in enumerate(made.files):
            body = text.replace("{port}", str(box.port))
            (folder / f"walk{number}.script").write_text(body)
            node = f'<Script type="File"><cachedContents>{_escaped(body)}\nwalk()</cachedContents></Script>'
            (folder / f"walk{number}.urp").write_bytes(urp(node, name=f"walk{number}"))
        (folder / f"walk{LOADED - 1}.urp").write_bytes(
            urp(external_control("127.0.0.1", str(box.port)), name="external")
        )
        (folder / "default.installation").write_bytes(installation())
        kept = (
            ("standard_digital_output_mask", 1 << KEPT_OUTPUT),
            ("standard_digital_output", 1 << KEPT_OUTPUT),
        )
        box.served.submit(WriteInputs(kept))
        box.tick(3)
        walker = Walker(box)
        for index, step in enumerate(made.steps):
            show(f"{index}: {step}")
            try:
                walker.step(step)
                box.read()
                errors = [
                    e for e in box.served.log.entries if "is lost" in e.text or "cannot publish" in e.text
                ]
                if errors:
                    raise BrokenRule(str(errors[0]))
            except AssertionError as error:
                return index, error
    return None


def shrink(made: Walk, error: AssertionError, show: Callable[[str], object]) -> Walk:
    """Return the shortest walk found that breaks a rule in the same way: steps are left out as long as it does."""
    wanted = _what(error)

    def breaks(steps: tuple[Step, ...]) -> bool:
        found = walk(Walk(made.kind, made.seed, made.files, steps))
        return found is not None and _what(found[1]) == wanted

    steps, size = made.steps, max(1, len(made.steps) // 2)
    while size:
        begin = 0
        while begin < len(steps):
            fewer = steps[:begin] + steps[begin + size :]
            if fewer and breaks(fewer):
                steps = fewer
                show(f"{len(steps)} steps")
            else:
                begin += size
        size //= 2
    return Walk(made.kind, made.seed, made.files, steps)


def _what(error: AssertionError) -> str:
    """What a rule says, without its numbers."""
    return "".join(c for c in str(error).partition(": ")[2] if not c.isdigit())[:30]


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


@contextlib.contextmanager
def _tempdir() -> Iterator[Path]:
    folder = Path(tempfile.mkdtemp(prefix="walk"))
    try:
        yield folder
    finally:
        shutil.rmtree(folder)
