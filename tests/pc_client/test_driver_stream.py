"""The control loop on a robot in memory: one command a frame, heartbeats, late and lost frames, failures."""

from __future__ import annotations

import math

import numpy as np
import pytest
from control_loop import Ramp, recipe
from fake_robot import PERIOD, FakeRobot

from pc_client.control.controller import CONTROLLERS
from pc_client.control.reference import ReferenceTable
from pc_client.control.tracker import Tracker, TrackerStep
from pc_client.driver.session import UrDriver
from pc_client.driver.velocity_stream import check_command
from pc_client.errors import ClientError, DriverError, RobotStoppedError
from pc_client.kinematics.model import robot_model
from pc_client.recording.rows import Phase
from protocol.primary.messages import RuntimeExceptionMessage, TextMessage
from protocol.velocity_stream import VelocityMode

UR3 = robot_model("ur3")
QD_MAX = (3.14, 3.14, 3.14, 6.28, 6.28, 6.28)
CONFIG = CONTROLLERS["preview"]


def tracker(duration=0.4, qd=0.1):
    return Tracker(ReferenceTable(Ramp([qd] * 6, duration), recipe(3 * PERIOD)), CONFIG, UR3)


class Rows(list):
    def __call__(self, frame, step):
        self.append((frame.timestamp, step))


def stream(robot, run=None, rows=None):
    rows = Rows() if rows is None else rows
    with UrDriver("robot", network=robot) as driver:
        report = driver.stream(run or tracker(), rows, acceleration=40.0)
    return report, rows


def velocities(robot):
    return [c for c in robot.received if c.mode is VelocityMode.VELOCITY]


@pytest.mark.parametrize("lockstep", [True, False])
def test_one_command_for_every_new_stamp_and_a_stop_word_at_the_end(lockstep):
    robot = FakeRobot(lockstep=lockstep)
    report, rows = stream(robot)
    stamps = np.array([stamp for stamp, _ in rows])
    np.testing.assert_allclose(np.diff(stamps), PERIOD)
    assert len(velocities(robot)) == len(rows) == report.n_commands
    assert robot.received[-1].mode is VelocityMode.STOP_PROGRAM
    assert report.late_frames == report.lost_frames == 0
    assert [step.phase for _, step in rows].count(Phase.MOVEMENT) == 51
    assert report.robot_time == pytest.approx(0.904)
    assert robot.at_rest
    assert robot.q[0] == pytest.approx(0.04, abs=1e-3)
    assert robot.listener.closed
    assert set(robot.closed) >= {"reverse", "primary", "secondary", "realtime"}


def test_in_lockstep_the_first_command_answers_the_frame_at_which_time_stands_still():
    robot = FakeRobot()
    hello_at = {}

    def note(r):
        if r.program == "receiver":
            hello_at.setdefault("tick", r.tick)

    robot.on_tick = note
    _, rows = stream(robot)
    assert rows[0][0] == pytest.approx((hello_at["tick"] - 1) * PERIOD)


def test_heartbeats_are_neither_answered_nor_logged():
    robot = FakeRobot()
    original = robot.live
    robot.live = lambda: (robot.pipes["realtime"].incoming.append(robot.frame()), original())
    report, rows = stream(robot)
    stamps = [stamp for stamp, _ in rows]
    assert len(set(stamps)) == len(stamps) == len(velocities(robot))
    assert report.lost_frames == 0


def test_a_robot_that_repeats_a_frame_now_and_then_is_followed():
    def repeat(robot):
        robot.pipes["realtime"].incoming.append(robot.frame())

    report, rows = stream(FakeRobot(lockstep=False, on_tick=spoil_at(1050, repeat)))
    assert report.n_commands == len(rows)
    assert report.lost_frames == 0


def spoil_at(tick, action):
    def on_tick(robot):
        if robot.tick == tick:
            action(robot)

    return on_tick


def set_to(**values):
    """What a robot becomes: its attributes."""

    def action(robot):
        for name, value in values.items():
            setattr(robot, name, value)

    return action


def test_waiting_frames_are_logged_and_the_newest_is_answered():
    robot = FakeRobot(lockstep=False, on_tick=spoil_at(1050, set_to(hold=3)))
    report, rows = stream(robot)
    assert report.late_frames == 3
    assert report.lost_frames == 0
    assert len(velocities(robot)) == len(rows) - 3
    held = [step for stamp, step in rows if 1050 <= round(stamp / PERIOD) < 1053]
    before = next(step for stamp, step in rows if round(stamp / PERIOD) == 1049)
    # the rows of late frames carry the command that was in force, and their own reference
    assert all(step.qd_cmd == before.qd_cmd for step in held)
    assert len({step.point.q for step in held}) == 3


