"""The panel on a real server of viser, whose callbacks are called as viser does it; robot and hands are recorded."""

import asyncio
from collections import deque
from concurrent.futures import Future
from contextlib import suppress
from functools import partialmethod
from time import monotonic, sleep
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pc_client.kinematics.arms import ROBOTS
from pc_client.kinematics.model import robot_model, tcp_pose
from protocol.pose import pose_to_T
from protocol.ur_types import Ports, ProgramState, RobotMode, SafetyMode, SoftwareVersion
from ur_emulator.errors import ArgumentError
from ur_emulator.host.control_api.box_state import Question
from ur_emulator.host.control_api.operations import make
from ur_emulator.machine.commands.surroundings import MAX_FORCE
from ur_emulator.machine.models.things import BodyShape
from ur_pendant.drawing import RobotDrawing
from ur_pendant.guiding import AHEAD, JUMP, STIFFNESS, jogged, pulled, reached
from ur_pendant.hands import HandError
from ur_pendant.panel import FREEDRIVE, LINES, ROWS, Panel, columns
from ur_pendant.robot import PLOTTED, Address, Sample, plain

Q, ZEROS, TURN = (0.3, -1.7, -2.0, -0.2, 1.4, 1.8), (0.0,) * 6, np.eye(6)[0]
HOSTILE = "<img src=x onerror=alert(1)>\n\x00\x1b[31m\u202e\ud800" + "x" * 10_000
NAME = HOSTILE.replace("\ud800", "")[:900]
MODEL = robot_model("ur5e")
TCP = (0.0, 0.0, 0.1, 0.0, 0.0, 0.0)


class Hands:
    """Records what is done; refuses when it has a `refusal`."""

    def __init__(self):
        self.done, self.goal, self.refusal = [], None, ""

    def _do(self, *what):
        if self.refusal:
            raise HandError(self.refusal)
        self.done.append(what)

    def press(self, line, operation):
        make(operation, {})
        self._do("press", line)
        return f"{line} done"

    def operate(self, operation, **arguments):
        try:
            make(operation, arguments)  # as the box takes it
        except ArgumentError as error:
            raise HandError(str(error)) from None
        self._do(operation, arguments)

    def let_pass(self, seconds):
        self.operate("wait_until", time=seconds)

    tell_dashboard, run = partialmethod(_do, "tell_dashboard"), partialmethod(_do, "run")

    def follow(self, q):
        self._do("follow", tuple(np.round(q, 6)))
        self.goal = np.array(q)


class Threads:
    """In place of a pool of threads: does what it was given when it is told to."""

    def __init__(self, *_):
        self.given = []

    def submit(self, errand, *arguments):
        self.given.append((errand, arguments, Future()))
        return self.given[-1][2]

    def run(self):
        for errand, arguments, future in self.given:
            future.set_result(errand(*arguments))
        self.given = []


def a_robot(**changes):
    values = {
        "robot_mode": RobotMode.RUNNING, "safety_mode": SafetyMode.NORMAL, "runtime_state": ProgramState.STOPPED,
        "actual_q": Q, "target_q": Q, "target_qd": ZEROS, "actual_digital_input_bits": 0b1, "speed_scaling": 0.5,
        "target_speed_fraction": 0.5, "script_control_line": 0, "tcp_offset": TCP,
    }  # fmt: skip
    robot = {
        "refusal": "", "problem": "", "title": "UR5e 5.15.0 at 127.0.0.1", "values": values,
        "info": SimpleNamespace(version=SoftwareVersion(5, 15), model="UR5e", lockstep=False), "kinematics": None,
        "state": None, "address": Address("127.0.0.1", Ports(), 29900), "log": deque(), "history": deque(), "popups": (),
        "questions": (), "program": "", "label": "", "variables": {},
    }  # fmt: skip
    return SimpleNamespace(**robot | changes)


def a_state(**changes):
    nothing = {"shapes": (), "contacts": (), "things": (), "obstacles": (), "tcp_pose": ZEROS}
    return SimpleNamespace(**nothing | changes)


