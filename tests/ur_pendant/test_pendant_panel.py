"""The panel on a real server of viser, whose callbacks are called as viser does it; robot and hands are recorded."""

from collections import deque
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from time import sleep
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
from ur_emulator import ControlBox
from ur_emulator.errors import ArgumentError
from ur_emulator.host.control_api.box_state import BoxState, Question
from ur_emulator.host.control_api.operations import make
from ur_emulator.machine.commands.surroundings import MAX_FORCE
from ur_emulator.machine.models.things import BodyShape, ThingNow
from ur_pendant import hands
from ur_pendant.drawing import RobotDrawing
from ur_pendant.guiding import AHEAD, JUMP, STIFFNESS, jogged, pulled, reached
from ur_pendant.hands import HandError
from ur_pendant.panel import FREEDRIVE, LINES, ROWS, Panel, columns
from ur_pendant.robot import PLOTTED, Address, Robot, Sample, plain
from ur_pendant.server import PageServer

Q = (0.3, -1.7, -2.0, -0.2, 1.4, 1.8)
ZEROS = (0.0,) * 6
HOSTILE = "<img src=x onerror=alert(1)>\n\x00\x1b[31m\u202e\ud800" + "x" * 10_000
NAME = HOSTILE.replace("\ud800", "")[:900]
MODEL = robot_model("ur5e")


class Hands:
    """Records what is done; refuses when it has a `refusal`."""

    def __init__(self):
        self.done, self.goal, self.refusal = [], None, ""

    def _do(self, *what):
        if self.refusal:
            raise HandError(self.refusal)
        self.done.append(what)
        return "reply" if what[0] == "tell_dashboard" else {}

    def press(self, line, operation):
        make(operation, {})
        self._do("press", line)
        return f"{line} done"

    def operate(self, operation, **arguments):
        try:
            make(operation, arguments)  # as the box takes it
        except ArgumentError as error:
            raise HandError(str(error)) from None
        return self._do(operation, arguments)

    def tell_dashboard(self, line):
        return self._do("tell_dashboard", line)

    def run(self, program):
        self._do("run", program)

    def follow(self, q):
        self._do("follow", tuple(np.round(q, 6)))
        self.goal = np.array(q)


class Client:
    """A page that notes what it is told."""

    client_id = 1

    def __init__(self):
        self.told = []

    def add_notification(self, title, body, **_):
        self.told.append((title, body))


def a_robot(**changes):
    values = {
        "robot_mode": RobotMode.RUNNING, "safety_mode": SafetyMode.NORMAL, "runtime_state": ProgramState.STOPPED,
        "actual_q": Q, "target_q": Q, "target_qd": ZEROS, "actual_digital_input_bits": 0b1, "speed_scaling": 0.5,
        "target_speed_fraction": 0.5, "script_control_line": 0, "tcp_offset": (0.0, 0.0, 0.1, 0.0, 0.0, 0.0),
    }  # fmt: skip
    robot = SimpleNamespace(
        is_held=True, view_only=False, problem="", title="UR5e 5.15.0 at 127.0.0.1", values=values,
        info=SimpleNamespace(version=SoftwareVersion(5, 15), model="UR5e", lockstep=False), kinematics=None, state=None,
        address=Address("127.0.0.1", Ports(), 29900), log=deque(), history=deque(), popups=(), questions=(), program="",
        label="", variables={},
    )  # fmt: skip
    vars(robot).update(changes)
    return robot


def a_state(**changes):
    return replace(
        BoxState(
            **{
                name: ()
                if kind.startswith("tuple") or "Vector" in kind
                else {}
                if kind == "Levels"
                else ""
                if kind == "str"
                else 0
                for name, kind in BoxState.__annotations__.items()
            }
        ),
        **changes,
    )


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


