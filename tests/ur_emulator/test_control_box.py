"""What the operations do to a box, called as methods from another thread."""

import queue
import socket
import threading
import time
from dataclasses import replace
from math import hypot

import pytest
from box_support import TIMEOUT, Bench, inside
from control_support import control_box
from hypothesis import given
from hypothesis import strategies as st

from protocol.pose import pose_to_T
from ur_emulator import ControlBox
from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import (
    ArgumentError,
    ControlError,
    EmulatorError,
    NotRunningError,
    RefusedError,
    WaitTimeoutError,
)
from ur_emulator.host import served_box
from ur_emulator.machine.commands.programs import StopProgram
from ur_emulator.machine.commands.surroundings import (
    FARTHEST,
    MAX_FORCE,
    MAX_LEVER,
    SMALLEST,
    AddObstacle,
    Push,
    RemoveObstacle,
    SetAnalogInput,
    SetDigitalInput,
)
from ur_emulator.machine.models.generations import E_SERIES

MOVE = "def move():\n  movej([0.5, -1.5, -1.8, 0, 1.2, 1.5])\nend\n"
LOOP = "def loop():\n  while True:\n    sync()\n  end\nend\n"


@pytest.fixture
def box():
    with control_box(control_port=None, in_process=True) as box:
        yield box


# --- state, log, waiting


def test_the_state_is_a_frozen_view_of_the_last_cycle(box):
    state = box.state
    assert (state.robot_mode, state.safety_mode, state.program_state) == ("RUNNING", "NORMAL", "STOPPED")
    assert state.steady
    assert len(state.q) == len(state.tcp_pose) == len(state.joint_modes) == 6
    with pytest.raises(AttributeError):
        state.tick = 0
    assert box.state == state  # in lockstep nothing happens by itself


SCENE = """<mujoco>
<asset><mesh name="wedge" vertex="0 0 0  .2 0 0  .2 .1 0  0 .1 0  0 0 .3"/></asset>
<worldbody>
<geom type="mesh" mesh="wedge" pos=".5 .3 0"/>
<body name="loose" pos="-.5 .3 .2"><freejoint/><geom type="mesh" mesh="wedge"/></body>
</worldbody></mujoco>"""


def test_the_state_has_what_is_to_be_drawn(tmp_path):
    """Meshes are the boxes around them, along the axes of their file; safety planes look to the allowed side."""
    scene = tmp_path / "scene.xml"
    scene.write_text(SCENE, "utf-8")
    planes = {"left": (0.0, -0.6, -0.8), "top": (0.0, 0.0, -1.0), "bottom": (0.0, 0.0, 1.0)}
    with control_box(control_port=None, in_process=True, scene=scene) as box:
        for name, normal in planes.items():
            box.set_safety_plane(name, [1.0, 2.0, 3.0], normal, "reduced")
        shapes = {shape.name: shape for shape in box.state.shapes}
    for name, corner in {"scene": (0.5, 0.3, 0.0), "loose": (-0.5, 0.3, 0.2)}.items():
        assert (shapes[name].shape, shapes[name].size) == ("box", pytest.approx((0.2, 0.1, 0.3)))
        middle = [at + size / 2 for at, size in zip(corner, shapes[name].size, strict=True)]
        assert shapes[name].pose == pytest.approx((*middle, 0.0, 0.0, 0.0), abs=0.01)  # one falls
    for name, normal in planes.items():
        assert shapes[name].pose[:3] == (1.0, 2.0, 3.0)
        assert pose_to_T(shapes[name].pose)[:3, 2] == pytest.approx(normal)


def test_the_state_names_who_is_connected(box):
    def until(*clients):
        begun = time.monotonic()
        while box.state.clients != clients:
            assert time.monotonic() - begun < TIMEOUT

    with socket.create_connection((box.host, box.ports.rtde)) as client:
        until("{}:{} at rtde {}".format(*client.getsockname(), box.ports.rtde))
    until()


def test_waiting_ends_in_the_cycle_in_which_all_holds(box):
    box.run_program(MOVE)
    state = box.wait_until(program_state="STOPPED", steady=True)
    assert state.q == pytest.approx([0.5, -1.5, -1.8, 0, 1.2, 1.5], abs=0.01)


