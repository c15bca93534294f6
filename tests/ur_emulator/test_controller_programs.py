"""What programs do to the arm, ask of the operator and set, cycle by cycle, mostly without sockets."""

import math
import struct

import numpy as np
import pytest
from box_support import VERSION, Bench, MessageReader, connect

from protocol.primary.messages import (
    PopupMessage,
    RequestedType,
    RequestValueMessage,
    TextMessage,
    decode_message,
    encode_message,
)
from protocol.ur_types import ProgramState, RobotMode, SafetyMode
from ur_emulator.commands.power import PowerOff, ReleaseBrakes
from ur_emulator.commands.programs import AnswerRequest, ClosePopup, SetSpeedSlider, StartProgram, StopProgram
from ur_emulator.commands.safety import TriggerProtectiveStop, UnlockProtectiveStop
from ur_emulator.controller.events import ErrorReported, ProgramStarted, ProgramStopped, ScriptFailed
from ur_emulator.controller.safety.limit_checks import MAX_POSITION_DEVIATION
from ur_emulator.controller.settings import ErrorSettings
from ur_emulator.emulator import ControlBox
from ur_emulator.errors import ArgumentError
from urscript import compile_program
from urscript.catalogue import catalogue_for

SPIN = "def spin():\n  while True:\n    speedj([0.2,0,0,0,0,0], 2.0, get_steptime())\n  end\nend\n"


@pytest.fixture
def bench():
    return Bench(fidelity="ideal")


def texts(events):
    return [event.text for event in events if isinstance(event, ScriptFailed | ErrorReported)]


def test_a_program_moves_the_arm_and_ends(bench):
    assert bench.run('def m():\n  movej([0.5,-1.5,-1.8,0,1.2,1.5])\n  textmsg("there")\nend\n') == ["there"]
    assert bench.now.target_q == pytest.approx([0.5, -1.5, -1.8, 0, 1.2, 1.5])
    assert bench.now.runtime_state == ProgramState.STOPPED
    kinds = [type(event) for event in bench.events]
    assert kinds[0] is ProgramStarted
    assert kinds[-1] is ProgramStopped


def test_even_the_shortest_program_is_seen_to_run(bench):
    bench.start("textmsg(1)\n")
    assert bench.now.runtime_state == ProgramState.PLAYING
    assert bench.tick().runtime_state == ProgramState.STOPPED


def test_speedj_with_the_step_time_takes_exactly_one_cycle_a_call(bench):
    bench.start(
        "def s():\n  i = 0\n  while i < 50:\n    speedj([0.1,0,0,0,0,0], 5, get_steptime())\n    i = i + 1\n  end\n"
        "  textmsg(i)\nend\n"
    )
    bench.tick(49)
    assert not [e for e in bench.events if type(e).__name__ == "TextPrinted"]
    bench.tick(1)
    assert [e.text for e in bench.events if type(e).__name__ == "TextPrinted"] == ["50"]


def test_speedj_with_t_returns_after_t_whether_or_not_the_speed_is_reached(bench):
    bench.start("def s():\n  speedj([1.0,0,0,0,0,0], 0.5, 0.4)\n  textmsg(get_target_joint_speeds())\nend\n")
    bench.tick(60)
    (said,) = [e.text for e in bench.events if type(e).__name__ == "TextPrinted"]
    assert said.startswith("[0.2")


def test_a_stream_that_pauses_makes_the_arm_stutter(bench):
    bench.start(
        "def s():\n  i = 0\n  while i < 60:\n    speedj([0.2,0,0,0,0,0], 2.0, get_steptime())\n    i = i + 1\n  end\n"
        "  sync()\n  sync()\n  sync()\n"
        "  while True:\n    speedj([0.2,0,0,0,0,0], 2.0, get_steptime())\n  end\nend\n"
    )
    bench.tick(59)
    assert bench.now.target_qd[0] == pytest.approx(0.2)
    dip = min(bench.tick().target_qd[0] for _ in range(8))
    assert dip == pytest.approx(0.2 - 3 * 2.0 * 0.008)
    bench.tick(10)
    assert bench.now.target_qd[0] == pytest.approx(0.2)


def test_when_a_program_is_stopped_the_arm_ramps_to_rest(bench):
    bench.start(SPIN)
    bench.tick(60)
    motion = bench.controller.state.motion
    before = motion.target.qd[0]
    assert before == pytest.approx(0.2)
    states = []
    bench.tick(1, StopProgram())
    while motion.target.qd[0] > 0:
        assert before - motion.target.qd[0] <= motion.stop_deceleration * 0.008 * (1 + 1e-9)
        before = motion.target.qd[0]
        states.append(bench.now.runtime_state)
        bench.tick()
    bench.tick()
    assert set(states) == {ProgramState.STOPPING}
    assert bench.now.runtime_state == ProgramState.STOPPED
    assert bench.now.target_qdd == (0.0,) * 6