class Window:
    """A panel, its controls by label, and somebody at a page."""

    def __init__(self, server, robot, hands):
        self.server, self.robot, self.hands, self.client = server, robot, hands, Client()
        self.drawing = RobotDrawing(server, "/robot0", robot)
        self.panel = Panel(server, robot, hands, self.drawing)
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
        event = SimpleNamespace(client=self.client, client_id=1, target=handle, **more)
        for callback in callbacks:
            with suppress(StopIteration):
                callback(event).send(None)

    def use(self, label, value=True):
        self.choose(self.control(label), value)

    def choose(self, handle, value):
        handle._impl.value = value
        self.happens(handle._impl.update_cb, handle)
        self.work()

    def hold(self, label):
        handle = self.control(label)
        for callbacks in handle._impl.hold_cbs_from_freq.values():
            self.happens(callbacks, handle)
        self.work()

    def take(self):
        """Let the window's thread take all events."""
        while not self.server.events._queue.empty():
            self.server.events._queue.get()()

    def work(self):
        """Let errands be done, too."""
        self.take()
        while self.lane.given or self.others.given:
            self.others.run()
            self.lane.run()
            self.take()

    @property
    def lane(self):
        return self.panel._make.args[0].errands._lane

    @property
    def others(self):
        return self.panel._make.args[0].errands._others


@pytest.fixture(scope="module")
def page():
    server = PageServer("127.0.0.1", 0, None, "test")
    yield server
    server.stop()


@pytest.fixture
def server(page, monkeypatch):
    monkeypatch.setattr("ur_pendant.hands.ThreadPoolExecutor", Threads)
    yield page
    page.gui.reset()
    page.scene.reset()


@pytest.fixture
def window(server):
    return Window(server, a_robot(), Hands())


def test_a_robot_that_is_not_held_has_values_and_no_controls_until_it_is(server):
    robot = a_robot(is_held=False)
    window = Window(server, robot, Hands())
    assert window.control("Controls").value == "none: the robot does not say that it is simulated"
    assert window.control("Mode").value == "RUNNING"
    free = {"Pause", "Signal", "Filter"}  # of the page only
    assert all(handle.disabled for handle in window.controls() if handle.label not in free)
    assert window.guiding is None
    assert not window.drawing.arm.links[-1]._has_any_drag_callbacks()
    robot.is_held = True
    window.update()
    assert {
        "Power",
        "Emergency",
        "base +",
        "Put obstacle",
    } <= window.labels()
    assert "Controls" not in window.labels()
    assert window.drawing.arm.links[-1]._has_any_drag_callbacks()
    robot.is_held = False
    window.update()
    assert "Power" not in window.labels()
    assert not window.drawing.arm.links[-1]._has_any_drag_callbacks()
    window.panel._controls.remove()
    assert not window.labels()


@pytest.mark.parametrize(("major", "has_api"), [(3, True), (5, True), (10, True), (5, False)])
def test_every_key_does_what_it_says_where_the_robot_has_it(server, major, has_api):
    info = SimpleNamespace(version=SoftwareVersion(major, 15), model="UR5e", lockstep=False)
    hands = Hands()
    window = Window(server, a_robot(info=info, address=Address("127.0.0.1", Ports(), 29900 * has_api)), hands)
    for label, since, deeds in ROWS:
        assert (
            (label in window.labels() - {"Control"})
            or label == "Control"
            or since > (major if has_api else 0)
        )
        if since <= (major if has_api else 0):
            row = next(
                handle for handle in window.controls() if handle.label == label and hasattr(handle, "options")
            )
            for option in deeds:
                window.choose(row, option)
    pressed = {name for kind, name in (what for what in hands.done if len(what) == 2) if kind == "press"}
    assert len(pressed) == 9
    assert has_api or all(kind == "press" for kind, _ in hands.done)
    assert (("enabling_device", {"position": "fully pressed"}) in hands.done) == (has_api and major >= 5)


def test_what_is_not_done_is_told_once_and_replies_are_told(window):
    window.use("Power", "Power on")
    window.hands.refusal = "no power: it is <b>late</b>\n"
    for _ in range(5):
        window.hold("base +")
    assert window.client.told == [("Robot", "power on done"), ("Not done", "no power: it is <b>late</b> ")]