def test_waiting_in_vain_says_for_what_and_waiting_for_nothing_is_refused(box):
    with pytest.raises(WaitTimeoutError, match="robot_mode is RUNNING, not IDLE, no log entry with 'x'"):
        box.wait_until(robot_mode="IDLE", steady=True, log="x", timeout=0.01)
    with pytest.raises(TimeoutError):
        box.wait_until(popup=True, timeout=0)
    with pytest.raises(ArgumentError, match="needs a condition"):
        box.wait_until()


def test_what_is_done_is_logged_and_what_is_asked_is_not(box):
    before = len(box.log)
    _ = box.state, box.identity
    assert len(box.log) == before
    box.push((1, 0, 0), duration=0.1)
    box.run_program(MOVE)
    texts = [entry.text for entry in box.log[before:] if entry.source == "Control"]
    assert texts[0] == "push force=(1.0, 0.0, 0.0) point=(0.0, 0.0, 0.0) duration=0.1"
    assert texts[1].startswith("run_program script=def move(): movej([0.5")
    assert len(texts[1]) < 100
    box.wait_until(log="push force")  # also what is there already
    with pytest.raises(WaitTimeoutError):
        box.wait_until(log="push force", after=len(box.log), timeout=0.01)


# --- wires


@pytest.mark.parametrize(("group", "count"), [("standard", 8), ("configurable", 8), ("tool", 2)])
def test_digital_inputs_are_set_one_by_one(box, group, count):
    for n in range(count):
        box.set_digital_input(group, n, True)
        assert box.state.digital_inputs[group] == tuple(k == n for k in range(count))
        box.set_digital_input(group, n, False)
    with pytest.raises(ArgumentError):
        box.set_digital_input(group, count, True)


def test_a_program_sees_inputs(box):
    box.set_digital_input("standard", 3, True)
    box.set_analog_input("standard", 1, 2.5)
    box.set_analog_input("tool", 0, 10.0)
    box.run_program(
        "textmsg(get_standard_digital_in(3), get_standard_analog_in(1))\ntextmsg(get_tool_analog_in(0))\n",
        wait=True,
    )
    assert {"True2.5", "10"} <= {entry.text for entry in box.log if entry.source == "Program"}


def test_a_value_beyond_the_range_of_the_line_is_refused(box):
    box.run_program("def f():\n  set_standard_analog_input_domain(0, 0)\nend\n")
    box.wait_until(program_state="STOPPED")
    box.set_analog_input("standard", 0, 0.012)
    assert box.state.analog_inputs[0] == 0.012
    with pytest.raises(RefusedError, match=r"0\.004 to 0\.02 A"):
        box.set_analog_input("standard", 0, 5.0)


@pytest.mark.parametrize(
    ("kind", "arguments"),
    [
        (SetDigitalInput, ("tool", -1, True)),
        (SetDigitalInput, ("nowhere", 0, True)),
        (SetAnalogInput, ("standard", 2, 1.0)),
        (SetAnalogInput, ("standard", 0, float("nan"))),
        (SetAnalogInput, ("tool", 0, 1e300)),
    ],
)
def test_absurd_wires_cannot_even_be_made(kind, arguments):
    with pytest.raises(EmulatorError):
        kind(*arguments)


# --- hands


@pytest.mark.parametrize("cycles", [0, 1, 3, 50])
def test_a_push_lasts_as_long_as_it_was_given(cycles):
    bench = Bench(robot="ur5e", generation=E_SERIES, fidelity="ideal")  # its sensor feels at once
    bench.tick(1, Push((0.0, 0.0, -20.0), duration=cycles * 0.002))
    felt = [bench.now.actual_tcp_force[2] < -10.0]
    for _ in range(300):
        felt.append(bench.tick().actual_tcp_force[2] < -10.0)
    assert sum(felt) == cycles
    assert not bench.controller.is_active


DIRECTIONS = st.tuples(*3 * [st.floats(-1.0, 1.0)]).filter(lambda v: hypot(*v) > 1e-3)


@given(DIRECTIONS, DIRECTIONS)
def test_what_rounding_puts_beyond_a_bound_is_on_it(force, point):
    """A vector that is made as long as allowed is often a hair longer."""
    push = [MAX_FORCE * x / hypot(*force) for x in force]
    lever = [MAX_LEVER * x / hypot(*point) for x in point]
    Push(push, point=lever)
    AddObstacle(
        "ball", "sphere", (0.1 + 0.2 - 0.3 + SMALLEST,), [FARTHEST * x / hypot(*force) for x in force] + lever
    )
    with pytest.raises(ArgumentError, match=r"force .* together at most 250 N"):
        Push([1.0001 * x for x in push])
    with pytest.raises(ArgumentError, match=r"duration .* given: allowed is 0 to 600 s"):
        Push(push, duration=600.1)
    assert Push(push, duration=600.0 * (1.0 + 1e-15)).duration == 600.0