def test_stopping_a_program_also_stops_a_move_that_it_has_left_behind(bench):
    bench.start(
        'def m():\n  movej([1.4,-1.5,-1.8,0,1.2,1.5], a=1.4, v=1.0, r=0.1)\n  textmsg("left")\n  sleep(5)\nend\n'
    )
    while not [e for e in bench.events if type(e).__name__ == "TextPrinted"]:
        bench.tick()
    assert bench.now.target_qd[0] > 0.1
    bench.tick(1, StopProgram())
    bench.tick(20)
    assert bench.now.target_qd == (0.0,) * 6
    assert bench.now.target_q[0] < 1.39


def test_a_stream_of_one_line_programs_moves_without_braking(bench):
    for _ in range(60):
        bench.start("speedj([0.3,0,0,0,0,0], 5.0, 0.008)\n")
    speeds = [s.target_qd[0] for s in bench.snapshots[-20:]]
    assert speeds == pytest.approx([0.3] * 20)


def test_a_second_thread_cannot_take_the_arm(bench):
    bench.run(
        "def two():\n  thread mover():\n    while True:\n      speedj([0.1,0,0,0,0,0], 1.0, get_steptime())\n    end\n  end\n"
        "  h = run mover()\n  sleep(0.1)\n  stopj(1.0)\nend\n"
    )
    assert "Another thread is already controlling the robot" in texts(bench.events)[0]


def test_killing_the_mover_frees_the_arm(bench):
    said = bench.run(
        "def two():\n  thread mover():\n    while True:\n      speedj([0.1,0,0,0,0,0], 1.0, get_steptime())\n    end\n  end\n"
        '  h = run mover()\n  sleep(0.1)\n  kill h\n  stopj(1.0)\n  textmsg("free")\nend\n'
    )
    assert said == ["free"]
    assert bench.now.target_qd == (0.0,) * 6


def test_a_script_that_loops_without_sync_ends_with_the_controllers_error(bench):
    bench.run("def loop():\n  while True:\n  end\nend\n")
    assert "used too much time without instructing the robot" in texts(bench.events)[0]
    assert bench.now.runtime_state == ProgramState.STOPPED


def test_numbers_that_are_none_do_not_move_the_arm(bench):
    q = bench.now.target_q
    network = bench.network
    bench.start(
        'def f():\n  socket_open("10.0.0.1", 1234)\n  v = socket_read_ascii_float(1)\n'
        "  speedj([v[1],0,0,0,0,0], 1.0, 0.008)\nend\n"
    )
    network.sockets[0].inbox += b"(nan)"
    bench.tick(5)
    assert texts(bench.events)
    assert bench.now.target_q == q


def test_a_velocity_beyond_the_joint_limit_is_a_protective_stop(bench):
    bench.start("def f():\n  while True:\n    speedj([50,0,0,0,0,0], 40.0, get_steptime())\n  end\nend\n")
    bench.tick(60)
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    assert bench.now.runtime_state == ProgramState.STOPPED
    assert max(abs(s.target_qd[0]) for s in bench.snapshots) < 3.6
    assert bench.now.target_qd == (0.0,) * 6
    assert any(isinstance(e, ErrorReported) and e.code == 204 for e in bench.events)


def test_nothing_runs_in_a_protective_stop_until_it_is_unlocked(bench):
    bench.tick(1, TriggerProtectiveStop())
    bench.tick(2)
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    bench.start(SPIN)
    bench.tick(20)
    assert bench.now.target_qd == (0.0,) * 6
    bench.tick(1, UnlockProtectiveStop())
    bench.start(SPIN)
    bench.tick(20)
    assert bench.now.target_qd[0] > 0


def test_a_blocked_arm_stops_itself_and_drops_its_target(bench):
    bench.controller.plant.push((0.0, 0.0, -400.0))
    bench.tick(200)
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    assert any(isinstance(e, ErrorReported) and e.code in (153, 157) for e in bench.events)