def test_missing_stamps_are_counted():
    report, rows = stream(FakeRobot(lockstep=False, on_tick=spoil_at(1050, set_to(skip=4))))
    assert report.lost_frames == 4
    assert np.diff([stamp for stamp, _ in rows]).max() == pytest.approx(5 * PERIOD)


def closes(*kinds):
    """Sockets that the robot closes; all if none is named."""

    def action(robot):
        for pipe in (*robot.pipes.values(), robot.reverse):
            pipe.broken |= not kinds or pipe.kind in kinds

    return action


protective_stop, program_ends, robot_gone = set_to(safety_mode=3), set_to(program=None), set_to(silent=True)
long_freeze = set_to(hold=70)  # the frames are there all at once when the client wakes up


def time_runs_back(robot):
    robot.on_tick = None
    robot.tick -= 20


@pytest.mark.parametrize(
    ("action", "error", "words"),
    [
        (protective_stop, RobotStoppedError, "PROTECTIVE_STOP"),
        (set_to(safety_mode=7, robot_mode=3), RobotStoppedError, "emergency stop"),
        (program_ends, RobotStoppedError, "ended before the movement"),
        (FakeRobot.report_error, RobotStoppedError, "C153A2"),
        (robot_gone, DriverError, "no new realtime frame"),
        (closes("realtime"), DriverError, "closed the realtime"),
        (closes("secondary"), DriverError, "closed the secondary"),
        (closes(), DriverError, "closed the"),
        (closes("reverse"), DriverError, "closed the connection"),
        (set_to(skip=70), DriverError, r"no command for 0\.57 s, allowed is 0\.5 s"),
        (long_freeze, DriverError, r"no command for 0\.57 s, allowed is 0\.5 s"),
        (time_runs_back, DriverError, "jump back"),
    ],
)
def test_what_goes_wrong_ends_the_run_with_one_line_and_a_stopped_arm(action, error, words):
    robot = FakeRobot(lockstep=False, on_tick=spoil_at(1040, action))
    with pytest.raises(error, match=words) as caught:
        stream(robot)
    assert "\n" not in str(caught.value)
    if action is robot_gone:
        # nothing more can be seen; both ways to stop were tried, and the user is told
        assert robot.programs[-1].startswith("def ur_client_stop")
        assert "EMERGENCY STOP" in caught.value.__notes__[0]
    else:
        assert robot.at_rest
        assert not getattr(caught.value, "__notes__", [])
    assert robot.listener.closed
    assert "reverse" in robot.closed


def held_up(every, cycles):
    """Each so many ticks the frames of so many cycles come together: the client had no time."""

    def on_tick(robot):
        if robot.program == "receiver" and robot.tick % every == 0:
            robot.hold = cycles

    return on_tick


@pytest.mark.parametrize(("cycles", "stops"), [(0, 0), (2, 0), (3, 1), (40, 1)])
def test_a_silence_in_which_the_robots_program_begins_to_stop_the_arm_is_counted(cycles, stops):
    report, _ = stream(FakeRobot(lockstep=False, on_tick=spoil_at(1040, set_to(hold=cycles))))
    assert report.late_frames == cycles
    assert len(report.stops) == stops
    assert bool(report.trouble) == (cycles > 5 or stops > 0)
    assert (f"went on {stops} times; beside" in report.trouble) == bool(report.trouble)


def test_an_arm_that_stops_and_goes_all_the_time_is_stopped():
    robot = FakeRobot(lockstep=False, on_tick=held_up(10, 4))
    with pytest.raises(
        DriverError, match=r"stopped and went on 10 times; .*: give this computer less to do"
    ) as caught:
        stream(robot, tracker(duration=4.0))
    assert "\n" not in str(caught.value)
    assert robot.at_rest
    report, _ = stream(FakeRobot(lockstep=False, on_tick=held_up(100, 4)), tracker(duration=9.0, qd=0.01))
    assert len(report.stops) > 10  # but seldom