def test_a_strong_push_is_a_protective_stop_that_can_be_unlocked(box):
    box.push((0, 0, 250), duration=1)
    assert box.wait_until(safety_mode="PROTECTIVE_STOP").robot_mode == "RUNNING"
    box.wait_until(steady=True)
    box.push((0, 0, 0))
    box.wait_until(time=box.state.time + 1.0)  # the arm returns
    box.unlock_protective_stop()
    assert box.state.safety_mode == "NORMAL"
    with pytest.raises(RefusedError, match="no protective stop"):
        box.unlock_protective_stop()


# --- surroundings


def test_an_obstacle_stands_in_the_way_until_it_is_removed(box):
    box.add_obstacle("wall", "plane", (), (0.0, -0.28, 0.0, -1.5708, 0.0, 0.0))
    assert box.state.obstacles == ("wall",)
    box.run_program("def f():\n  movej([-1.2, -1.7645, -2.0996, -0.103, 1.295, 1.857])\nend\n")
    box.wait_until(safety_mode="PROTECTIVE_STOP")
    box.remove_obstacle("wall")
    assert box.state.obstacles == ()
    with pytest.raises(RefusedError, match="no obstacle 'wall': there is none"):
        box.remove_obstacle("wall")


def test_what_a_program_prints_refuses_nothing(box):
    box.run_program(
        'def loop():\n  while True:\n    textmsg("obstacle box: hello")\n    sync()\n  end\nend\n'
    )
    box.add_obstacle("box", "box", (0.1, 0.1, 0.1), (1, 0, 0, 0, 0, 0))
    assert box.state.obstacles == ("box",)
    with pytest.raises(RefusedError, match=r"^obstacle box: the arm is where it should stand"):
        box.add_obstacle("box", "sphere", (0.2,), (*box.state.tcp_pose[:3], 0, 0, 0))
    assert "obstacle box: the arm is where it should stand, move one of them" in [e.text for e in box.log]


# --- safety and power


def test_no_program_is_started_in_an_emergency_stop(box):
    box.emergency_stop("system")
    state = box.wait_until(robot_mode="POWER_OFF")
    assert state.safety_mode == "SYSTEM_EMERGENCY_STOP"
    with pytest.raises(RefusedError, match="not started"):
        box.run_program(MOVE)


def test_a_violation_with_its_reason_is_left_by_a_restart(box):
    box.trigger_violation("the guard dog bit")
    box.wait_until(safety_mode="VIOLATION", robot_mode="POWER_OFF", log="the guard dog bit")
    box.restart_safety()
    box.wait_until(safety_mode="NORMAL", robot_mode="POWER_OFF")


# --- programs


def test_a_program_that_cannot_be_read_says_why(box, tmp_path):
    path = tmp_path / "windows.script"
    path.write_text(MOVE, encoding="utf-16")
    for words, options, why in (
        (["def f():\n  x = = 1\nend\n"], {}, r"does not compile[^\n]*\(line 2, column 7\)$"),
        ([], {}, "either"),
        ([MOVE], {"file": "move"}, "either"),
        ([path], {}, "is UTF-16 text"),
    ):
        with pytest.raises(ArgumentError, match=why):
            box.run_program(*words, **options)
    path.write_text(MOVE, encoding="utf-8-sig")
    box.run_program(path)


def test_a_program_is_paused_resumed_and_stopped(box):
    for wrong in (box.pause_program, box.resume_program):
        with pytest.raises(RefusedError, match="STOPPED"):
            wrong()
    box.run_program(LOOP)
    box.pause_program()
    box.wait_until(program_state="PAUSED")
    with pytest.raises(RefusedError, match="PAUSED"):
        box.pause_program()
    box.resume_program()
    box.wait_until(program_state="PLAYING")
    box.stop_program()
    box.wait_until(program_state="STOPPED")
    box.stop_program()


def test_a_program_that_was_asked_for_before_one_that_has_begun_does_not_begin():
    with control_box(control_port=None, in_process=True) as box:
        inside(box)._box.newest = time.monotonic() + 3600.0
        with pytest.raises(RefusedError, match="newer one"):
            box.run_program(MOVE)
        assert box.state.program_state == "STOPPED"