def test_power_cycle_passes_through_the_modes():
    bench = Bench(mode=RobotMode.POWER_OFF)
    bench.tick(1, ReleaseBrakes())
    modes = [bench.tick().robot_mode for _ in range(300)]
    order = list(dict.fromkeys(modes))
    assert order[-3:] == [RobotMode.IDLE, RobotMode.BACKDRIVE, RobotMode.RUNNING]
    q = bench.now.actual_q
    bench.tick(1, PowerOff())
    bench.tick(50)
    assert bench.now.robot_mode == RobotMode.POWER_OFF
    assert np.abs(np.subtract(bench.now.actual_q, q)).max() < 1e-3


def test_a_program_is_refused_while_the_brakes_are_on():
    bench = Bench(mode=RobotMode.IDLE)
    bench.start(SPIN)
    assert "it must be RUNNING" in texts(bench.events)[0]


def test_reads_return_their_failure_shapes_when_the_peer_is_gone(bench):
    bench.network.refuse = True
    said = bench.run(
        'def f():\n  textmsg(socket_open("10.0.0.1", 1))\n  textmsg(socket_read_binary_integer(2))\n'
        "  textmsg(socket_read_byte_list(2))\n  textmsg(socket_send_int(5))\nend\n"
    )
    assert said == ["False", "[0,-1,-1]", "[0,-1,-1]", "False"]


def test_a_read_times_out_in_robot_time(bench):
    bench.start(
        'def f():\n  socket_open("10.0.0.1", 1)\n  textmsg(socket_read_binary_integer(1, timeout=0.1))\nend\n'
    )
    assert bench.controller.waits_outside
    bench.tick(20)
    assert [e.text for e in bench.events if type(e).__name__ == "TextPrinted"] == ["[0,-1]"]


def test_a_read_hands_over_what_came_and_keeps_the_rest(bench):
    bench.start(
        'def f():\n  socket_open("10.0.0.1", 1)\n  textmsg(socket_read_binary_integer(2))\n'
        '  textmsg(socket_read_string(suffix="!"))\n  textmsg(socket_read_line())\nend\n'
    )
    sock = bench.network.sockets[0]
    sock.inbox += struct.pack(">2i", 7, -9)[:5]
    bench.tick()
    assert bench.controller.waits_outside
    sock.inbox += struct.pack(">2i", 7, -9)[5:] + b"hi!line\r\n"
    bench.tick(2)
    assert [e.text for e in bench.events if type(e).__name__ == "TextPrinted"] == ["[2,7,-9]", "hi", "line"]
    assert not sock.is_open


def test_a_secondary_program_runs_beside_the_primary_one(bench):
    bench.start(SPIN)
    bench.tick(10)
    bench.start("sec out():\n  set_standard_digital_out(3, True)\nend\n")
    bench.tick(10)
    assert bench.now.actual_digital_output_bits == 0b1000
    assert bench.now.runtime_state == ProgramState.PLAYING
    bench.start("sec bad():\n  x = 1 / 0\nend\n")
    bench.tick(10)
    assert next(e for e in bench.events if isinstance(e, ScriptFailed)).secondary
    assert bench.now.runtime_state == ProgramState.PLAYING


def test_registers_outlive_programs(bench):
    bench.run(
        "def w():\n  write_output_integer_register(3, 42)\n  write_output_float_register(1, 1.5)\nend\n"
    )
    said = bench.run(
        "def r():\n  textmsg(read_output_integer_register(3), read_output_float_register(1))\nend\n"
    )
    assert said == ["421.5"]


def test_speed_slider_slows_a_move(bench):
    bench.tick(1, SetSpeedSlider(0.5))
    bench.run("def m():\n  movej([0.5,-1.5,-1.8,0,1.2,1.5], a=1.4, v=0.4)\nend\n")
    assert max(abs(x) for s in bench.snapshots for x in s.target_qd) == pytest.approx(0.2)
    assert bench.now.target_speed_fraction == 0.5
    assert bench.now.speed_scaling == 1.0, "clients multiply the two"


def test_a_name_that_is_only_declared_says_so_when_it_is_called(bench):
    bench.tick(
        1, StartProgram(compile_program("mc_get_target_rtcp_speed()", catalogue=catalogue_for("5.22")))
    )
    bench.tick(2)
    assert "declared only" in texts(bench.events)[0]


def test_a_new_tcp_counts_at_once(bench):
    said = bench.run(
        "def f():\n  a = get_target_tcp_pose()\n  set_tcp(p[0,0,0.1,0,0,0])\n"
        "  textmsg(point_dist(a, get_target_tcp_pose()))\nend\n"
    )
    assert float(said[0]) == pytest.approx(0.1)