class Window:
    """A panel, its controls by label, and somebody at a page, who notes what is told."""

    def __init__(self, server, robot, hands):
        self.server, self.robot, self.hands, self.told = server, robot, hands, []
        self.client = SimpleNamespace(
            add_notification=lambda title, text, **_: self.told.append((title, text))
        )
        self.drawing = RobotDrawing(server, "/robot0", robot)
        self.panel = Panel(server, robot, hands, self.drawing)
        self.errands = self.panel._make.args[0].errands
        self.update()

    @property
    def guiding(self):
        return self.panel._controls._guiding

    def update(self):
        self.drawing.update()
        if self.panel._controls is not None:
            self.panel._controls._refreshed = 0.0
        self.panel.update()

    def controls(self):
        return list(self.server.gui._gui_input_handle_from_uuid.values())

    def labels(self):
        return {handle.label for handle in self.controls()}

    def control(self, label):
        return next(handle for handle in self.controls() if handle.label == label)

    def happens(self, callbacks, handle, **more):
        """Call what viser calls, in the thread of its loop."""
        for callback in callbacks:
            with suppress(StopIteration):
                callback(SimpleNamespace(client=self.client, target=handle, **more)).send(None)

    def use(self, label, value=True):
        self.choose(self.control(label), value)

    def choose(self, handle, value):
        handle._impl.value = value
        self.happens(handle._impl.update_cb, handle)
        self.work()

    def hold(self, label):
        handle = self.control(label)
        self.happens(handle._impl.hold_cbs_from_freq[10.0], handle)
        self.work()

    def take(self):
        """Let the window's thread take all events."""
        while not self.server.events._queue.empty():
            self.server.events._queue.get()()

    def work(self):
        """Let errands be done, too."""
        self.take()
        while self.errands._lane.given or self.errands._others.given:
            self.errands._others.run()
            self.errands._lane.run()
            self.take()


@pytest.fixture(autouse=True)
def threads(monkeypatch):
    monkeypatch.setattr("ur_pendant.hands.ThreadPoolExecutor", Threads)


@pytest.fixture
def window(server):
    return Window(server, a_robot(), Hands())


def test_a_robot_that_is_not_held_has_values_and_no_controls_until_it_is(server):
    window = Window(server, a_robot(refusal="the robot is only shown"), Hands())
    assert window.control("Controls").value == "none: the robot is only shown"
    assert window.control("Mode").value == "RUNNING"
    free = {"Pause", "Signal", "Filter"}  # of the page only
    assert all(handle.disabled for handle in window.controls() if handle.label not in free)
    assert window.guiding is None
    for is_held in (True, False):
        window.robot.refusal = "" if is_held else "lost"
        window.update()
        assert ({"Power", "Emergency", "base +", "Put obstacle"} <= window.labels()) is is_held
        assert ("Controls" in window.labels()) is not is_held
        assert window.drawing.arm.links[-1]._has_any_drag_callbacks() is is_held


@pytest.mark.parametrize(("major", "has_api"), [(3, True), (5, True), (5, False)])
def test_every_key_does_what_it_says_where_the_robot_has_it(server, major, has_api):
    info = SimpleNamespace(version=SoftwareVersion(major, 15), model="UR5e", lockstep=True, period=0.002)
    window = Window(server, a_robot(info=info, address=Address("", Ports(), 29900 * has_api)), Hands())
    rows = {handle.label: handle for handle in window.controls() if hasattr(handle, "options")}
    for label, since, deeds in ROWS:
        assert (label in rows) is (since <= (major if has_api else 0))
        for option in deeds if label in rows else ():
            window.choose(rows[label], option)
    done = window.hands.done
    assert len({what for what in done if what[0] == "press"}) == 9
    assert has_api or len(done) == 9
    window.use("Time", "One cycle") if has_api else None
    assert (("wait_until", {"time": 0.002}) in done) is has_api
    assert (("enabling_device", {"position": "fully pressed"}) in done) is (has_api and major >= 5)


def test_what_is_not_done_is_told_once_and_replies_are_told(window):
    window.use("Power", "Power on")
    window.hands.refusal = "no power: it is <b>late</b>\n"
    for _ in range(5):
        window.hold("base +")
    assert window.told == [("Robot", "power on done"), ("Not done", "no power: it is <b>late</b> ")]