def test_a_program_can_be_waited_for_with_its_error(box):
    box.run_program(MOVE, wait=True)
    assert (box.state.program_state, box.state.steady) == ("STOPPED", True)
    with pytest.raises(RefusedError, match=r"program f ended with an error: .*zero"):
        box.run_program("def f():\n  sync()\n  x = 1 / 0\nend\n", wait=True)


def test_a_program_comes_from_a_file_of_this_machine_or_of_the_box(tmp_path):
    (tmp_path / "loop.script").write_text(LOOP)
    with control_box(programs=tmp_path, in_process=True) as box:
        box.run_program(file="loop.script")
        box.protective_stop()
        box.wait_until(program_state="PAUSED")  # one that is sent ends
        with pytest.raises(RefusedError, match="stays paused"):
            box.resume_program()
        box.stop_program()
        box.unlock_protective_stop()
        with pytest.raises(RefusedError, match="nowhere"):
            box.run_program(file="nowhere.script")
        (tmp_path / "sent.script").write_text('def f():\n  textmsg("sent as text")\nend\n')
        box.run_program(tmp_path / "sent.script")
        box.wait_until(log="sent as text")


# --- the operator


def test_popups_are_seen_and_closed_and_what_cannot_be_said_is_refused(box):
    box.run_program('def pop():\n  popup("mind your head", blocking=True)\n  textmsg("closed")\nend\n')
    assert box.wait_until(popup=True).popups == ("mind your head",)
    box.close_popups()
    box.wait_until(popup=False, log="closed")
    with pytest.raises(RefusedError, match="none is open"):
        box.answer(1)
    with pytest.raises(ArgumentError):
        box.answer([1])
    for text in ("\ud800", "x" * 1001, None, 3):
        with pytest.raises(ArgumentError):
            box.add_to_log(text)


# --- threads and life


def test_who_submits_a_command_gets_its_result_from_another_process():
    told = queue.SimpleQueue()
    with control_box(control_port=None) as box:
        for command in (Push((1, 0, 0), duration=0.1), RemoveObstacle("wall")):
            box.submit(command, lambda result, refusal: told.put((result, refusal and str(refusal))))
        assert told.get(timeout=TIMEOUT) == (None, None)
        assert told.get(timeout=TIMEOUT) == (None, "there is no obstacle 'wall': there is none")
        box.submit(RemoveObstacle("wall"))  # nobody wants to know
        with pytest.raises(RefusedError, match="no obstacle 'wall'"):
            box.remove_obstacle("wall")


def test_a_box_that_does_not_run_says_so():
    box = ControlBox(pace="lockstep", port_base=None, in_process=True)
    with pytest.raises(NotRunningError, match="start it"):
        box.power_on()
    with box:
        box.power_on()
    with pytest.raises(NotRunningError, match="ended"):
        box.power_on()
    assert "power_on" in box.log[0].text


def test_who_waits_when_the_box_ends_gets_an_error():
    outcome = []
    with ControlBox(pace="lockstep", port_base=None) as box:
        box.run_program(LOOP)

        def wait():
            try:
                box.wait_until(robot_mode="IDLE", timeout=3600)
            except ControlError as error:
                outcome.append(error)

        thread = threading.Thread(target=wait)
        thread.start()
        box.submit(StopProgram())
    thread.join(20)
    assert [type(error) for error in outcome] == [NotRunningError]


def test_the_thread_of_the_box_may_not_wait_for_itself():
    outcome = []
    box = ControlBox(pace="lockstep", port_base=None)

    def follower(entry):
        if not outcome:
            try:
                outcome.append(box.state)
            except ControlError as error:
                outcome.append(error)

    box.follow_log(follower)
    with box:
        box.add_to_log("go")
    assert "thread of the box" in str(outcome[0])


