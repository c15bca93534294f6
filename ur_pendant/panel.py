"""What a robot reports as text and plots, and the controls that people have over an emulated one.

Everything is done by `Hands`, in threads of viser or in one of the panel's own: `update` waits for nobody.
What comes from robots is shown as text only, cut, and without characters that do not print.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import replace
from enum import IntEnum
from functools import partial
from itertools import islice
from math import degrees, nan, pi
from operator import methodcaller
from typing import Any

import numpy as np
import pinocchio as pin
from viser import ViserServer, uplot

from pc_client.arrays import Array
from pc_client.kinematics.model import RobotModel, solve_ik
from protocol.pose import pose_inv, pose_to_T
from protocol.ur_types import JOINT_NAMES, ProgramState, RobotMode, SafetyStatus
from ur_emulator.host.control_api.box_state import Question
from ur_emulator.machine.commands.surroundings import MAX_FORCE
from ur_emulator.machine.controller.io.lines import DIGITAL_GROUPS, DigitalGroup
from ur_emulator.machine.models.things import SIZES
from ur_pendant.drawing import ArmDrawing, RobotDrawing
from ur_pendant.hands import ACCELERATION, KEYS, SPEED, HandError, Hands
from ur_pendant.robot import PLOTTED, RATE, Robot, Sample, Signal

Show = Callable[[Robot], str]


def _numbers(robot: Robot, name: str) -> tuple[float, ...]:
    """A signal as numbers; empty if it is not reported."""
    value = robot.values.get(name, ())
    return tuple(map(float, value)) if isinstance(value, tuple) else (float(value),)


def _figures(form: str, *names: str, scale: float = 1.0, part: slice = slice(None)) -> Show:
    return lambda r: "  ".join(format(scale * n, form) for name in names for n in _numbers(r, name)[part])


def _named(kind: type[IntEnum], *names: str) -> Show:
    """The name of a mode, by the first signal that is reported."""
    known = {int(member): member.name for member in kind}
    return lambda robot: next((known.get(int(n), "?") for name in names for n in _numbers(robot, name)), "")


def _levels(word: str, group: DigitalGroup) -> Show:
    return lambda robot: " ".join(str(int(n) >> bit & 1) for n in _numbers(robot, word) for bit in group.bits)


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
_do = partial(methodcaller, "operate")
_KEYS: Mapping[str, Deed] = {key.label: methodcaller("press", key) for key in KEYS}
_MODES, _POSITIONS = ("manual", "automatic", "none"), ("released", "pressed", "fully pressed", "none")
_TROUBLE = {"Protective stop": "protective_stop", "Violation": "trigger_violation", "Fault": "trigger_fault"}
ROWS: Sequence[tuple[str, int, Mapping[str, Deed]]] = (
    ("Emergency", 3, {"Emergency stop": _do("emergency_stop"), "Release": _do("release_emergency_stop")}),
    ("Power", 0, {label: _KEYS[label] for label in ("Power on", "Release brakes", "Power off")}),
    ("Program", 0, {label: _KEYS[label] for label in ("Play", "Pause", "Stop", "Close popup")}),
    ("Safety", 0, {label: _KEYS[label] for label in ("Unlock protective stop", "Restart safety")}),
    ("Safeguard", 3, {"Open": _do("safeguard_stop"), "Close": _do("safeguard_stop", active=False)}),
    ("Trouble", 3, {label: _do(operation) for label, operation in _TROUBLE.items()}),
    ("Mode", 5, {mode.capitalize(): _do("set_operational_mode", mode=mode) for mode in _MODES}),
    ("Enabling", 5, {where.capitalize(): _do("enabling_device", position=where) for where in _POSITIONS}),
    ("Control", 5, {"Remote": _do("remote_control"), "Local": _do("remote_control", on=False)}),
)
"""Label, first major version of the software that has it (0: also without a control API), and buttons.

