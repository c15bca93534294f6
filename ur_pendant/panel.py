"""What a robot reports as text and plots, and the controls that people have over an emulated one.

What comes from robots is shown as text only, cut, and without characters that do not print.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from enum import IntEnum
from functools import partial
from itertools import islice
from math import degrees, nan, pi
from operator import methodcaller
from typing import Any

import numpy as np
from viser import uplot

from pc_client.arrays import Array
from protocol.ur_types import JOINT_NAMES, ProgramState, RobotMode, SafetyStatus
from ur_emulator.host.control_api.box_state import Question
from ur_emulator.machine.controller.io.lines import DIGITAL_GROUPS, DigitalGroup
from ur_emulator.machine.models.things import SIZES
from ur_pendant.drawing import ArmDrawing, RobotDrawing
from ur_pendant.guiding import JOG_RATE, Guiding, Workspace
from ur_pendant.hands import SPEED, Errand, Errands, HandError, Hands
from ur_pendant.robot import PLOTTED, RATE, Robot, Sample, Signal, numbers, plain
from ur_pendant.server import PageServer

Show = Callable[[Robot], str]
Postures = dict[str, Array]


def _figures(form: str, *names: str, scale: float = 1.0, part: slice = slice(None)) -> Show:
    return lambda r: "  ".join(
        format(scale * n, form) for name in names for n in numbers(r.values, name)[part]
    )


def _named(kind: type[IntEnum], *names: str) -> Show:
    """The name of a mode, by the first signal that is reported."""
    known = {int(member): member.name for member in kind}
    return lambda r: next((known.get(int(n), "?") for name in names for n in numbers(r.values, name)), "")


def _levels(word: str, group: DigitalGroup) -> Show:
    return lambda r: " ".join(str(int(n) >> bit & 1) for n in numbers(r.values, word) for bit in group.bits)


_RUNTIME = _named(ProgramState, "runtime_state")
ABOUT: Mapping[str, Show] = {
    "Robot": lambda robot: robot.problem or robot.title,
    "Mode": _named(RobotMode, "robot_mode"),
    "Safety": _named(SafetyStatus, "safety_status", "safety_mode"),
    "Operation": lambda robot: getattr(robot.state, "operational_mode", ""),
    "Remote": lambda robot: str(getattr(robot.state, "remote_control", "")),
    "Program": lambda robot: f"{robot.program or 'none'} ({_RUNTIME(robot).lower()})",
    "Line": _figures(".0f", "script_control_line"),
    "At": lambda robot: robot.label,
    "Popups": lambda robot: "; ".join((*robot.popups, *(question.text for question in robot.questions))),
    "Speed": _figures(".0%", "target_speed_fraction"),
}
ARM: Mapping[str, Show] = {
    "TCP mm": _figures(".1f", "actual_TCP_pose", scale=1e3, part=slice(3)),
    "TCP rad": _figures(".3f", "actual_TCP_pose", part=slice(3, 6)),
    "Force N": _figures(".1f", "actual_TCP_force", part=slice(3)),
    "Torque Nm": _figures(".2f", "actual_TCP_force", part=slice(3, 6)),
    "Payload kg": _figures(".2f", "payload"),
    "Grippers": lambda r: ", ".join(f"{k} {g[k]:.4g}" for g in getattr(r.state, "grippers", ()) for k in g),
}
INPUTS = {f"In, {name}": _levels("actual_digital_input_bits", g) for name, g in DIGITAL_GROUPS.items()}
OUTPUTS = {f"Out, {name}": _levels("actual_digital_output_bits", g) for name, g in DIGITAL_GROUPS.items()}
LISTS: Mapping[str, Callable[[Robot], Sequence[str]]] = {
    "Clients": lambda robot: getattr(robot.state, "clients", ()),
    "Variables": lambda robot: [f"{name} = {value}" for name, value in list(robot.variables.items())],
}
LINES: Mapping[str, Show] = {
    "Analog in": _figures(".3f", "standard_analog_input0", "standard_analog_input1"),
    "Analog out": _figures(".3f", "standard_analog_output0", "standard_analog_output1"),
    "Tool V": _figures(".0f", "tool_output_voltage"),
    "Integers": _figures(".0f", *(f"output_int_register_{k}" for k in range(4))),
    "Doubles": _figures(".4g", *(f"output_double_register_{k}" for k in range(4))),
}

# --- keys: those of a pendant, and operations of the control API

Deed = Callable[[Hands], object]
_do, _press = partial(methodcaller, "operate"), partial(methodcaller, "press")
EMERGENCY = {"Emergency stop": _do("emergency_stop"), "Release": _do("release_emergency_stop")}
"""Buttons of the row that stands above all else, whatever is shown."""
_POWER = {
    "Power on": _press("power on", "power_on"),
    "Release brakes": _press("brake release", "release_brakes"),
    "Power off": _press("power off", "power_off"),
}
_PROGRAM = {
    "Play": _press("play", "resume_program"),
    "Pause": _press("pause", "pause_program"),
    "Stop": _press("stop", "stop_program"),
    "Close popup": _press("close popup", "close_popups"),
}
_SAFETY = {
    "Unlock protective stop": _press("unlock protective stop", "unlock_protective_stop"),
    "Restart safety": _press("restart safety", "restart_safety"),
}
_TROUBLE = {"Protective stop": "protective_stop", "Violation": "trigger_violation", "Fault": "trigger_fault"}
_MODES, _POSITIONS = ("manual", "automatic", "none"), ("released", "pressed", "fully pressed", "none")
ROWS: Sequence[tuple[str, int, Mapping[str, Deed]]] = (
    ("Power", 0, _POWER),
    ("Program", 0, _PROGRAM),
    ("Safety", 0, _SAFETY),
    ("Safeguard", 3, {"Open": _do("safeguard_stop"), "Close": _do("safeguard_stop", active=False)}),
    ("Trouble", 3, {label: _do(operation) for label, operation in _TROUBLE.items()}),
    ("Mode", 5, {mode.capitalize(): _do("set_operational_mode", mode=mode) for mode in _MODES}),
    ("Enabling", 5, {where.capitalize(): _do("enabling_device", position=where) for where in _POSITIONS}),
    ("Control", 5, {"Remote": _do("remote_control"), "Local": _do("remote_control", on=False)}),
)
"""Label, first major version of the software that has it (0: also without a control API), and buttons."""

_FREEDRIVE = "def pendant_freedrive():\n  freedrive_mode()\n  while True:\n    sync()\n  end\nend\n"
FREEDRIVE: Mapping[str, Deed] = {"On": methodcaller("run", _FREEDRIVE), "Off": _PROGRAM["Stop"]}

# --- text and plots

_SLOWLY, _LEFT = 0.2, 2.0  # Between updates of text; before what was set follows the robot again [s].
_LINES = 40
_PLOTTED = 20.0  # How much is plotted [s]: about every other sample, and always the same ones.
_COLOURS = ("#d62728", "#2ca02c", "#1f77b4", "#ff7f0e", "#9467bd", "#17becf")
_READS: Mapping[str, Callable[[str], Any]] = {"Boolean": "yes".__eq__, "Integer": int, "Float": float}
_SIGNALS = {signal.name: signal for signal in PLOTTED}


def columns(samples: Sequence[Sample], signal: Signal, now: float) -> tuple[Array, ...]:
    """Times after now [s] and six numbers of a signal, each (n,); nan where there is none."""
    width, missing = len(signal.parts) or 1, (nan,) * len(signal.parts) or nan
    rows = np.full((len(samples), len(_COLOURS)), nan)  # always so many, as a plot has lines
    rows[:, :width] = np.reshape([s.values.get(signal.name, missing) for s in samples], (-1, width))
    return (np.array([sample.time - now for sample in samples]), *rows.T)


def _listed(texts: Iterable[str]) -> str:
    return "\n".join(plain(text) for text in islice(texts, _LINES))


def _log(robot: Robot, wanted: str) -> Iterator[str]:
    """Yield the lines of the log with a text that is wanted, the newest first."""
    return (f"{at:.2f}  {text}" for at, text in list(robot.log)[::-1] if wanted in text.lower())


def _speed(robot: Robot, slider: Any) -> int:
    is_set = time.time() - slider.update_timestamp < _LEFT
    return slider.value if is_set else round(100 * sum(numbers(robot.values, "target_speed_fraction")))


class Access(IntEnum):
    """What people may do to a robot: nothing, what a pendant can, what the control API of a box can, too."""

    NONE, PENDANT, BOX = range(3)


class Panel:
    """Values and controls of one robot, which are made anew for another access or arm."""

    def __init__(
        self, server: PageServer, robot: Robot, hands: Hands, drawing: RobotDrawing, container: Any = None
    ) -> None:
        """Make it in a `container` of viser, such as a tab, or beside the picture."""
        workspace = Workspace(server, robot, hands, drawing, Errands(server.events))
        postures: Postures = {"upright": np.array((0.0, -pi / 2, 0.0, -pi / 2, 0.0, 0.0))}
        self._make = partial(Controls, workspace, container or nullcontext(), postures)
        self._robot, self._drawing = robot, drawing
        self._controls: Controls | None = None

    def update(self) -> None:
        """Show what is new; call it 30 times a second, after the drawing's."""
        may = Access.BOX if self._robot.address.control_port else Access.PENDANT
        wanted = Access.NONE if self._robot.refusal else may, self._drawing.arm
        if self._controls is None or self._controls.made_for != wanted:
            if self._controls is not None:
                self._controls.remove()
            self._controls = self._make(*wanted)
        self._controls.update()