def test_programs_speed_inputs_and_freedrive(window):
    window.use("File", "a.urp\nquit")
    window.use("Load program")
    window.use("Speed %", 30)
    window.use("In, standard", "0 ●")
    window.use("In, tool", "1 ○")
    for option in FREEDRIVE:
        window.use("Freedrive", option)
    *first, run, stop = window.hands.done
    assert first == [
        ("tell_dashboard", "load a.urp quit"),
        ("set_speed", {"fraction": 0.3}),
        ("set_digital_input", {"group": "standard", "n": 0, "level": False}),
        ("set_digital_input", {"group": "tool", "n": 1, "level": True}),
    ]
    assert run[0] == "run"
    assert "freedrive_mode()" in run[1]
    assert stop == ("press", "stop")


def test_controls_follow_the_robot_and_nobody_is_asked(window):
    window.robot.values = {
        **window.robot.values,
        "actual_digital_input_bits": 0b110,
        "target_speed_fraction": 0.2,
    }
    window.control("Speed %")._impl.update_timestamp = 0.0
    window.update()
    assert window.control("Speed %").value == 20
    assert window.control("In, standard").options[:4] == ("0 ○", "1 ●", "2 ●", "3 ○")
    window.work()
    assert window.hands.done == []


def test_the_world(window):
    window.use("Name", NAME)
    window.use("At m", (0.5, 0.1, 0.2))
    pose = (0.5, 0.1, 0.2, 0.0, 0.0, 0.0)
    window.use("Shape", "sphere")
    window.use("Put obstacle")
    assert window.hands.done.pop() == (
        "add_obstacle",
        {"name": NAME, "shape": "sphere", "size": (0.1,), "pose": pose},
    )
    window.use("Name", "can")
    window.use("Shape", "cylinder")
    window.use("Put thing")
    size = (0.1, 0.1)
    thing = {"name": "can", "shape": "cylinder", "size": size, "pose": pose, "mass": 0.5}
    assert window.hands.done.pop() == ("add_thing", thing)
    window.use("Show the place")
    place = window.server.scene.get_handle_by_name("/robot0/place")
    assert place.visible
    window.use("At m", (0.1, 0.2, 0.3))
    assert tuple(place.position) == (0.1, 0.2, 0.3)
    place.position = (0.30001, 0.2, 0.3)
    window.happens(place._impl_aux.update_cb, place, phase="update")
    window.work()
    assert window.control("At m").value == (0.3, 0.2, 0.3)
    window.use("Hang load on the flange")
    assert window.hands.done.pop() == ("attach_payload", {"mass": 0.5})
    window.use("Remove")
    assert window.client.told.pop()[1] == "nothing of this name is there to be removed"
    can = ThingNow("can", ZEROS, ZEROS, touches_tool=False)
    window.robot.state = a_state(obstacles=(NAME, f"{NAME}y"), things=(can,))
    window.update()
    assert window.control("There").options == ("can", plain(NAME))
    for name in window.control("There").options:
        window.use("There", name)
        window.use("Remove")
    assert window.hands.done == [
        ("remove_thing", {"name": "can"}),
        ("remove_obstacle", {"name": f"{NAME}y"}),
    ]


@given(st.text(max_size=400))
def test_text_is_one_line_of_what_prints(text):
    assert plain(text).isprintable()
    assert len(plain(text)) <= 161


def test_hostile_texts_are_shown_as_text(window):
    robot, question = window.robot, Question(3, "STRING", HOSTILE)
    robot.state, robot.variables = a_state(program=HOSTILE, clients=(HOSTILE,)), {HOSTILE: HOSTILE}
    robot.log.extend((k, f"{k} {HOSTILE}") for k in range(100))
    vars(robot).update(
        problem=HOSTILE, program=HOSTILE, label=HOSTILE, popups=(HOSTILE,) * 9, questions=(question,)
    )
    window.update()
    texts = [handle.value for handle in window.controls() if isinstance(handle.value, str)]
    assert any("<img src=x onerror" in text for text in texts)
    lines = [line for text in texts for line in text.split("\n")]
    assert all(line.isprintable() and len(line) < 200 for line in lines)
    assert window.control("Log").value.splitlines()[0].startswith("99.00  99 <img")
    assert window.control("Clients").value.startswith("<img")
    assert window.control("Variables").value.startswith("<img")
    assert len(window.control("Log").value.splitlines()) == 40
    window.use("Filter", "7 <IMG")
    window.update()
    assert len(window.control("Log").value.splitlines()) == 10