def test_programs_speed_inputs_and_freedrive(window):
    window.use("File", "a.urp\nquit")
    window.use("Load program")
    window.use("Speed %", 30)
    window.use("In, standard", "0 ●")
    window.use("In, tool", "1 ○")
    for option in FREEDRIVE:
        window.use("Freedrive", option)
    *first, (_, freedrive), stop = window.hands.done
    assert first == [
        ("tell_dashboard", "load a.urp quit"),
        ("set_speed", {"fraction": 0.3}),
        ("set_digital_input", {"group": "standard", "n": 0, "level": False}),
        ("set_digital_input", {"group": "tool", "n": 1, "level": True}),
    ]
    assert "freedrive_mode()" in freedrive
    assert stop == ("press", "stop")


def test_controls_follow_the_robot_and_nobody_is_asked(window):
    window.robot.values |= {"actual_digital_input_bits": 0b110, "target_speed_fraction": 0.2}
    window.control("Speed %")._impl.update_timestamp = 0.0
    window.update()
    assert window.control("Speed %").value == 20
    assert window.control("In, standard").options[:4] == ("0 ○", "1 ●", "2 ●", "3 ○")
    asyncio.run_coroutine_threadsafe(asyncio.sleep(0), window.server._event_loop).result()  # viser calls back
    window.work()
    assert window.hands.done == []


def test_the_world(window):
    pose, done = (0.5, 0.1, 0.2, 0.0, 0.0, 0.0), window.hands.done
    window.use("Name", NAME)
    window.use("At m", pose[:3])
    window.use("Shape", "sphere")
    window.use("Put obstacle")
    assert done.pop() == ("add_obstacle", {"name": NAME, "shape": "sphere", "size": (0.1,), "pose": pose})
    window.use("Name", "can")
    window.use("Shape", "cylinder")
    window.use("Put thing")
    thing = {"name": "can", "shape": "cylinder", "size": (0.1, 0.1), "pose": pose, "mass": 0.5}
    assert done.pop() == ("add_thing", thing)
    window.use("Show the place")
    place = window.server.scene.get_handle_by_name("/robot0/place")
    assert place.visible
    window.use("At m", (0.1, 0.2, 0.3))
    assert tuple(place.position) == (0.1, 0.2, 0.3)
    place.position = (0.30001, 0.2, 0.3)
    window.happens(place._impl_aux.update_cb, place)
    window.work()
    assert window.control("At m").value == (0.3, 0.2, 0.3)
    window.use("Hang load on the flange")
    assert done.pop() == ("attach_payload", {"mass": 0.5})
    window.use("Remove")
    assert window.told.pop()[1] == "nothing of this name is there to be removed"
    can = SimpleNamespace(name="can", touches_tool=False)
    window.robot.state = a_state(obstacles=(NAME, f"{NAME}y"), things=(can,))
    window.update()
    assert window.control("There").options == ("can", plain(NAME))
    for name in window.control("There").options:
        window.use("There", name)
        window.use("Remove")
    assert done == [("remove_thing", {"name": "can"}), ("remove_obstacle", {"name": f"{NAME}y"})]


def test_hostile_texts_are_shown_as_text(window):
    robot = window.robot
    robot.state, robot.variables = a_state(program=HOSTILE, clients=(HOSTILE,)), {HOSTILE: HOSTILE}
    robot.log.extend((k, f"{k} {HOSTILE}") for k in range(100))
    question = Question(3, "STRING", HOSTILE)
    shown = {"problem": HOSTILE, "program": HOSTILE, "label": HOSTILE, "popups": (HOSTILE,) * 9}
    vars(robot).update(shown, questions=(question,))
    window.update()
    texts = [handle.value for handle in window.controls() if isinstance(handle.value, str)]
    lines = [line for text in texts for line in text.split("\n")]
    assert all(line.isprintable() and len(line) < 200 for line in lines)
    assert window.control("Log").value.splitlines()[0].startswith("99.00  99 <img")
    for label in ("Robot", "Clients", "Variables", "Text"):
        assert window.control(label).value.startswith("<img src=x onerror"), label
    assert len(window.control("Log").value.splitlines()) == 40
    window.use("Filter", "7 <IMG")
    window.update()
    assert len(window.control("Log").value.splitlines()) == 10