def test_the_time_for_a_command_is_measured_and_a_law_that_hangs_is_named():
    def slow(robot, seconds):
        def work(step):
            robot.clock += seconds
            robot.hold = round(seconds / PERIOD) - 1
            return step

        return work

    robot = FakeRobot(lockstep=False)
    report, _ = stream(robot, Spoilt(slow(robot, 0.024)))
    assert report.slowest_command == report.computing_time == pytest.approx(0.024)
    robot = FakeRobot(lockstep=False)
    with pytest.raises(
        DriverError, match=r"no command for .* law took 0\.60 s to compute one, or this computer"
    ):
        stream(robot, Spoilt(slow(robot, 0.6)))
    assert robot.at_rest
    robot = FakeRobot(lockstep=False)
    always = Spoilt(None, after=math.inf)
    always.answer = lambda frame: slow(robot, 0.04)(always.inner.answer(frame))
    with pytest.raises(DriverError, match=r"10 times; .* took 40\.0 ms to compute, .*: make the law faster"):
        stream(robot, always)
    assert robot.at_rest


def test_the_frames_of_a_freeze_are_recorded_before_the_run_ends():
    rows = Rows()
    with pytest.raises(DriverError, match="no command for"):
        stream(FakeRobot(lockstep=False, on_tick=spoil_at(1040, long_freeze)), rows=rows)
    stamps = [round(stamp / PERIOD) for stamp, _ in rows]
    assert stamps == list(range(stamps[0], 1040 + 70))


def test_a_client_that_wakes_up_to_a_closed_connection_says_how_long_it_was_silent():
    robot = FakeRobot(lockstep=False)
    take = robot.took

    def freeze_before_sending(pipe, data):
        if pipe.kind == "reverse" and robot.tick == 1040:
            robot.hold = 70
            robot.live()
            robot.program, pipe.broken = None, True
            raise DriverError("the other end closed the connection")
        take(pipe, data)

    robot.took = freeze_before_sending
    with pytest.raises(DriverError, match=r"no command for 0\.57 s"):
        stream(robot)
    assert robot.at_rest


LONGEST_UNSEEN = 40
"""Cycles until a moved slider has ended a run: a state is due every 13, and looked at every 16."""


@pytest.mark.parametrize("lockstep", [False, True])
@pytest.mark.parametrize("slider", [0.3, 0.5, 0.95])
def test_a_slider_that_is_moved_in_a_run_ends_it(lockstep, slider):
    robot = FakeRobot(lockstep=lockstep, on_tick=spoil_at(1040, set_to(slider=slider)))
    rows = Rows()
    with pytest.raises(DriverError, match=f"speed slider is {slider:.0%}".replace("%", " %, must be 100 %;")):
        stream(robot, rows=rows)
    assert 0 < round(rows[-1][0] / PERIOD) - 1040 <= LONGEST_UNSEEN
    assert robot.at_rest


@pytest.mark.parametrize("lockstep", [False, True])
def test_a_controller_that_slows_the_arm_down_ends_the_run_in_the_next_cycle(lockstep):
    robot = FakeRobot(lockstep=lockstep, on_tick=spoil_at(1040, set_to(scaling=0.8)))
    rows = Rows()
    with pytest.raises(DriverError, match="speed scaling is 80 %, must be 100 %; end reduced mode"):
        stream(robot, rows=rows)
    assert round(rows[-1][0] / PERIOD) == 1039
    assert robot.at_rest


@pytest.mark.parametrize("spoilt", [{"slider": 0.95}, {"robot_mode": 5}])
def test_no_stream_begins_on_a_robot_that_has_changed_since_the_last_one(spoilt):
    robot = FakeRobot(lockstep=False)
    with UrDriver("robot", network=robot) as driver:
        driver.stream(tracker(), Rows(), acceleration=40.0)
        sent = len(robot.programs)
        for name, value in spoilt.items():
            setattr(robot, name, value)
        robot.pipes["primary"].incoming.append(robot.robot_state())
        with pytest.raises(DriverError, match="must be"):
            driver.stream(tracker(), Rows(), acceleration=40.0)
    assert len(robot.programs) == sent


@pytest.mark.parametrize("lockstep", [False, True])
def test_a_program_that_a_protective_stop_has_paused_is_not_left_behind(lockstep):
    robot = FakeRobot(lockstep=lockstep, on_tick=spoil_at(1040, protective_stop))
    robot.pauses = True
    with pytest.raises(RobotStoppedError, match="PROTECTIVE_STOP") as caught:
        stream(robot)
    assert "\n" not in str(caught.value)
    assert not getattr(caught.value, "__notes__", [])
    assert robot.program is None