def test_a_program_reads_whatever_comes_at_once_without_using_too_much_time():
    bench = Bench(fidelity="ideal")
    n = 20_000
    bench.start(f"""def prog():
      socket_open("127.0.0.1", 5000)
      sync()
      i = 0
      while i < {n}:
        v = socket_read_binary_integer(1)
        if v[1] != i:
          textmsg("wrong ", i)
          halt
        end
        i = i + 1
      end
      textmsg("all")
    end""")
    bench.network.sockets[0].inbox += b"".join(i.to_bytes(4, "big") for i in range(n))
    cycles = 0
    while bench.controller.is_active and cycles < 100:
        bench.tick()
        cycles += 1
    assert [event.text for event in bench.events if type(event).__name__ == "TextPrinted"] == ["all"]
    assert not [event for event in bench.events if type(event).__name__ == "ScriptFailed"]


def asking(kind):
    bench = Bench()
    bench.start(
        f'def p():\n  x = request_{kind}_from_primary_client("how many?")\n  textmsg("got ", x)\nend\n'
    )
    return bench


def printed(bench):
    return [event.text for event in bench.events if type(event).__name__ == "TextPrinted"]


@pytest.mark.parametrize(
    ("kind", "requested", "answer", "text"),
    [
        ("boolean", RequestedType.BOOLEAN, True, "True"),
        ("integer", RequestedType.INTEGER, -3, "-3"),
        ("float", RequestedType.FLOAT, 2.5, "2.5"),
        ("string", RequestedType.STRING, "abc", "abc"),
    ],
)
def test_a_program_waits_for_its_answer(kind, requested, answer, text):
    bench = asking(kind)
    (event,) = [event for event in bench.events if type(event).__name__ == "ValueRequested"]
    assert (event.kind, event.text) == (requested, "how many?")
    bench.tick(50)
    assert bench.controller.waits_outside
    bench.tick(1, AnswerRequest(answer, event.request_id))
    assert printed(bench) == [f"got {text}"]
    assert not bench.controller.state.pendant.requests


@pytest.mark.parametrize(("answer", "text"), [("\u20acuro", "6"), ("", "0")])
def test_a_text_has_one_character_for_each_byte_of_utf_8(answer, text):
    bench = Bench()
    bench.start('def p():\n  textmsg(str_len(request_string_from_primary_client("?")))\nend\n')
    bench.tick(2, AnswerRequest(answer))
    assert printed(bench) == [text]


@pytest.mark.parametrize("answer", ["\ud800", "x" * 1001, math.nan, None])
def test_what_is_no_answer_at_all_cannot_be_given(answer):
    with pytest.raises(ArgumentError, match=r"^value .* given: allowed is true, false, number or text$"):
        AnswerRequest(answer)


@pytest.mark.parametrize(
    "wrong",
    [AnswerRequest(True), AnswerRequest(1.5), AnswerRequest(10**12), AnswerRequest(1, 99), ClosePopup()],
)
def test_wrong_answers_change_nothing(wrong):
    bench = asking("integer")
    bench.tick(3, wrong)
    assert bench.controller.programs.is_running
    bench.tick(1, AnswerRequest(4))
    assert printed(bench) == ["got 4"]


def test_the_rest_of_the_program_goes_on_meanwhile():
    bench = Bench()
    bench.start(
        "def p():\n  global n = 0\n  thread count():\n    while True:\n      n = n + 1\n      sync()\n    end\n"
        '  end\n  run count()\n  popup("wait", blocking=True)\n  textmsg(n)\nend\n'
    )
    bench.tick(20)
    bench.tick(1, ClosePopup())
    (text,) = printed(bench)
    assert int(text) >= 20


def test_a_blocking_popup_waits_and_another_does_not():
    bench = Bench()
    bench.start(
        'def p():\n  popup("a")\n  textmsg("shown")\n  popup("b", "title", blocking=True)\n  textmsg("closed")\nend\n'
    )
    bench.tick(30)
    assert printed(bench) == ["shown"]
    popups = [event for event in bench.events if type(event).__name__ == "PopupShown"]
    assert [(p.text, p.blocking, p.request_id) for p in popups] == [("a", False, 0), ("b", True, 1)]
    bench.tick(1, ClosePopup())
    assert printed(bench) == ["shown", "closed"]


def test_a_program_that_is_stopped_takes_its_question_away():
    bench = asking("string")
    bench.tick(1, StopProgram())
    assert bench.controller.state.pendant.requests == ()
    bench.tick(1, AnswerRequest("late"))
    assert not printed(bench)