def test_popups_and_questions_until_they_are_gone(window):
    robot = window.robot
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
    assert window.client.told[-1][0] == "Not done"
    assert "many" in window.client.told[-1][1]
    robot.questions, robot.popups = (), ("look",)
    window.update()
    assert not window.server.gui._modal_handle_from_uuid  # which would cover the panel
    emergency = window.control("Emergency")
    text = window.control("Text")
    container = window.server.gui._container_handle_from_uuid[text._impl.parent_container_id]
    assert emergency.order < container.order < window.panel._controls._tabs.order
    window.choose(window.controls()[-1], "Close popup")
    assert window.hands.done.pop() == ("press", "close popup")
    robot.popups = ()
    window.update()
    assert "Text" not in window.labels()


# --- moving


def test_a_button_that_is_held_moves_a_joint_and_its_release_stops_it(window):
    window.hold("elbow +")
    window.hold("elbow +")
    window.hold("elbow +")
    steps = [what[1][2] - Q[2] for what in window.hands.done]
    assert steps == pytest.approx([0.06, 0.12, AHEAD])
    window.robot.values = {**window.robot.values, "target_qd": (0.0, 0.0, 0.6, 0.0, 0.0, 0.0)}
    window.guiding._heard = 0.0
    window.update()
    window.work()
    assert window.hands.done[-1][1][2] - Q[2] == pytest.approx(0.036 + 0.12)
    window.update()
    assert window.lane.given == []


@pytest.mark.parametrize("label", ["base +", "Go there"])
def test_an_arm_without_power_is_not_moved(window, label):
    window.robot.values = {**window.robot.values, "robot_mode": RobotMode.IDLE}
    window.hold(label) if label == "base +" else window.use(label)
    assert window.hands.done == []
    assert window.client.told == [("Not done", "the arm must be RUNNING: power it on, release the brakes")]


def test_postures_are_stored_and_reached(window):
    window.use("Go there")
    window.use("Store posture")
    window.update()
    window.use("Posture", "posture 1")
    window.use("Go there")
    assert [what[1] for what in window.hands.done] == [
        tuple(np.round((0, -np.pi / 2, 0, -np.pi / 2, 0, 0), 6)),
        Q,
    ]


joint_angles = st.lists(st.floats(-6.0, 6.0), min_size=6, max_size=6).map(np.array)


@given(joint_angles, joint_angles, st.integers(0, 5), st.floats(-1.0, 1.0))
def test_jogging_keeps_near_and_within_the_limits(goal, q, joint, step):
    wanted = jogged(goal, q, joint, step, MODEL)
    others = np.arange(6) != joint
    assert (wanted[others] == goal[others]).all()
    assert abs(wanted[joint] - q[joint]) <= AHEAD + 1e-12
    assert MODEL.limits.q_min[joint] <= wanted[joint] <= MODEL.limits.q_max[joint]


def drag(window, phase, T):
    gizmo = window.guiding.frame
    gizmo._impl.position, gizmo._impl.wxyz = T[:3, 3], np.roll(pin.Quaternion(T[:3, :3]).coeffs(), 1)
    window.happens(gizmo._impl_aux.update_cb, gizmo, phase=phase)


def test_the_tool_goes_where_its_frame_is_dragged(window):
    gizmo, start = window.guiding.frame, window.drawing.T_base_tcp
    assert gizmo.visible
    assert gizmo.position == pytest.approx(start[:3, 3])
    drag(window, "start", start)
    window.work()
    assert window.hands.done == []
    T = start.copy()
    for _ in range(4):
        T[2, 3] += 0.02
        drag(window, "update", T)
        window.work()
        window.update()
        assert gizmo.position == pytest.approx(T[:3, 3])  # in the hand, not where the robot is
    found = tcp_pose(MODEL, window.hands.goal) @ pose_to_T(window.robot.values["tcp_offset"])
    assert found == pytest.approx(T, abs=1e-5)
    far = T.copy()
    for x in (5.0, 5.1, 5.2):
        far[0, 3] = x
        drag(window, "update", far)
    drag(window, "end", far)
    window.work()
    window.update()
    assert len(window.hands.done) == 4
    assert len(window.client.told) == 1
    assert gizmo.position == pytest.approx(start[:3, 3])  # where the robot still is