def test_popups_and_questions_until_they_are_gone(window, monkeypatch):
    robot = window.robot
    monkeypatch.setattr(window.server, "get_clients", lambda: {1: window.client})
    asked = [("BOOLEAN", "yes", True), ("INTEGER", "7", 7), ("FLOAT", "2.5", 2.5), ("STRING", "a", "a")]
    for k, (kind, text, value) in enumerate(asked):
        robot.questions = (Question(k + 1, kind, "how?"),)
        window.update()
        assert window.control("Text").value == "how?"
        window.use(kind.capitalize(), text)
        window.use("Answer")
        assert window.hands.done.pop() == ("answer", {"id": k + 1, "value": value})
    robot.questions = (Question(9, "INTEGER", "how many?"),)
    window.update()
    window.use("Integer", "many")
    window.use("Answer")
    assert ("A program says", "how many?") in window.told
    assert "many" in dict(window.told)["Not done"]
    robot.questions, robot.popups = (), ("look",)
    window.update()
    assert not window.server.gui._modal_handle_from_uuid  # which would cover the panel
    text = window.control("Text")
    container = window.server.gui._container_handle_from_uuid[text._impl.parent_container_id]
    assert window.control("Emergency").order < container.order < window.panel._controls._tabs.order
    window.choose(window.controls()[-1], "Close popup")
    assert window.hands.done.pop() == ("press", "close popup")
    robot.popups = ()
    window.update()
    assert "Text" not in window.labels()


# --- moving


def test_a_button_that_is_held_moves_a_joint_and_its_release_stops_it(window):
    for _ in range(3):
        window.hold("elbow +")
    steps = [what[1][2] - Q[2] for what in window.hands.done]
    assert steps == pytest.approx([0.06, 0.12, AHEAD])
    window.robot.values |= {"target_qd": (0.0, 0.0, 0.6, 0.0, 0.0, 0.0)}
    window.update()
    window.work()
    assert len(window.hands.done) == 3
    window.guiding._heard = 0.0
    window.update()
    window.work()
    assert window.hands.done.pop()[1][2] - Q[2] == pytest.approx(0.036 + 0.12)
    window.update()
    window.work()
    assert len(window.hands.done) == 3


@pytest.mark.parametrize("label", ["base +", "Go there"])
def test_an_arm_without_power_is_not_moved(window, label):
    window.robot.values |= {"robot_mode": RobotMode.IDLE}
    window.hold(label) if label == "base +" else window.use(label)
    assert window.hands.done == []
    assert window.told == [("Not done", "the arm must be RUNNING: power it on, release the brakes")]


def test_postures_are_stored_and_reached(window):
    window.use("Go there")
    window.use("Store posture")
    window.update()
    window.use("Posture", "posture 1")
    window.use("Go there")
    upright = tuple(np.round((0, -np.pi / 2, 0, -np.pi / 2, 0, 0), 6))
    assert window.hands.done == [("follow", upright), ("follow", Q)]


joint_angles = st.lists(st.floats(-6.0, 6.0), min_size=6, max_size=6).map(np.array)


@given(joint_angles, joint_angles, st.integers(0, 5), st.floats(-1.0, 1.0))
def test_jogging_keeps_near_and_within_the_limits(goal, q, joint, step):
    wanted = jogged(goal, q, joint, step, MODEL)
    others = np.arange(6) != joint
    assert (wanted[others] == goal[others]).all()
    assert abs(wanted[joint] - q[joint]) <= AHEAD + 1e-12
    assert MODEL.limits.q_min[joint] <= wanted[joint] <= MODEL.limits.q_max[joint]


def drag(window, phase, T):
    frame = window.guiding.frame
    frame._impl.position, frame._impl.wxyz = T[:3, 3].copy(), np.roll(pin.Quaternion(T[:3, :3]).coeffs(), 1)
    window.happens(frame._impl_aux.update_cb, frame, phase=phase)