class Spoilt:
    """A tracker whose answer goes wrong after some steps."""

    qd_max = QD_MAX

    def __init__(self, act, after=60):
        self.inner, self.act, self.left = tracker(), act, after
        self.check_report, self.observe = self.inner.check_report, self.inner.observe

    def answer(self, frame):
        self.left -= 1
        step = self.inner.answer(frame)
        return self.act(step) if self.left == 0 else step


def with_command(value):
    def act(step):
        return TrackerStep(step.t, step.phase, step.point, [0.0, value, 0.0, 0.0, 0.0, 0.0], False)

    return act


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 3.2, -50.0])
def test_a_command_that_is_not_safe_is_never_sent(value):
    robot = FakeRobot()
    with pytest.raises(DriverError, match="not safe to send"):
        stream(robot, Spoilt(with_command(value)))
    assert all(abs(v) <= 3.14 for c in robot.received for v in c.qd)
    assert robot.received[-1].mode is VelocityMode.STOP_PROGRAM
    assert robot.at_rest


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError, MemoryError])
@pytest.mark.parametrize("lockstep", [True, False])
def test_any_exception_leaves_the_arm_stopped(error, lockstep):
    def fail(step):
        raise error

    robot = FakeRobot(lockstep=lockstep)
    with pytest.raises(error):
        stream(robot, Spoilt(fail))
    assert robot.received[-1].mode is VelocityMode.STOP_PROGRAM
    assert robot.at_rest
    assert any(robot.received[-2].qd)


def test_when_the_stop_word_does_not_help_a_stop_program_is_sent():
    def fail(step):
        raise RuntimeError("spoilt")

    robot = FakeRobot(lockstep=False)
    robot.deaf_to_stop = True
    with pytest.raises(RuntimeError, match="spoilt"):
        stream(robot, Spoilt(fail))
    assert robot.programs[-1] == "def ur_client_stop():\n  stopj(20.0)\nend\n"
    assert robot.at_rest


@pytest.mark.parametrize(
    "error", [TimeoutError, OSError(9, "bad"), ValueError("closed"), DriverError("gone")]
)
def test_whatever_a_socket_raises_the_other_way_to_stop_is_tried_and_a_person_is_told(error):
    """First only the way back fails; then the second way as well."""
    for fails, n_notes in ((("reverse",), 0), (("reverse", "secondary"), 1)):
        robot = FakeRobot(lockstep=False)
        take = robot.took

        def took(pipe, data, robot=robot, take=take, fails=fails):
            if robot.tick >= 1040 and pipe.kind in fails:
                raise error
            take(pipe, data)

        robot.took = took
        with UrDriver("robot", network=robot) as driver:
            with pytest.raises(type(error) if isinstance(error, Exception) else error) as caught:
                driver.stream(tracker(), Rows(), acceleration=40.0)
            if n_notes:  # it may still move, whatever the robot says
                with pytest.raises(DriverError, match=r"seen to come to rest, it cannot start a motion"):
                    driver.stream(tracker(), Rows(), acceleration=40.0)
        notes = getattr(caught.value, "__notes__", [])
        assert len(notes) == n_notes
        assert all("PRESS THE EMERGENCY STOP" in note for note in notes)
        assert robot.at_rest == (not n_notes)


def test_a_row_sink_that_fails_ends_the_run():
    def sink(frame, step):
        if step.t > 0.1:
            raise ClientError("disk full")

    robot = FakeRobot()
    with pytest.raises(ClientError, match="disk full"):
        stream(robot, rows=sink)
    assert robot.at_rest


def test_a_safety_stop_that_comes_with_another_error_is_named_before_it():
    robot = FakeRobot()

    def sink(frame, step):
        if step.t > 0.1:
            robot.safety_mode = 3
            raise DriverError("the tool is off its path")

    with pytest.raises(RobotStoppedError, match=r"PROTECTIVE_STOP.*; before that: the tool is off its path"):
        stream(robot, rows=sink)
    assert robot.at_rest


def test_time_that_stands_still_for_ever_is_an_error():
    robot = FakeRobot()
    take = robot.took

    def lose_commands(pipe, data):
        if pipe.kind != "reverse" or robot.tick < 1030:
            take(pipe, data)

    robot.took = lose_commands
    with pytest.raises(DriverError, match="stood still"):
        stream(robot)
    assert robot.programs[-1].startswith("def ur_client_stop")
    assert robot.at_rest


HALF_A_MINUTE = 30.0


def commands_of(robot):
    stream(robot)
    return [(command.mode, command.qd) for command in robot.received]