The first row stands above all else, whatever is shown.
"""

_FREEDRIVE = "def pendant_freedrive():\n  freedrive_mode()\n  while True:\n    sync()\n  end\nend\n"
FREEDRIVE: Mapping[str, Deed] = {"On": methodcaller("run", _FREEDRIVE), "Off": _KEYS["Stop"]}

# --- moving

JOG_RATE = 10.0  # How often a button that is held is heard [Hz],
_RELEASED = 0.3  # and for how long it is not, when it has been released [s].
AHEAD = 0.15  # By how much a button may ask a joint to be ahead of itself [rad].
_LAG = 0.06  # From a measurement to its effect on the goal [s].
JUMP = 0.5  # How far a joint may go for a step of a tool that is dragged [rad].
STIFFNESS = 200.0  # Of the spring that pulls at the arm, as hard as a box can be pushed [N/m].


def jogged(goal: Array, q: Array, joint: int, step: float, model: RobotModel) -> Array:
    """The goal (6,) after a step of a joint, with the joints at q (6,) now [rad]."""
    limits, wanted = model.limits, goal.copy()
    ahead = np.clip(goal[joint] + step, q[joint] - AHEAD, q[joint] + AHEAD)
    wanted[joint] = np.clip(ahead, limits.q_min[joint], limits.q_max[joint])
    return wanted


def reached(model: RobotModel, T_base_flange: Array, q: Array) -> Array:
    """The posture (6,) near q (6,) [rad] with the flange at a pose (4, 4). HandError without one."""
    found, limits = solve_ik(replace(model, tcp_frame=model.flange_frame), T_base_flange, q), model.limits
    is_near = (found.q >= limits.q_min) & (found.q <= limits.q_max) & (np.abs(found.q - q) <= JUMP)
    if not (found.converged and is_near.all()):
        raise HandError("the arm stays: there is out of reach, beyond a joint's limit, or too far at once")
    return found.q


def pulled(grip: Array, end: Array) -> Array:
    """The force (3,) of a spring from one point to another (3,) [N, m]."""
    force = STIFFNESS * (end - grip)
    return force * min(1.0, MAX_FORCE / max(float(np.linalg.norm(force)), 1e-9))


# --- text and plots

_SLOWLY, _AGAIN = 0.2, 2.0  # Between updates of text; before the same is told, or what was set is left [s].
_LONGEST, _LINES = 160, 40
_PLOTTED = 20.0  # How much is plotted [s]: about every other sample, and always the same ones.
_COLOURS = ("#d62728", "#2ca02c", "#1f77b4", "#ff7f0e", "#9467bd", "#17becf")
_READS: Mapping[str, Callable[[str], Any]] = {"Boolean": "yes".__eq__, "Integer": int, "Float": float}
_SIGNALS = {signal.name: signal for signal in PLOTTED}


def plain(text: str) -> str:
    """Text on one line, without what does not print, and cut."""
    cut = text[:_LONGEST] + "…" * (len(text) > _LONGEST)
    return cut if cut.isprintable() else "".join(c if c.isprintable() else " " for c in cut)


def columns(samples: Sequence[Sample], signal: Signal, now: float) -> tuple[Array, ...]:
    """Times after now [s] and six numbers of a signal, each (n,); nan where there is none."""
    width, missing = len(signal.parts) or 1, (nan,) * len(signal.parts) or nan
    numbers = np.full((len(samples), len(_COLOURS)), nan)  # always so many, as a plot has lines
    numbers[:, :width] = np.reshape([s.values.get(signal.name, missing) for s in samples], (-1, width))
    return (np.array([sample.time - now for sample in samples]), *numbers.T)


def _listed(texts: Iterable[str]) -> str:
    return "\n".join(plain(text) for text in islice(texts, _LINES))


def _log(robot: Robot, wanted: str) -> Iterator[str]:
    """Yield the lines of the log with a text that is wanted, the newest first."""
    return (f"{at:.2f}  {text}" for at, text in list(robot.log)[::-1] if wanted in text.lower())


def _speed(robot: Robot, slider: Any) -> int:
    is_set = time.time() - slider.update_timestamp < _AGAIN
    return slider.value if is_set else round(100 * sum(_numbers(robot, "target_speed_fraction")))


class Panel:
    """Values and controls of one robot."""

    def __init__(
        self, server: ViserServer, robot: Robot, hands: Hands, drawing: RobotDrawing, container: Any = None
    ) -> None:
        """Make it in a `container` of viser, such as a tab, or beside the picture."""
        self._server, self._gui, self._robot, self._hands = server, server.gui, robot, hands
        self._drawing, self._container = drawing, container or nullcontext()
        self._worker = ThreadPoolExecutor(1)
        self._newest: dict[str, Callable[[], object]] = {}
        self._way: deque[Array | None] = deque()  # of the frame that is dragged; None where it begins
        self._followed = np.empty(6)
        self._postures = {"upright": np.array((0.0, -pi / 2, 0.0, -pi / 2, 0.0, 0.0))}
        self._told: tuple[object, ...] = ()
        self._told_at = self._refreshed = self._pushed = self._jogging = 0.0
        self._made_for: tuple[Any, ...] = ()

    def update(self) -> None:
        """Show what is new; call it 30 times a second, after the drawing's."""
        wanted = (held := self._robot.is_held, held and self._hands.has_control_api, self._drawing.arm)
        if wanted != self._made_for:
            self.remove()
            self._make(*wanted)
            self._made_for = wanted
        now = time.monotonic()
        if 0.0 < self._jogging < now - _RELEASED:
            self._soon("jog", self._release)
        if self._gizmo is not None:
            self._update_nodes(now)
        if now - self._refreshed >= _SLOWLY:
            self._refreshed = now
            for handle, name, show in self._following:
                if getattr(handle, name) != (value := show(self._robot)):
                    setattr(handle, name, value)
            self._show_questions()
            self._offer_pulls()
            if not self._pause.value and self._server.get_clients():
                self._draw_chart(now)

    def remove(self) -> None:
        """Take everything away."""
        if self._made_for:
            for handle in (*self._nodes, *self._asked.values(), *self._head, self._tabs):
                handle.remove()
            for node in self._drawing.solids:
                node.remove_drag_callback(self._on_pull)
        self._made_for = ()

    def _make(self, is_held: bool, has_api: bool, arm: ArmDrawing | None) -> None:
        self._following: list[tuple[Any, str, Callable[[Robot], object]]] = []
        self._asked: dict[Question | str, Any] = {}
        self._charts: deque[tuple[Any, Any]] = deque()
        self._nodes: list[Any] = []
        self._pullable: set[str] = set()
        self._gizmo: Any = None
        self._has_api, self._is_dragged, self._placed = has_api, False, np.zeros((4, 4))
        self._pull: tuple[Any, Array, Array] | None = None
        gui, arm = self._gui, arm if is_held else None
        label, _, deeds = ROWS[0]
        with self._container:
            self._head = [self._row(label, deeds)] if has_api else []
            self._tabs = tabs = gui.add_tab_group()
        with tabs.add_tab("Robot"):
            if not is_held:
                reason = "is only shown" if self._robot.view_only else "does not say that it is simulated"
                self._texts({"Controls": lambda robot: f"none: the robot {reason}"})
            self._texts(ABOUT)
            if is_held:
                self._make_keys()
        with tabs.add_tab("Move"):
            self._make_moves(None if arm is None else arm.model)
            self._texts(ARM)
        with tabs.add_tab("I/O"):
            for group in DIGITAL_GROUPS.values() if has_api else ():
                self._make_inputs(group)
            self._texts({**({} if has_api else INPUTS), **OUTPUTS, **LINES})
        if has_api:
            with tabs.add_tab("World"):
                self._make_world()
        with tabs.add_tab("Plots"):
            self._pause = gui.add_checkbox("Pause", False)
            scales, data = {"x": uplot.Scale(time=False, range=(-_PLOTTED, 0.0))}, np.zeros((7, 1))
            for first in PLOTTED[0], PLOTTED[9]:
                choice = gui.add_dropdown("Signal", tuple(_SIGNALS), initial_value=first.name)
                plot = gui.add_uplot(tuple(data), tuple({} for _ in data), scales=scales, height=190)
                self._charts.append((choice, plot))
        with tabs.add_tab("Log"):
            for label, items in LISTS.items():
                self._list(label, items)
            wanted = gui.add_text("Filter", "")
            self._list("Log", lambda robot: _log(robot, wanted.value.lower()))
        if arm is not None:
            self._make_nodes(arm)

    def _make_keys(self) -> None:
        robot, hands, gui = self._robot, self._hands, self._gui
        major = robot.info.version.major if robot.info is not None and self._has_api else 0
        for label, since, deeds in ROWS[1:]:
            if since <= major:
                self._row(label, deeds)
        if self._has_api and robot.info is not None and robot.info.lockstep:
            spans = {"One cycle": robot.info.period, "0.1 s": 0.1, "1 s": 1.0}
            self._row("Time", {label: methodcaller("let_pass", span) for label, span in spans.items()})
        if self._has_api:
            slider = gui.add_slider("Speed %", 0, 100, 1, 100)
            set_speed = partial(hands.operate, "set_speed")
            slider.on_update(self._newest_of("speed", lambda: set_speed(fraction=slider.value / 100)))
            self._following.append((slider, "value", lambda robot: _speed(robot, slider)))
        if robot.address.ports.dashboard:
            name = gui.add_text("File", "", hint="of a program, in the box's folder")
            self._button("Load program", lambda: hands.tell_dashboard(f"load {plain(name.value)}"))

    def _make_moves(self, model: RobotModel | None) -> None:
        gui, postures = self._gui, self._postures
        if model is not None:
            self._can_drag = gui.add_checkbox("Drag the tool", True, hint="by its frame in the picture")
            self._row("Freedrive", FREEDRIVE)
            stored = gui.add_dropdown("Posture", tuple(postures))
            self._following.append((stored, "options", lambda _: tuple(postures)))
            q = partial(self._measured, "actual_q")
            self._button("Store posture", lambda: postures.update({f"posture {len(postures)}": q()}))
            self._button("Go there", lambda: self._go(postures[stored.value]))
        for joint, name in enumerate(JOINT_NAMES):
            figure = _figures(".1f", "actual_q", scale=degrees(1.0), part=slice(joint, joint + 1))
            span = "" if model is None else f"±{degrees(model.limits.q_max[joint]):.0f}"
            self._texts({f"{name} {span}°": figure})
            for sign, symbol in () if model is None else ((-1, "−"), (1, "+")):
                button, step = gui.add_button(f"{name} {symbol}"), sign * SPEED / JOG_RATE
                jog = self._newest_of("jog", partial(self._jog, joint, step))
                button.on_hold(jog, callback_hz=JOG_RATE)
                button.on_click(self._newest_of("jog", self._release))

    def _make_inputs(self, group: DigitalGroup) -> None:
        """Buttons with a number and a level, which a click changes."""
        label, change = f"In, {group.name}", partial(_do, "set_digital_input", group=group.name)
        faces = {(n, k): f"{n} {'●' if k == '1' else '○'}" for k in "01" for n in range(group.count)}
        row = self._row(label, {face: change(n=n, level=k == "0") for (n, k), face in faces.items()})
        show = partial(
            lambda show, robot: tuple(faces[pair] for pair in enumerate(show(robot).split())), INPUTS[label]
        )
        self._following.append((row, "options", show))

    def _make_world(self) -> None:
        gui, robot, hands = self._gui, self._robot, self._hands
        name = gui.add_text("Name", "box")
        shape = gui.add_dropdown("Shape", tuple(SIZES))
        size = gui.add_vector3("Size m", (0.1, 0.1, 0.1), step=0.01, hint="edges; or radius, length")
        at = gui.add_vector3("At m", (0.4, 0.2, 0.1), step=0.01, hint="of its middle, in the base frame")
        mass = gui.add_number("Mass kg", 0.5, min=0.0, max=20.0, step=0.1)
        shows_place = gui.add_checkbox(
            "Show the place", False, hint="by a frame in the picture, to be dragged"
        )
        place = self._server.scene.add_transform_controls(
            f"{self._drawing.root.name}/place", 0.2, disable_rotations=True, position=at.value, visible=False
        )
        self._nodes.append(place)
        shows_place.on_update(lambda _: setattr(place, "visible", shows_place.value))
        place.on_update(lambda _: setattr(at, "value", tuple(np.round(place.position, 3))))
        at.on_update(lambda _: setattr(place, "position", at.value))

        def put(operation: str, **more: float) -> None:
            given = {"name": name.value, "shape": shape.value, "pose": (*at.value, 0.0, 0.0, 0.0)}
            hands.operate(operation, size=size.value[: len(SIZES[shape.value])], **given, **more)

        def found(robot: Robot) -> Mapping[str, Deed]:
            things, obstacles = getattr(robot.state, "things", ()), getattr(robot.state, "obstacles", ())
            removals = {plain(thing.name): _do("remove_thing", name=thing.name) for thing in things}
            return removals | {plain(name): _do("remove_obstacle", name=name) for name in obstacles}

        def nothing(_: Hands) -> None:
            raise HandError("nothing of this name is there to be removed")

        self._button("Put obstacle", lambda: put("add_obstacle"))
        self._button("Put thing", lambda: put("add_thing", mass=mass.value))
        self._button("Hang load on the flange", lambda: hands.operate("attach_payload", mass=mass.value))
        there = gui.add_dropdown("There", ("nothing",))
        self._following.append((there, "options", lambda robot: tuple(found(robot)) or ("nothing",)))
        self._button("Remove", lambda: found(robot).get(there.value, nothing)(hands))

    def _make_nodes(self, arm: ArmDrawing) -> None:
        scene, name = self._server.scene, self._drawing.root.name
        self._gizmo = gizmo = scene.add_transform_controls(
            f"{name}/hand", 0.25, depth_test=False, visible=False
        )
        look = {"shaft_radius": 0.006, "head_radius": 0.014, "head_length": 0.03, "visible": False}
        self._arrow = scene.add_arrows(f"{name}/pull", np.zeros((1, 2, 3)), (230, 60, 160), **look)
        self._model = replace(arm.model, pin_data=arm.model.pin_model.createData())  # for the worker's thread
        self._nodes += (gizmo, self._arrow)
        self._arm = arm
        gizmo.on_update(self._on_drag)

    def _offer_pulls(self) -> None:
        """Let people pull at what is there now."""
        solids = self._drawing.solids if self._has_api and self._gizmo is not None else []
        for node in solids:
            if node.name not in self._pullable:
                node.on_drag("left")(self._on_pull)
        self._pullable = {node.name for node in solids}

    def _texts(self, shows: Mapping[str, Show]) -> None:
        for label, show in shows.items():
            text = self._gui.add_text(label, "", disabled=True)
            self._following.append((text, "value", partial(lambda show, robot: plain(show(robot)), show)))

    def _list(self, label: str, items: Callable[[Robot], Iterable[str]]) -> None:
        text = self._gui.add_text(label, "", disabled=True, multiline=True)
        self._following.append((text, "value", lambda robot: _listed(items(robot))))

    def _button(self, label: str, action: Callable[[], object]) -> None:
        self._gui.add_button(label).on_click(self._calling(action))

    def _row(self, label: str, deeds: Mapping[str, Deed]) -> Any:
        row = self._gui.add_button_group(label, tuple(deeds))
        row.on_click(self._calling(lambda: deeds[row.value](self._hands)))
        return row

    def _calling(self, action: Callable[[], object]) -> Callable[[Any], None]:
        """What viser calls when somebody uses a control; what the robot says to it is told."""

        def call(event: Any) -> None:
            try:
                said = None if event.client is None else action()  # or the panel itself has changed it
                if said and isinstance(said, str):
                    self._tell(event.client, "Robot", said)
            except (HandError, ValueError) as error:
                self._tell(event.client, "Not done", str(error))

        return call

    def _tell(self, client: Any, title: str, text: str) -> None:
        """Tell somebody once, also if a button that is held has the same answer ten times a second."""
        now, before, self._told = time.monotonic(), self._told, (client, text)
        if before != self._told or now - self._told_at > _AGAIN:
            client.add_notification(title, plain(text), auto_close_seconds=6.0)
        self._told_at = now

    def _newest_of(self, kind: str, action: Callable[[], object]) -> Callable[[Any], None]:
        """As `_calling`, by the worker, and of a kind only the newest: a last one is never lost, nor late."""
        call = self._calling(action)

        def ask(event: Any) -> None:
            if event.client is not None:
                self._soon(kind, partial(call, event))

        return ask

    def _soon(self, kind: str, deed: Callable[[], object]) -> None:
        self._newest[kind] = deed
        self._worker.submit(lambda: self._newest.pop(kind, int)())

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
        for new in now - self._asked.keys() if self._has_api else ():
            with self._container:
                self._asked[new] = self._make_question(new)

    def _make_question(self, new: Question | str) -> Any:
        gui, text = self._gui, plain(new.text if isinstance(new, Question) else new)
        with gui.add_folder("A program says", order=self._tabs.order - 0.5) as folder:
            gui.add_text("Text", text, multiline=True, disabled=True)
            if isinstance(new, Question):
                kind, answer = new.kind.capitalize(), partial(self._hands.operate, "answer", id=new.id)
                is_choice, read = kind == "Boolean", _READS.get(kind, str)
                given = gui.add_dropdown(kind, ("yes", "no")) if is_choice else gui.add_text(kind, "")
                self._button("Answer", lambda: answer(value=read(given.value)))
            self._row("Program", {label: _KEYS[label] for label in ("Close popup", "Stop")})
        for client in self._server.get_clients().values():
            client.add_notification("A program says", text, auto_close_seconds=6.0)
        return folder

    def _measured(self, name: str) -> Array:
        return np.array(_numbers(self._robot, name))

    def _go(self, q: Array) -> None:
        if self._robot.values.get("robot_mode") != RobotMode.RUNNING:
            raise HandError("the arm must be RUNNING: power it on, release the brakes")
        self._hands.follow(q)

    def _jog(self, joint: int, step: float) -> None:
        goal = self._measured("target_q") if self._hands.goal is None else self._hands.goal
        self._go(jogged(goal, self._measured("actual_q"), joint, step, self._arm.model))
        self._jogging = time.monotonic()

    def _release(self) -> None:
        """Let the arm come to rest: the goal is where its ramp ends."""
        self._jogging, qd = 0.0, self._measured("target_qd")
        if self._hands.goal is not None:
            self._hands.follow(self._measured("target_q") + qd * (_LAG + np.abs(qd) / (2.0 * ACCELERATION)))

    async def _on_drag(self, event: Any) -> None:
        """Have the arm follow the frame that somebody drags."""
        xyzw = np.roll(event.target.wxyz, -1)
        T: Array = pin.XYZQUATToSE3(np.append(event.target.position, xyzw)).homogeneous
        self._is_dragged, self._placed = event.phase != "end", T
        self._way.append(None if event.phase == "start" else T)
        self._newest_of("drag", self._reach)(event)

    def _reach(self) -> None:
        """Go to the last pose of the frame that is in reach; its whole way says with which posture."""
        goal, refusal = None, None
        T_tcp_flange = pose_to_T(pose_inv(_numbers(self._robot, "tcp_offset") or (0.0,) * 6))
        while self._way:
            T_base_tcp, refusal = self._way.popleft(), None
            if T_base_tcp is None:
                self._followed = self._measured("actual_q")
                continue
            try:
                self._followed = goal = reached(self._model, T_base_tcp @ T_tcp_flange, self._followed)
            except HandError as error:
                refusal = error
        if goal is not None:
            self._go(goal)
        if refusal is not None:
            raise refusal

    async def _on_pull(self, event: Any) -> None:
        """Take where somebody pulls at what the flange carries; a box is pushed nowhere else."""
        if event.target.name in {link.name for link in self._arm.links[:-1]}:
            if event.phase == "start":
                self._tell(
                    event.client, "Not done", "pull at the last link or at the tool: a box is pushed there"
                )
            return
        flange, base = self._arm.T_base_flange, self._drawing.root.position
        grip = (np.array(event.start_position) - base - flange[:3, 3]) @ flange[:3, :3]
        self._pull = None if event.phase == "end" else (event, grip, np.array(event.end_position) - base)

    def _update_nodes(self, now: float) -> None:
        gizmo, arrow, T, pull = self._gizmo, self._arrow, self._drawing.T_base_tcp, self._pull
        mode, program = (self._robot.values.get(name) for name in ("robot_mode", "runtime_state"))
        is_free = program == ProgramState.STOPPED or self._hands.goal is not None  # no program has the arm
        gizmo.visible = self._can_drag.value and mode == RobotMode.RUNNING and is_free
        arrow.visible = pull is not None
        if gizmo.visible and not self._is_dragged and np.abs(T - self._placed).max() > 1e-5:
            self._placed = T
            gizmo.position, gizmo.wxyz = T[:3, 3], np.roll(pin.Quaternion(T[:3, :3]).coeffs(), 1)
        if pull is not None:
            (event, grip, end), flange = pull, self._arm.T_base_flange
            point = flange[:3, :3] @ grip + flange[:3, 3]
            force = pulled(point, end)
            arrow.points = np.array([[point, point + force / STIFFNESS]])
            if now - self._pushed >= _SLOWLY:
                self._pushed, given = now, {"force": force.tolist(), "point": grip.tolist(), "duration": 0.3}
                self._newest_of("push", partial(self._hands.operate, "push", **given))(event)