def test_the_tool_goes_where_its_frame_is_dragged(window):
    frame, start = window.guiding.frame, window.drawing.T_base_tcp
    assert frame.position == pytest.approx(start[:3, 3])
    drag(window, "start", start)
    window.work()
    assert window.hands.done == []
    T = start.copy()
    for _ in range(4):
        T[2, 3] += 0.02
        drag(window, "update", T)
        window.work()
        window.use("base +", False)  # somebody else's click lets nothing go
        window.update()
        assert frame.position == pytest.approx(T[:3, 3])  # in the hand, not where the robot is
    moves = len(window.hands.done)
    far = T.copy()
    for phase, far[0, 3] in (("update", 5.0), ("update", 5.1), ("end", 5.2)):
        drag(window, phase, far)
    window.work()
    window.update()
    assert len(window.hands.done) == moves
    assert len(window.told) == 1
    assert frame.position == pytest.approx(start[:3, 3])  # where the robot still is


@pytest.mark.parametrize("frames", [0, 1])
def test_the_last_pose_of_a_drag_arrives_however_busy_window_and_robot_are(window, frames):
    """Poses come faster than the arm is told; each lies too far from the first to be reached from there."""
    poses = [tcp_pose(MODEL, Q + 0.2 * step * TURN) @ pose_to_T(TCP) for step in range(9)]
    for phase, T in zip(("start", *["update"] * 7, "end"), poses, strict=True):
        drag(window, phase, T)
        for _ in range(frames):
            window.take()
            window.update()
    drag(window, "start", poses[0])  # and it is taken again at once
    window.work()
    assert len(window.hands.done) == 2  # the first, and what came last while it was done
    assert window.hands.goal == pytest.approx(Q + 1.6 * TURN, abs=1e-4)


def test_the_emergency_stop_waits_for_nothing_and_what_waits_is_forgotten(window):
    """The window's thread takes nothing, no other errand begins, and a second click comes at once."""
    for phase in ("start", "update", "update", "end"):
        drag(window, phase, window.drawing.T_base_tcp)
    row = window.control("Emergency")
    for button in ("Emergency stop", "Release"):
        row._impl.value = button
        window.happens(row._impl.update_cb, row)
    while len(window.hands.done) < 2:
        sleep(0.001)
    assert {what[0] for what in window.hands.done} == {"emergency_stop", "release_emergency_stop"}
    window.work()
    assert [what[0] for what in window.hands.done[2:]] == ["follow"]  # which had begun


def test_no_frame_to_drag_while_a_program_has_the_arm(window):
    for mode, program, goal, is_there in (
        (RobotMode.RUNNING, ProgramState.PLAYING, None, False),
        (RobotMode.RUNNING, ProgramState.PLAYING, np.array(Q), True),  # the window's own
        (RobotMode.IDLE, ProgramState.STOPPED, None, False),
        (RobotMode.RUNNING, ProgramState.STOPPED, None, True),
    ):
        window.robot.values.update(robot_mode=mode, runtime_state=program)
        window.hands.goal = goal
        window.update()
        assert window.guiding.frame.visible is is_there
    window.use("Drag the tool", False)
    window.update()
    assert not window.guiding.frame.visible


def test_no_pose_is_reached_by_a_jump_or_beyond_a_limit():
    q = np.array(Q)
    assert reached(MODEL, tcp_pose(MODEL, q + 0.05), q) == pytest.approx(q + 0.05)
    with pytest.raises(HandError, match="out of reach, beyond a joint's limit, or too far at once"):
        reached(MODEL, tcp_pose(MODEL, q + (JUMP + 0.1) * TURN), q)
    q[5] = ROBOTS["ur5e"].limits.q_max[5] - 0.01
    with pytest.raises(HandError):
        reached(MODEL, tcp_pose(MODEL, q + 0.05 * np.eye(6)[5]), q)


def pull(window, phase, start, end, link=-1):
    more = {"phase": phase, "start_position": tuple(start), "end_position": tuple(end)}
    window.happens([window.guiding._enter_pull], window.drawing.arm.links[link], **more)
    window.take()
    window.guiding._pushed = 0.0
    window.update()
    window.work()