def test_no_frame_to_drag_while_a_program_has_the_arm(window):
    gizmo, values = window.guiding.frame, window.robot.values
    for mode, program, goal, is_there in (
        (RobotMode.RUNNING, ProgramState.PLAYING, None, False),
        (RobotMode.RUNNING, ProgramState.PLAYING, np.array(Q), True),  # the window's own
        (RobotMode.IDLE, ProgramState.STOPPED, None, False),
        (RobotMode.RUNNING, ProgramState.STOPPED, None, True),
    ):
        values.update(robot_mode=mode, runtime_state=program)
        window.hands.goal = goal
        window.update()
        assert gizmo.visible is is_there
    window.use("Drag the tool", False)
    window.update()
    assert not gizmo.visible


def test_no_pose_is_reached_by_a_jump_or_beyond_a_limit():
    q = np.array(Q)
    assert reached(MODEL, tcp_pose(MODEL, q + 0.05), q) == pytest.approx(q + 0.05)
    with pytest.raises(HandError, match="out of reach, beyond a joint's limit, or too far at once"):
        reached(MODEL, tcp_pose(MODEL, q + (JUMP + 0.1) * np.eye(6)[0]), q)
    at_limit = q.copy()
    at_limit[5] = ROBOTS["ur5e"].limits.q_max[5] - 0.01
    with pytest.raises(HandError):
        reached(MODEL, tcp_pose(MODEL, at_limit + 0.05 * np.eye(6)[5]), at_limit)


@pytest.mark.parametrize("frames", [0, 1])
def test_the_last_pose_of_a_drag_arrives_however_busy_window_and_robot_are(window, frames):
    """Poses come faster than the arm is told; each lies too far from the first to be reached from there."""
    posture, tcp = np.array(Q), pose_to_T(window.robot.values["tcp_offset"])
    drag(window, "start", tcp_pose(MODEL, posture) @ tcp)
    for step in range(1, 9):
        T = tcp_pose(MODEL, posture + 0.2 * step * np.eye(6)[0]) @ tcp
        drag(window, "end" if step == 8 else "update", T)
        for _ in range(frames):
            window.take()
            window.update()
    drag(window, "start", tcp_pose(MODEL, posture) @ tcp)  # and it is taken again at once
    window.work()
    assert len(window.hands.done) == 2  # the first, and what came last while it was done
    assert window.hands.goal == pytest.approx(posture + 1.6 * np.eye(6)[0], abs=1e-4)


def test_the_emergency_stop_waits_for_nothing(window):
    """The window's thread takes nothing, the robot does not answer, and a second click comes at once."""
    window.hands.operate = lambda operation: window.hands.done.append(operation)
    window.happens(window.control("Power")._impl.update_cb, window.control("Power"))
    row = window.control("Emergency")
    for button in ("Emergency stop", "Release"):
        row._impl.value = button
        window.happens(row._impl.update_cb, row)
    while len(window.hands.done) < 2:
        sleep(0.001)
    assert set(window.hands.done) == {"emergency_stop", "release_emergency_stop"}


def pull(window, phase, start, end, link=-1):
    node = window.drawing.arm.links[link]
    more = {"phase": phase, "start_position": tuple(start), "end_position": tuple(end)}
    window.happens([window.guiding._enter_pull], node, **more)
    window.take()
    window.guiding._pushed = 0.0
    window.update()
    window.work()


def test_the_arm_is_pushed_where_the_mouse_takes_it(window):
    flange = window.drawing.arm.T_base_flange
    at = flange[:3, 3] + flange[:3, :3] @ (0.02, -0.03, 0.1)
    pull(window, "start", at, np.add(at, (0.0, 0.1, 0.0)))
    (name, given), arrow = window.hands.done.pop(), window.guiding.arrow
    assert name == "push"
    assert given["force"] == pytest.approx((0.0, 0.1 * STIFFNESS, 0.0))
    assert given["duration"] == 0.3
    assert given["point"] == pytest.approx((0.02, -0.03, 0.1), abs=1e-9)
    assert arrow.visible
    pull(window, "update", at, np.add(at, (9.0, 0.0, 0.0)))
    assert window.hands.done.pop()[1]["force"] == pytest.approx((MAX_FORCE, 0.0, 0.0))
    pull(window, "end", at, np.add(at, (9.0, 0.0, 0.0)))
    assert window.hands.done == []
    assert not arrow.visible