def test_many_threads_use_one_box(box):
    ticks, failures = [], []

    def work(n):
        try:
            for k in range(20):
                ticks.append(box.set_digital_input("standard", n, k % 2 == 0))
        except EmulatorError as error:
            failures.append(error)

    threads = [threading.Thread(target=work, args=(n,)) for n in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert not failures
    assert len(ticks) == 160
    assert box.state.digital_inputs["standard"] == (False,) * 8


# --- robot time


def test_in_lockstep_time_passes_until_the_time_that_is_waited_for(box):
    begin = box.state
    for moment in (begin.time + 1.0, begin.time):  # the second has been
        assert box.wait_until(time=moment).tick == box.state.tick == begin.tick + 125


@pytest.mark.parametrize(
    ("lines", "operation", "arguments"),
    [
        ('popup("x", blocking=True)', "close_popups", {}),
        ('x = request_integer_from_primary_client("n?")', "answer", {"value": 3}),
    ],
    ids=["popup", "question"],
)
def test_who_waits_for_a_time_does_not_wait_for_the_operator(box, lines, operation, arguments):
    begin = box.state.time
    box.at(begin + 1.0, operation, arguments)
    box.run_program(f"def p():\n  {lines}\nend\n")
    now = box.wait_until(time=begin + 2.0)
    assert now.program_state == "STOPPED"
    assert now.time == pytest.approx(begin + 2.0)


def test_a_popup_of_one_thread_does_not_stop_the_time_of_the_others(box):
    """A move of another thread ends; then time stands until somebody closes the popup."""
    goal = [0.6, -1.7, -2.0, -0.1, 1.2, 1.5]
    box.run_program(
        f'def p():\n  thread t():\n    movej({goal}, a=3, v=2)\n    textmsg("moved")\n  end\n'
        '  h = run t()\n  popup("x", blocking=True)\nend\n'
    )
    now = box.wait_until(log="moved")
    assert now.target_q == pytest.approx(goal)
    assert box.state.tick == box.state.tick
    assert box.state.popups == ("x",)
    box.close_popups()
    box.wait_until(program_state="STOPPED")


def test_an_operation_acts_in_the_cycle_of_its_time(box):
    now = box.state
    level = {"group": "standard", "n": 3, "level": True}
    tick = box.at(now.time + 0.5, "set_digital_input", level)
    assert tick == now.tick + 63  # 62.5 cycles on
    box.run_program('while not get_standard_digital_in(3):\n  sync()\nend\ntextmsg("seen")\n')
    box.wait_until(log="seen")
    assert [entry.tick for entry in box.log if entry.text == "seen"] == [tick]
    assert box.wait_until(time=now.time + 0.5).digital_inputs["standard"][3]
    assert f"set_digital_input at {now.time + 0.5:g} s: done" in [entry.text for entry in box.log]


def test_the_cycle_of_an_operation_does_not_depend_on_the_speed_of_the_machine():
    def run():
        with control_box(control_port=None, in_process=True) as box:
            box.at(box.state.time + 0.6, "protective_stop")
            box.run_program(MOVE)
            return box.wait_until(safety_mode="PROTECTIVE_STOP", steady=True).q

    assert run() == run()


def test_operations_of_one_cycle_act_in_their_order_and_a_refused_one_stands_in_the_log(box):
    time = box.state.time + 0.1
    for fraction in (0.1, 0.7, 0.4):
        box.at(time, "set_speed", {"fraction": fraction})
    box.at(time, "resume_program")
    assert box.wait_until(time=time).speed == 0.4
    (text,) = [entry.text for entry in box.log if "resume_program at" in entry.text]
    assert "refused: there is no program to resume" in text


def test_times_and_operations_that_cannot_be_are_refused_at_once(box):
    now = box.state.time
    for at, name, arguments, problem in (
        (now, "protective_stop", None, "the time has passed"),
        (now + 1, "dance", None, "there is no operation 'dance'"),
        (now + 1, "wait_until", {"steady": True}, "does not act within one cycle"),
        (now + 1, "push", {"force": 3}, "force 3 given"),
        (now + 1, "push", {}, "push needs force"),
    ):
        with pytest.raises(ControlError, match=problem):
            box.at(at, name, arguments)
    with pytest.raises(RefusedError, match="too far ahead"):
        box.wait_until(time=now + 4000)
    assert box.state.time == now


def test_so_many_operations_wait_for_their_time(monkeypatch):
    monkeypatch.setattr(served_box, "BUDGETS", replace(BUDGETS, scheduled_commands=3))
    with control_box(control_port=None, in_process=True) as box:
        time = box.state.time + 1
        for _ in range(3):
            tick = box.at(time, "close_popups")
        with pytest.raises(RefusedError, match="3 operations wait for their time: no more are taken"):
            box.at(time, "close_popups")
        assert box.wait_until(time=time).tick == tick