class Controls:
    """What a panel has for one access to a robot with one arm."""

    def __init__(
        self, workspace: Workspace, container: Any, postures: Postures, access: Access, arm: ArmDrawing | None
    ) -> None:
        self.made_for = access, arm
        self._server, self._robot, self._hands, drawing, self._errands = workspace
        self._container, self._postures, self._access = container, postures, access
        self._gui, self._entry = self._server.gui, self._server.events.entry
        self._base = drawing.root.name
        self._refreshed = 0.0
        self._following: list[tuple[Any, str, Callable[[Robot], object]]] = []
        self._asked: dict[Question | str, Any] = {}
        self._charts: deque[tuple[Any, Any]] = deque()
        self._guiding = Guiding(workspace, arm) if access > Access.NONE and arm is not None else None
        with container:
            self._parts = [self._emergency_row()] if access is Access.BOX else []
            self._tabs = self._gui.add_tab_group()
        self._parts.append(self._tabs)
        for label, least, make in (
            ("Robot", Access.NONE, self._make_keys),
            ("Move", Access.NONE, self._make_moves),
            ("I/O", Access.NONE, self._make_lines),
            ("World", Access.BOX, self._make_world),
            ("Plots", Access.NONE, self._make_plots),
            ("Log", Access.NONE, self._make_lists),
        ):
            if access >= least:
                with self._tabs.add_tab(label):
                    make()

    def update(self) -> None:
        """Show what is new."""
        if self._guiding is not None:
            self._guiding.update(can_drag=self._can_drag.value)
        now = time.monotonic()
        if now - self._refreshed >= _SLOWLY:
            self._refreshed = now
            for handle, name, show in self._following:
                if getattr(handle, name) != (value := show(self._robot)):
                    setattr(handle, name, value)
            if self._access is Access.BOX:
                self._show_questions()
                if self._guiding is not None:
                    self._guiding.offer_pulls()
            if not self._pause.value and self._server.get_clients():
                self._draw_chart(now)

    def remove(self) -> None:
        """Take everything away."""
        for part in (*self._parts, *self._asked.values()):
            part.remove()
        if self._guiding is not None:
            self._guiding.remove()

    # --- tabs

    def _make_keys(self) -> None:
        robot, hands, gui, is_box = self._robot, self._hands, self._gui, self._access is Access.BOX
        if self._access is Access.NONE:
            self._texts({"Controls": lambda robot: f"none: {robot.refusal}"})
        self._texts(ABOUT)
        if self._access is Access.NONE or robot.info is None:
            return
        major = robot.info.version.major if is_box else 0
        for label, since, deeds in ROWS:
            if since <= major:
                self._row(label, deeds)
        if is_box and robot.info.lockstep:
            spans = {"One cycle": robot.info.period, "0.1 s": 0.1, "1 s": 1.0}
            self._row("Time", {label: methodcaller("let_pass", span) for label, span in spans.items()})
        if is_box:
            slider = gui.add_slider("Speed %", 0, 100, 1, 100)
            set_speed, ask = partial(hands.operate, "set_speed"), self._errands.ask
            slider.on_update(
                self._entry(
                    lambda client: ask(client, partial(set_speed, fraction=slider.value / 100), "speed")
                )
            )
            self._following.append((slider, "value", lambda robot: _speed(robot, slider)))
        if robot.address.ports.dashboard:
            name = gui.add_text("File", "", hint="of a program, in the box's folder")
            self._button("Load program", lambda: partial(hands.tell_dashboard, f"load {plain(name.value)}"))

    def _make_moves(self) -> None:
        guiding = self._guiding
        if guiding is not None:
            self._make_postures(guiding)
        for joint, name in enumerate(JOINT_NAMES):
            figure = _figures(".1f", "actual_q", scale=degrees(1.0), part=slice(joint, joint + 1))
            span = "" if guiding is None else f"±{degrees(guiding.arm.model.limits.q_max[joint]):.0f}"
            self._texts({f"{name} {span}°": figure})
            if guiding is not None:
                for sign, symbol in ((-1, "−"), (1, "+")):
                    button = self._gui.add_button(f"{name} {symbol}")
                    step = partial(guiding.jog, joint=joint, step=sign * SPEED / JOG_RATE)
                    button.on_hold(self._entry(step), JOG_RATE)
                    button.on_click(self._entry(guiding.release))
        self._texts(ARM)

    def _make_postures(self, guiding: Guiding) -> None:
        gui, postures = self._gui, self._postures

        def store(_: Any) -> None:
            postures[f"posture {len(postures)}"] = np.array(numbers(self._robot.values, "actual_q"))

        self._can_drag = gui.add_checkbox("Drag the tool", True, hint="by its frame in the picture")
        self._row("Freedrive", FREEDRIVE)
        stored = gui.add_dropdown("Posture", tuple(postures))
        self._following.append((stored, "options", lambda _: tuple(postures)))
        gui.add_button("Store posture").on_click(self._entry(store))
        go = self._entry(lambda client: guiding.go(client, postures[stored.value]))
        gui.add_button("Go there").on_click(go)

    def _make_lines(self) -> None:
        is_box = self._access is Access.BOX
        for group in DIGITAL_GROUPS.values() if is_box else ():
            self._make_inputs(group)
        self._texts({**({} if is_box else INPUTS), **OUTPUTS, **LINES})

    def _make_inputs(self, group: DigitalGroup) -> None:
        """Buttons with a number and a level, which a click changes."""
        label, change = f"In, {group.name}", partial(_do, "set_digital_input", group=group.name)
        faces = {(n, k): f"{n} {'●' if k == '1' else '○'}" for k in "01" for n in range(group.count)}
        row = self._row(label, {face: change(n=n, level=k == "0") for (n, k), face in faces.items()})

        def show(robot: Robot) -> tuple[str, ...]:
            return tuple(faces[pair] for pair in enumerate(INPUTS[label](robot).split()))

        self._following.append((row, "options", show))

    def _make_world(self) -> None:
        gui, robot, hands = self._gui, self._robot, self._hands
        name = gui.add_text("Name", "box")
        shape = gui.add_dropdown("Shape", tuple(SIZES))
        size = gui.add_vector3("Size m", (0.1, 0.1, 0.1), step=0.01, hint="edges; or radius, length")
        at = gui.add_vector3("At m", (0.4, 0.2, 0.1), step=0.01, hint="of its middle, in the base frame")
        mass = gui.add_number("Mass kg", 0.5, min=0.0, max=20.0, step=0.1)
        is_shown = gui.add_checkbox("Show the place", False, hint="by a frame in the picture, to be dragged")
        place = self._server.scene.add_transform_controls(
            f"{self._base}/place", 0.2, disable_rotations=True, position=at.value, visible=False
        )
        self._parts.append(place)
        is_shown.on_update(self._entry(lambda _: setattr(place, "visible", is_shown.value)))
        place.on_update(self._entry(lambda _: setattr(at, "value", tuple(np.round(place.position, 3)))))
        at.on_update(self._entry(lambda _: setattr(place, "position", at.value)))

        def put(operation: str, **more: float) -> Errand:
            given = {"name": name.value, "shape": shape.value, "pose": (*at.value, 0.0, 0.0, 0.0)}
            edges = size.value[: len(SIZES[shape.value])]
            return partial(hands.operate, operation, size=edges, **given, **more)

        def found() -> Mapping[str, Deed]:
            things, obstacles = getattr(robot.state, "things", ()), getattr(robot.state, "obstacles", ())
            removals = {plain(thing.name): _do("remove_thing", name=thing.name) for thing in things}
            return removals | {plain(name): _do("remove_obstacle", name=name) for name in obstacles}

        def nothing(_: Hands) -> None:
            raise HandError("nothing of this name is there to be removed")

        self._button("Put obstacle", lambda: put("add_obstacle"))
        self._button("Put thing", lambda: put("add_thing", mass=mass.value))
        hang = partial(hands.operate, "attach_payload")
        self._button("Hang load on the flange", lambda: partial(hang, mass=mass.value))
        there = gui.add_dropdown("There", ("nothing",))
        self._following.append((there, "options", lambda _: tuple(found()) or ("nothing",)))
        self._button("Remove", lambda: partial(found().get(there.value, nothing), hands))

    def _make_plots(self) -> None:
        self._pause = self._gui.add_checkbox("Pause", False)
        scales, data = {"x": uplot.Scale(time=False, range=(-_PLOTTED, 0.0))}, np.zeros((7, 1))
        for first in PLOTTED[0], PLOTTED[9]:
            choice = self._gui.add_dropdown("Signal", tuple(_SIGNALS), initial_value=first.name)
            plot = self._gui.add_uplot(tuple(data), tuple({} for _ in data), scales=scales, height=190)
            self._charts.append((choice, plot))

    def _make_lists(self) -> None:
        for label, items in LISTS.items():
            self._list(label, items)
        wanted = self._gui.add_text("Filter", "")
        self._list("Log", lambda robot: _log(robot, wanted.value.lower()))

    # --- controls

    def _texts(self, shows: Mapping[str, Show]) -> None:
        for label, show in shows.items():
            text = self._gui.add_text(label, "", disabled=True)
            self._following.append((text, "value", partial(lambda show, robot: plain(show(robot)), show)))

    def _list(self, label: str, items: Callable[[Robot], Iterable[str]]) -> None:
        text = self._gui.add_text(label, "", disabled=True, multiline=True)
        self._following.append((text, "value", lambda robot: _listed(items(robot))))

    def _button(self, label: str, decide: Callable[[], Errand]) -> None:
        ask = self._errands.ask
        self._gui.add_button(label).on_click(self._entry(lambda client: ask(client, decide())))

    def _row(self, label: str, deeds: Mapping[str, Deed]) -> Any:
        """Buttons beside each other."""

        def press(client: Any, button: str) -> None:
            self._errands.ask(client, partial(deeds[button], self._hands))

        row = self._gui.add_button_group(label, tuple(deeds))
        row.on_click(self._entry(press, lambda event: (event.target.value,)))
        return row

    def _emergency_row(self) -> Any:
        """Buttons that wait neither for the window's thread nor for what has been asked for before."""

        async def press(event: Any) -> None:
            self._errands.begin(event.client, partial(EMERGENCY[event.target.value], self._hands))

        row = self._gui.add_button_group("Emergency", tuple(EMERGENCY))
        row.on_click(press)
        return row

    def _draw_chart(self, now: float) -> None:
        """Draw the chart whose turn it is."""
        last = list(self._robot.history)[-round(_PLOTTED * RATE) :]
        samples = [s for s in last if now - s.time < _PLOTTED and s.time * RATE % 2.0 < 1.0]
        choice, plot = self._charts[0]
        self._charts.rotate()
        signal = _SIGNALS[choice.value]
        if plot.title != (title := f"{signal.name} [{signal.unit}]"):
            names = ("s", *(signal.parts or ("value",)), *[""] * len(_COLOURS))
            lines = zip(names, ("", *_COLOURS), strict=False)
            plot.series = tuple(uplot.Series(label=n, stroke=c, show=n != "") for n, c in lines)
            plot.title = title
        plot.data = columns(samples, signal, now)

    def _show_questions(self) -> None:
        """Show popups and questions above the tabs, where they cover nothing."""
        now: set[Question | str] = {*self._robot.popups[:3], *self._robot.questions[:3]}
        for gone in self._asked.keys() - now:
            self._asked.pop(gone).remove()
        for new in now - self._asked.keys():
            with self._container:
                self._asked[new] = self._make_question(new)

    def _make_question(self, new: Question | str) -> Any:
        gui, text = self._gui, plain(new.text if isinstance(new, Question) else new)
        with gui.add_folder("A program says", order=self._tabs.order - 0.5) as folder:
            gui.add_text("Text", text, multiline=True, disabled=True)
            if isinstance(new, Question):
                kind, answer = new.kind.capitalize(), partial(self._answer, new)
                given = gui.add_dropdown(kind, ("yes", "no")) if kind == "Boolean" else gui.add_text(kind, "")
                self._button("Answer", lambda: partial(answer, given.value))
            self._row("Program", {label: _PROGRAM[label] for label in ("Close popup", "Stop")})
        for client in self._server.get_clients().values():
            client.add_notification("A program says", text, auto_close_seconds=6.0)
        return folder

    def _answer(self, question: Question, text: str) -> None:
        read = _READS.get(question.kind.capitalize(), str)
        self._hands.operate("answer", id=question.id, value=read(text))