def test_answers_go_to_the_oldest_question_of_their_type():
    bench = Bench()
    bench.start(
        'def p():\n  thread t():\n    y = request_integer_from_primary_client("b")\n    textmsg("b ", y)\n  end\n'
        '  h = run t()\n  x = request_integer_from_primary_client("a")\n  textmsg("a ", x)\n  join h\nend\n'
    )
    bench.tick(2)
    bench.tick(1, AnswerRequest(1))
    bench.tick(1, AnswerRequest(2))
    assert printed(bench) == ["a 1", "b 2"]


def test_the_message_on_the_wire():
    message = RequestValueMessage(timestamp=5, request_id=7, requested_type=RequestedType.FLOAT, text="x?")
    body = encode_message(message, VERSION)
    assert body[9:] == bytes.fromhex("09 00000007 00000002") + b"x?"
    assert decode_message(body, VERSION) == message


def test_the_dashboard_closes_popups():
    with ControlBox(pace="lockstep", port_base=None) as box, connect(box, "primary") as sock:
        reader = MessageReader(sock)
        sock.sendall(b'def p():\n  popup("press", blocking=True)\n  textmsg("on we go")\nend\n')
        popup = reader.message(PopupMessage)
        assert (popup.text, popup.is_blocking, popup.request_id) == ("press", True, 1)
        with connect(box, "dashboard") as dashboard:
            lines = dashboard.makefile("rb")
            lines.readline()
            dashboard.sendall(b"close popup\n")
            assert lines.readline() == b"closing popup\n"
            assert reader.message(TextMessage).text == "on we go"


@pytest.mark.parametrize("kind", ["def", "sec"])
def test_powerdown_ends_the_program_and_cuts_the_power(kind):
    bench = Bench()
    bench.start("def other():\n  while True:\n    sync()\n  end\nend\n")
    bench.start(f'{kind} p():\n  powerdown()\n  textmsg("never")\nend\n')
    assert bench.now.robot_mode == RobotMode.POWER_OFF
    assert not bench.controller.programs.is_running
    assert not [event for event in bench.events if type(event).__name__ in ("TextPrinted", "ScriptFailed")]


def test_powerdown_in_motion_holds_the_arm_where_it_is():
    bench = Bench()
    bench.start(
        "def p():\n  thread t():\n    sleep(0.4)\n    powerdown()\n  end\n  run t()\n"
        "  q = get_actual_joint_positions()\n  movej([q[0] + 1, q[1], q[2], q[3], q[4], q[5]])\nend\n"
    )
    start = bench.now.actual_q[0]
    bench.tick(100)
    assert bench.now.robot_mode == RobotMode.POWER_OFF
    assert start < bench.now.actual_q[0] < start + 0.5
    assert bench.tick(10).actual_q[0] == pytest.approx(bench.snapshots[-20].actual_q[0], abs=1e-4)


def test_settings_are_kept():
    bench = Bench()
    bench.start(
        "def p():\n  pause_on_error_code(153)\n  pause_on_error_code(204, 3)\n  set_safety_mode_transition_hardness(1)\n"
        "  reset_revolution_counter([0, 0, 0, 0, 0, 1])\n  while True:\n    sync()\n  end\nend\n"
    )
    settings = bench.controller.state.error_settings
    assert settings.pause_codes == {(153, None), (204, 3)}
    assert settings.transition_hardness == 1
    assert settings.revolution_reference == (0, 0, 0, 0, 0, 1)
    bench.start("def q():\n  reset_revolution_counter()\nend\n")
    assert settings.pause_codes == set()
    assert settings.revolution_reference == bench.snapshots[-2].actual_q


def test_a_deviation_is_reported_once_until_it_is_over():
    settings = ErrorSettings(warns_of_deviation=True, deviation_threshold=0.5)
    small, large = (0.0,) * 6, (0.0, 0.0, -0.6 * MAX_POSITION_DEVIATION, 0.0, 0.0, 0.0)
    reports = [settings.deviation_warning(error) for error in (small, large, large, small, large)]
    assert [report is not None for report in reports] == [False, True, False, False, True]
    assert reports[1].argument == 2


def test_a_script_switches_the_warning_on_and_off():
    bench = Bench()
    start = (
        "def p():\n  position_deviation_warning({})\n  q = get_actual_joint_positions()\n"
        "  movej([q[0] + 0.3, q[1], q[2], q[3], q[4], q[5]])\nend\n"
    )
    bench.run(start.format("True, 0.0001"))
    found = [event for event in bench.events if getattr(event, "code", None) == 174]
    assert found
    bench.run(start.format("False"))
    assert found == [event for event in bench.events if getattr(event, "code", None) == 174]