def box_is_stopped(robot):
    """No frame comes for half a minute."""
    robot.silent_until = robot.clock + HALF_A_MINUTE


def box_waits_for_another_client(robot):
    """Frames repeat for half a minute."""
    robot.still_until = robot.clock + HALF_A_MINUTE


def client_is_stopped(robot):
    """The clock of the client has jumped when it goes on."""
    robot.clock += 3600.0


def spoilt_lives(robot, action, tick):
    """Let the robot live on as `action` has it, which happens once, before the cycle `tick`."""
    live = robot.live
    robot.silent_until = robot.still_until = -1.0
    pending = [action]

    def spoilt():
        if robot.tick == tick and pending:
            pending.pop()(robot)
        if robot.clock < robot.silent_until:
            return
        if robot.clock < robot.still_until:
            robot.clock += PERIOD
            robot.pipes["realtime"].incoming.append(robot.frame())
            return
        live()

    robot.live = spoilt
    return robot


@pytest.mark.parametrize("tick", [1001, 1040, 1110, 1115])
@pytest.mark.parametrize("action", [box_is_stopped, box_waits_for_another_client, client_is_stopped])
def test_where_time_waits_half_a_minute_changes_nothing(action, tick):
    assert commands_of(spoilt_lives(FakeRobot(), action, tick)) == commands_of(FakeRobot())


@pytest.mark.parametrize("tick", [1001, 1040, 1115])
@pytest.mark.parametrize("action", [box_is_stopped, box_waits_for_another_client])
def test_a_robot_whose_time_runs_by_itself_is_gone_after_a_second_without_a_new_frame(action, tick):
    robot = spoilt_lives(FakeRobot(lockstep=False), action, tick)
    with pytest.raises(DriverError, match="no new realtime frame for 1 s"):
        stream(robot)


@pytest.mark.parametrize(
    ("said", "words"),
    [
        (
            "velocity_receiver: no message from the client",
            'last message is "velocity_receiver: no message from the client"',
        ),
        (None, "the pendant or another client stopped it"),
    ],
)
def test_a_program_that_ends_early_is_quoted(said, words):
    def end(robot):
        if said:
            robot.report(TextMessage(text=said))
        program_ends(robot)

    robot = FakeRobot(lockstep=False, on_tick=spoil_at(1040, end))
    with pytest.raises(RobotStoppedError, match=f"is STOPPED: it ended before the movement did; .*{words}"):
        stream(robot)


def test_an_error_of_the_program_is_reported_instead_of_its_end():
    def fail(robot):
        robot.report(RuntimeExceptionMessage(line=2, column=3, text="out_of_cheese"))
        program_ends(robot)

    with pytest.raises(RobotStoppedError, match="failed in line 2, column 3: out_of_cheese"):
        stream(FakeRobot(lockstep=False, on_tick=spoil_at(1041, fail)))


def test_check_command_accepts_the_limits_themselves():
    check_command([3.14, -3.14, 0.0, 6.28, -6.28, 0.0], QD_MAX)
    with pytest.raises(DriverError, match="allowed is"):
        check_command([3.141, 0, 0, 0, 0, 0], QD_MAX)


def rising(robot, n_cycles):
    """The speed scaling reaches 1 so many cycles after a program has started."""
    if robot.program is None:
        robot.scaling, robot.n_slow = 0.0, 0
    elif robot.n_slow < n_cycles:
        robot.n_slow += 1
        robot.scaling = robot.n_slow / n_cycles


def test_a_controller_that_raises_its_speed_at_the_start_gets_no_velocity_before_it_is_at_full_speed():
    robot = FakeRobot(lockstep=False, on_tick=lambda r: rising(r, 40))
    robot.scaling, robot.n_slow = 0.0, 0
    report, rows = stream(robot)
    modes = [command.mode for command in robot.received]
    n_held = modes.count(VelocityMode.HOLD)
    assert 30 <= n_held <= 40
    assert modes[:n_held] == [VelocityMode.HOLD] * n_held
    assert len(velocities(robot)) == len(rows) == report.n_commands


def test_a_controller_that_stays_slow_is_refused_before_the_arm_moves():
    robot = FakeRobot(lockstep=False, on_tick=lambda r: rising(r, 400))
    robot.scaling, robot.n_slow = 0.0, 0
    with pytest.raises(DriverError, match=r"speed scaling is 3\S+ %, must be 100 %"):
        stream(robot)
    assert not velocities(robot)
    assert robot.at_rest