def test_the_arm_is_pushed_where_the_mouse_takes_it(window):
    flange, arrow = window.drawing.arm.T_base_flange, window.guiding.arrow
    at = flange[:3, 3] + flange[:3, :3] @ (0.02, -0.03, 0.1)
    pull(window, "start", at, np.add(at, (0.0, 0.1, 0.0)))
    name, given = window.hands.done.pop()
    assert (name, given["duration"], arrow.visible) == ("push", 0.3, True)
    assert given["force"] == pytest.approx((0.0, 0.1 * STIFFNESS, 0.0))
    assert given["point"] == pytest.approx((0.02, -0.03, 0.1), abs=1e-9)
    pull(window, "update", at, np.add(at, (9.0, 0.0, 0.0)))
    assert window.hands.done.pop()[1]["force"] == pytest.approx((MAX_FORCE, 0.0, 0.0))
    pull(window, "end", at, np.add(at, (9.0, 0.0, 0.0)))
    assert (window.hands.done, arrow.visible) == ([], False)


def test_what_cannot_be_pushed_is_not_pushed_elsewhere(window):
    pull(window, "start", (0.0, 0.0, 0.1), (0.5, 0.0, 0.1), link=2)
    assert window.told.pop()[1] == "pull at the last link or at the tool: a box is pushed there"
    assert not window.guiding.arrow.visible
    pull(window, "start", (0.0, 0.0, 0.0), (9.0, 0.0, 0.0))  # at the end of a tool that is as long
    assert "at most 0.3 m" in window.told.pop()[1]
    assert window.hands.done == []


def test_the_box_takes_the_hardest_pull_in_any_direction():
    for way in np.random.default_rng(7).normal(size=(200, 3)):
        make("push", {"force": pulled(np.zeros(3), 99.0 * way).tolist()})


def test_the_tool_is_pulled_at_too(window):
    hand, wall = (BodyShape(name, name == "hand", "box", (0.1,) * 3, ZEROS) for name in ("hand", "wall"))
    window.robot.state = a_state(shapes=(hand, wall))
    window.update()
    hand, wall = window.drawing._shapes.values()
    assert (hand._has_any_drag_callbacks(), wall._has_any_drag_callbacks()) == (True, False)
    window.robot.refusal = "lost"
    window.update()
    assert not hand._has_any_drag_callbacks()


# --- values and plots


def test_what_a_robot_does_not_report_is_empty(server):
    window = Window(server, a_robot(refusal="lost", values={}, info=None), Hands())
    assert {window.control(label).value for label in ("Mode", "TCP mm", *LINES)} == {""}
    assert window.control("Program").value == "none ()"


def test_plots_have_as_many_lines_at_any_time(window, monkeypatch):
    samples = [Sample(float(k), {"actual_q": (float(k),) * 6, "speed_scaling": 0.5}) for k in range(3)]
    samples.append(Sample(3.0, {}))
    signals = {signal.name: signal for signal in PLOTTED}
    for name in ("actual_q", "speed_scaling", "actual_momentum"):
        data = columns(samples, signals[name], 3.0)
        assert [column.shape for column in data] == [(4,)] * 7
        assert data[0].tolist() == [-3.0, -2.0, -1.0, 0.0]
    assert columns(samples, signals["actual_q"], 3.0)[6].tolist()[:3] == [0.0, 1.0, 2.0]
    assert len(columns([], signals["actual_q"], 3.0)) == 7
    window.robot.history.extend(
        Sample(monotonic() - 1.0 + k / 60, sample.values) for k, sample in enumerate(samples)
    )
    window.update()
    charts = window.panel._controls._charts
    assert [plot.title for _, plot in charts] == [None, None]  # nobody looks
    monkeypatch.setattr(window.server, "get_clients", lambda: {1: window.client})
    window.update()
    window.update()
    assert [plot.title for _, plot in charts] == ["actual_q [rad]", "actual_TCP_force [N, Nm]"]
    assert charts[0][1].data[1].size in (1, 2, 3)  # every other one