def test_what_cannot_be_pushed_is_not_pushed_elsewhere(window):
    pull(window, "start", (0.0, 0.0, 0.1), (0.5, 0.0, 0.1), link=2)
    assert window.client.told.pop()[1] == "pull at the last link or at the tool: a box is pushed there"
    assert not window.guiding.arrow.visible
    pull(window, "start", (0.0, 0.0, 0.0), (9.0, 0.0, 0.0))  # at the end of a tool that is as long
    assert "at most 0.3 m" in window.client.told.pop()[1]
    assert window.hands.done == []


@given(st.tuples(*3 * [st.floats(-1.0, 1.0)]).filter(lambda v: np.linalg.norm(v) > 1e-3))
def test_the_box_takes_the_hardest_pull_in_any_direction(way):
    make("push", {"force": pulled(np.zeros(3), 99.0 * np.array(way)).tolist()})


def test_the_tool_is_pulled_at_too(window):
    tool = BodyShape("hand", True, "box", (0.1, 0.1, 0.1), ZEROS)
    wall = BodyShape("wall", False, "box", (0.1, 0.1, 0.1), ZEROS)
    window.robot.state = a_state(shapes=(tool, wall))
    window.update()
    hand, wall = (
        next(node for (name, *_), node in window.drawing._shapes.items() if name == one)
        for one in ("hand", "wall")
    )
    assert (hand._has_any_drag_callbacks(), wall._has_any_drag_callbacks()) == (True, False)
    window.robot.is_held = False
    window.update()
    assert not hand._has_any_drag_callbacks()


def test_a_spring_pulls_with_so_much_at_most():
    assert pulled(np.zeros(3), np.array((0.1, 0.0, 0.0))) == pytest.approx((0.1 * STIFFNESS, 0.0, 0.0))
    assert np.linalg.norm(pulled(np.zeros(3), np.array((3.0, 4.0, 0.0)))) == pytest.approx(MAX_FORCE)


# --- values and plots


def test_what_a_robot_does_not_report_is_empty(server):
    window = Window(server, a_robot(is_held=False, values={}, info=None), Hands())
    assert {window.control(label).value for label in ("Mode", "TCP mm", *LINES)} == {""}
    assert window.control("Program").value == "none ()"


def test_plots_have_as_many_lines_at_any_time():
    samples = [Sample(float(k), {"actual_q": (float(k),) * 6, "speed_scaling": 0.5}) for k in range(3)]
    samples.append(Sample(3.0, {}))
    signals = {signal.name: signal for signal in PLOTTED}
    for name in ("actual_q", "speed_scaling", "actual_momentum"):
        data = columns(samples, signals[name], 3.0)
        assert len(data) == 7
        assert {column.shape for column in data} == {(4,)}
        assert data[0].tolist() == [-3.0, -2.0, -1.0, 0.0]
    assert columns(samples, signals["actual_q"], 3.0)[6].tolist()[:3] == [0.0, 1.0, 2.0]
    assert len(columns([], signals["actual_q"], 3.0)) == 7


def test_a_real_box_is_held(server):
    """Values come, and a key acts."""
    with ControlBox("ur5e", pace="lockstep", port_base=None, control_port=0) as box:
        robot = Robot(Address("127.0.0.1", box.ports, box.control_port))
        try:
            while not (robot.is_held and robot.values and robot.state):
                sleep(0.01)
            window = Window(server, robot, hands.Hands(robot))
            assert window.control("Robot").value.startswith("UR5e")
            window.use("Emergency", "Emergency stop")
            box.wait_until(safety_mode="ROBOT_EMERGENCY_STOP", timeout=20.0)
            assert box.state.safety_mode == "ROBOT_EMERGENCY_STOP", window.client.told
        finally:
            robot.close()
