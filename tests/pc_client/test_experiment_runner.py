"""A whole experiment on a robot in memory: order, files, provenance, refusal before motion, interruption.

Its approach arrives, or ends with one line and a stopped arm.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fake_robot import PERIOD, FakeRobot
from mcap.reader import make_reader
from planning_paths import prepare_experiment
from recording_samples import SIGNALS, provenance

from pc_client.analysis.signals import Run
from pc_client.control.controller import CONTROLLERS
from pc_client.control.loop import LoopModel, loop_margins
from pc_client.driver.session import UrDriver
from pc_client.errors import (
    ClientError,
    DriverError,
    GainMarginError,
    RecordingError,
    RobotStoppedError,
    full_message,
)
from pc_client.experiment.excitation import identify
from pc_client.experiment.experiment import (
    clear_folder,
    scratch_folder,
)
from pc_client.experiment.run import ExperimentRunner, run_approach
from pc_client.kinematics.clearance import Clearance
from pc_client.kinematics.model import robot_model
from pc_client.movements.movement import Movement, load_motion
from pc_client.planning.approach import Approach
from pc_client.recording.recorder import Recorder
from pc_client.recording.recording import load_recording
from pc_client.recording.rows import Phase
from protocol.velocity_stream import VelocityMode
from ur_hil.cell import Cell, Wall

POSTURE = [0.4, -1.77, -2.1, -0.1, 1.3, 1.86]


POINTS = [(0.35, -0.05, 0.25), (0.35, 0.05, 0.28)]
THERE = Movement.through(POINTS, "robot", [1.2], name="there")
BACK = Movement.through(POINTS[::-1], "human", [1.4], name="back")


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    return prepare_experiment([THERE, BACK], repeat=2, out=tmp_path_factory.mktemp("unused"))


def with_folder(experiment, out):
    return replace(experiment, out=out, overwrite=True)


def run(robot, experiment, controller="preview", posture=POSTURE):
    robot.q = list(posture)
    with UrDriver("robot", network=robot) as driver:
        return ExperimentRunner(driver, experiment, CONTROLLERS[controller]).run()


@pytest.mark.parametrize("held_up", [0, 4])
def test_an_identification_that_fails_says_how_many_commands_came_late(two, held_up):
    n_ticks = 0

    def slip(robot):
        nonlocal n_ticks
        n_ticks += robot.program == "receiver"
        if n_ticks == 20:
            robot.hold = held_up
        if n_ticks == 60:
            robot.q[0] += 0.003

    robot = FakeRobot(lockstep=False, on_tick=slip)
    robot.q = list(POSTURE)
    with UrDriver("robot", network=robot) as driver, pytest.raises(DriverError) as refused:
        identify(driver, CONTROLLERS["preview"], two.model)
    assert (
        ("4 of" in full_message(refused.value))
        is ("commands came late" in full_message(refused.value))
        is bool(held_up)
    )


def test_an_excitation_too_near_to_a_wall_is_refused_before_anything_moves(tmp_path):
    """The movement begins 20.2 mm from the wall, 20 mm are asked: the pulses would lead 0.6 mm nearer."""
    cell = Cell("c", walls=(Wall("window", (0.0, 1.0, 0.0), -0.2059),))
    one = prepare_experiment([load_motion("uniform_4_1")], repeat=1, out=tmp_path / "new", cell=cell)
    robot = FakeRobot()
    with pytest.raises(DriverError, match=r"cannot be identified .* of wall 'window', at least 20 mm"):
        run(robot, one)
    assert robot.programs == []
    assert not one.out.exists()


@pytest.mark.parametrize("receiver_ticks", [{1}, {2}, {60}, {150, 151}])
def test_a_robot_in_real_time_that_repeats_frames_is_not_in_lockstep(tmp_path, receiver_ticks):
    """Also where the repeated frame is the first that comes after a program's hello: of one stream of several."""
    n_ticks, n_streams = 0, 0

    def repeat(robot):
        nonlocal n_ticks, n_streams
        n_streams += robot.program == "receiver" and n_ticks == 0
        n_ticks = n_ticks + 1 if robot.program == "receiver" else 0
        if n_streams >= 2 and n_ticks in receiver_ticks:
            robot.pipes["realtime"].incoming.append(robot.frame())

    one = prepare_experiment([THERE], repeat=1, out=tmp_path)
    report = run(FakeRobot(lockstep=False, delay=4, on_tick=repeat), one)
    assert n_streams == 3  # approach, identification, run
    assert load_recording(report.paths[0]).provenance.pace == "realtime"


@pytest.mark.parametrize("lockstep", [False, True])
def test_log_times_are_absolute_in_real_time_only(tmp_path, monkeypatch, lockstep):
    """In lockstep they are the controller's, so that equal runs give equal bytes."""
    now = 1_700_000_000_000_000_000
    monkeypatch.setattr("pc_client.experiment.run.time.time_ns", lambda: now)
    one = prepare_experiment([THERE], repeat=1, out=tmp_path)
    path = run(FakeRobot(lockstep=lockstep, delay=4), one).paths[0]
    with path.open("rb") as stream:
        first = next(message.log_time for _, _, message in make_reader(stream).iter_messages("/robot_state"))
    assert first == (round(load_recording(path).t[0] * 1e9) if lockstep else now)


def test_what_came_late_stands_on_the_run(two, tmp_path, caplog):
    one = replace(two, planned=two.planned[:1], repeat=2)

    def hold_up(robot):
        if sum("velocity_receiver" in text for text in robot.programs) == 5 and robot.tick % 50 == 0:
            robot.hold = 5

    (tmp_path / "late").mkdir()
    report = run(FakeRobot(lockstep=False, on_tick=hold_up), with_folder(one, tmp_path / "late"))
    first, second = map(Run.from_file, report.paths)
    assert (first.stream.late_frames, first.stream.stops, first.warnings) == (0, [], ())
    assert second.stream.late_frames == 5 * len(second.stream.stops) > 0
    assert second.stream.n_commands == report.streams[1].n_commands
    assert second.stream.slowest_command == report.streams[1].slowest_command
    (warning,) = second.warnings
    assert caplog.messages == report.remarks == [f"there: run 2: {warning}"]
    assert f"stopped and went on {len(second.stream.stops)} times" in warning
    in_lockstep = load_recording(run(FakeRobot(), with_folder(one, tmp_path)).paths[0])
    assert in_lockstep.summary["stops"] == []
    assert "slowest_command" not in in_lockstep.summary  # equal runs give equal bytes


def test_two_movements_twice(two, tmp_path, caplog):
    caplog.set_level("DEBUG", "pc_client")
    robot = FakeRobot(delay=4)
    report = run(robot, with_folder(two, tmp_path))
    assert caplog.messages == [
        "robot: UR3, software 3.15.8, serial number 20993000007, SIMULATED",
        "there: to the start",
        str(report.delay),
        "there, run 1",
        f"{tmp_path / 'there_r1.mcap'}: recorded",
        "there: to the start",
        "there, run 2",
        f"{tmp_path / 'there_r2.mcap'}: recorded",
        "back: to the start",
        "back, run 1",
        f"{tmp_path / 'back_r1.mcap'}: recorded",
        "back: to the start",
        "back, run 2",
        f"{tmp_path / 'back_r2.mcap'}: recorded",
    ]
    assert report.delay.delay == pytest.approx(4 * PERIOD, abs=1e-3)
    assert robot.at_rest
    assert sorted(tmp_path.iterdir()) == sorted(report.paths)

    recording = load_recording(report.paths[2])
    assert recording.complete
    p = recording.provenance
    assert (p.movement, p.kind, p.repetition, p.controller) == ("back", "lognormal", 1, "preview")
    assert (p.robot_model, p.firmware, p.serial, p.simulated, p.seed) == (
        "UR3",
        "3.15.8",
        "20993000007",
        True,
        7,
    )
    assert p.pace == "lockstep"
    assert p.identified_delay_s == report.delay.delay
    assert p.controller_config["gain_p"] == CONTROLLERS["preview"].gain_p
    moving = recording.rows_of(Phase.MOVEMENT)
    duration = two.planned[1].movement.duration
    assert moving.sum() == pytest.approx(duration / PERIOD, abs=2)
    # a perfect arm with a known delay follows to a hair
    error = recording.column("ref_q")[moving] - recording.column("actual_q")[moving]
    assert abs(error).max() < 2e-3
    speed = recording.column("ref_tcp_velocity")
    assert abs(speed[recording.rows_of(Phase.SETTLE_BEFORE)]).max() == 0.0
    assert recording.summary["late_frames"] == 0


def test_accepted_recorded_and_tabled_gain_margins_are_one(two, tmp_path):
    preview = CONTROLLERS["preview"]
    edge = loop_margins(LoopModel.of_delay(4 * PERIOD, 0.0), preview.gain_p, preview.gain_i, PERIOD).gain
    experiment = replace(two, planned=two.planned[:1], repeat=1, out=tmp_path, overwrite=True)

    def at_margin(margin):
        factor = edge / margin
        own = replace(preview, gain_p=factor * preview.gain_p, gain_i=factor * preview.gain_i)
        robot = FakeRobot(delay=4)
        robot.q = list(POSTURE)
        with UrDriver("robot", network=robot) as driver:
            return ExperimentRunner(driver, experiment, own).run()

    report = at_margin(2.05)
    recorded = load_recording(report.paths[0]).provenance.loop["gain_margin"]
    assert recorded == pytest.approx(2.05, abs=0.03)
    assert recorded == report.delay.margins.gain
    with pytest.raises(GainMarginError, match=r"gain margin of 1\.9") as caught:
        at_margin(1.95)
    assert caught.value.margin == pytest.approx(1.95, abs=0.03)


def test_what_is_recorded_before_a_protective_stop_stays(two, tmp_path):
    robot, in_second_run = FakeRobot(), []

    def spoil(r):
        # approach, excitation, first run, approach, second run
        if sum("velocity_receiver" in text for text in r.programs) == 5:
            in_second_run.append(r.tick)
        if len(in_second_run) == 100:
            r.safety_mode = 3

    robot.on_tick = spoil
    with pytest.raises(RobotStoppedError, match=r"PROTECTIVE_STOP.*'unlock protective stop'") as caught:
        run(robot, with_folder(two, tmp_path))
    assert not load_recording(tmp_path / "there_r1.mcap").aborted
    path = tmp_path / "there_r2.mcap"
    assert full_message(caught.value) == f"{caught.value}; recorded until then: {path}"
    cut = load_recording(path)
    assert cut.summary == {"aborted": f"RobotStoppedError: {caught.value}"}
    assert cut.aborted == f"the run was given up ({cut.summary['aborted']})"
    given_up = Run.from_file(path)
    assert given_up.aborted == cut.aborted
    assert "the run was given up (RobotStoppedError" in repr(given_up)
    assert given_up.plot().axes
    with pytest.raises(RecordingError, match=r"the run was given up .*: it has no SNR"):
        _ = given_up.snr
    assert not (tmp_path / "back_r1.mcap").exists()


@pytest.mark.parametrize(("phase", "receiver"), [("approach", 1), ("identification", 2), ("run", 3)])
def test_in_every_phase_a_tool_off_its_path_ends_the_motion(phase, receiver, two, tmp_path):
    robot, begun = FakeRobot(), []

    def push(r):
        begun.append(
            len(r.received) if sum("velocity_receiver" in text for text in r.programs) == receiver else 0
        )
        if r.program == "receiver" and begun[-1] > min(filter(None, begun), default=0) + 40:
            r.q[2] += 0.15

    robot.on_tick = push
    with pytest.raises(DriverError, match=r"mm and .* deg off its path at t = .* s, near .* m; allowed is"):
        run(robot, with_folder(two, tmp_path))
    robot.on_tick = None
    assert sum("velocity_receiver" in text for text in robot.programs) == receiver
    assert robot.at_rest
    recordings = sorted(tmp_path.glob("*.mcap"))
    assert len(recordings) == (phase == "run")
    for path in recordings:
        assert "mm and " in load_recording(path).aborted


def test_a_protective_stop_that_follows_the_end_of_a_run_is_named_first(two, tmp_path):
    robot = FakeRobot()

    def collide(r):
        if r.program == "receiver" and len(r.received) > 400:
            r.q[2] += 0.15
        if r.received and r.received[-1].mode is VelocityMode.STOP_PROGRAM and len(r.received) > 400:
            r.safety_mode = 3

    robot.on_tick = collide
    with pytest.raises(RobotStoppedError, match=r"^the robot's safety mode is PROTECTIVE_STOP.*off its path"):
        run(robot, with_folder(two, tmp_path))


def test_a_folder_that_nobody_asked_for_is_removed(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with scratch_folder() as folder:
        (folder / "a.mcap").touch()
    with pytest.raises(ZeroDivisionError), scratch_folder():
        raise ZeroDivisionError
    assert not list(tmp_path.iterdir())


def test_an_error_keeps_and_names_recordings_that_nobody_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))

    def fail():
        with scratch_folder() as folder:
            (folder / "a.mcap").touch()
            folder.mkdir()

    with pytest.raises(FileExistsError) as caught:
        fail()
    (folder,) = tmp_path.iterdir()
    assert [path.name for path in folder.iterdir()] == ["a.mcap"]
    assert caught.value.__notes__ == [f"recorded until then: {folder}"]


def test_an_arm_that_does_not_follow_is_found_before_the_first_movement(two, tmp_path):
    robot = FakeRobot()
    robot.follow = lambda: (robot.commands and robot.commands.popleft().mode) or None
    robot.on_tick = lambda r: None
    with pytest.raises(DriverError):
        run(robot, with_folder(two, tmp_path))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("cycles", "words"), [(21, "gain margin"), (30, "200 ms or more")])
def test_too_slow_a_loop_is_refused(cycles, words, two, tmp_path):
    with pytest.raises(DriverError, match=words):
        run(FakeRobot(delay=cycles), with_folder(two, tmp_path), posture=two.planned[0].joints.start_q)


@pytest.mark.parametrize(("movements", "repeat"), [([], 1), (["uniform_4_1"], 0), (["uniform_4_1"] * 2, 1)])
def test_experiments_that_make_no_sense(movements, repeat, tmp_path):
    with pytest.raises(ClientError):
        prepare_experiment(map(load_motion, movements), repeat=repeat, out=tmp_path)


def test_two_plans_of_one_name_are_refused_in_the_experiment_itself(two):
    plan, other = two.planned
    renamed = replace(other, movement=replace(other.movement, name=plan.movement.name))
    with pytest.raises(ClientError, match=f"two plans are called '{plan.movement.name}'.*rename one"):
        replace(two, planned=(plan, renamed))


def test_folder_of_another_experiment_is_left_alone(two, tmp_path):
    experiment = with_folder(two, tmp_path)
    ours, foreign = tmp_path / "there_r2.mcap", tmp_path / "other_r1.mcap"
    ours.write_bytes(b"old")
    clear_folder(experiment)
    assert not ours.exists()
    ours.write_bytes(b"old")
    foreign.write_bytes(b"precious")
    with pytest.raises(RecordingError, match="another experiment"):
        clear_folder(experiment)
    assert ours.exists()
    assert foreign.exists()


@pytest.mark.parametrize(
    ("simulated", "words"), [(False, "measured on a real arm"), (None, "NOT KNOWN whether real or simulated")]
)
def test_only_recordings_that_are_known_to_be_simulated_are_replaced(two, tmp_path, simulated, words):
    experiment = with_folder(two, tmp_path)
    ours, kept = tmp_path / "there_r1.mcap", tmp_path / "there_r2.mcap"
    with Recorder(ours, provenance(), SIGNALS), Recorder(kept, provenance(simulated=simulated), SIGNALS):
        pass
    with pytest.raises(RecordingError, match=words):
        clear_folder(experiment)
    assert ours.exists()
    kept.unlink()
    with pytest.raises(RecordingError, match=r"there_r1\.mcap exists: .*--overwrite"):
        clear_folder(replace(experiment, overwrite=False))
    assert ours.exists()
    clear_folder(experiment)
    assert not ours.exists()


def test_folder_that_cannot_be_made(two, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match="cannot use the folder"):
        clear_folder(with_folder(two, tmp_path / "file"))


BETWEEN = np.array([0.05, -0.15, 0.0, 0.2, 0.0, 0.3])
GOAL = np.array([0.1, -0.3, -0.2, 0.2, 0.1, 0.2])
UR3 = robot_model("ur3")

SPEED = 0.5  # rad/s


def approach_to(*waypoints):
    return Approach(None, np.zeros(6), waypoints, SPEED, 0.8, Clearance(1.0, 1.0, 1.0))


def move(robot, *waypoints):
    with UrDriver("robot", network=robot) as driver:
        run_approach(driver, approach_to(*(waypoints or (BETWEEN, GOAL))), UR3)


@pytest.mark.parametrize("delay", [0, 3, 12])
@pytest.mark.parametrize("lockstep", [True, False])
def test_it_arrives_whatever_the_loop_delay(lockstep, delay):
    robot = FakeRobot(lockstep=lockstep, delay=delay)
    move(robot)
    assert robot.q == pytest.approx(GOAL, abs=5e-4)
    assert [text.splitlines()[0] for text in robot.programs] == ["def velocity_receiver():"]
    assert robot.at_rest


def test_it_follows_the_checked_lines_slowly():
    postures, robot = [], FakeRobot()
    robot.on_tick = lambda r: postures.append(list(r.q))
    move(robot)
    q = np.array(postures)
    assert np.abs(np.diff(q, axis=0)).max() <= 1.1 * SPEED * PERIOD
    lines = [np.linspace(a, b, 400) for a, b in ((np.zeros(6), BETWEEN), (BETWEEN, GOAL))]
    off = [min(np.abs(line - posture).max(axis=1).min() for line in lines) for posture in q]
    assert max(off) < 5e-3


def test_an_arm_that_is_there_already_is_not_moved():
    robot = FakeRobot()
    move(robot, np.full(6, 5e-5))
    assert robot.programs == []


def test_an_arm_that_stops_elsewhere_is_reported():
    robot = FakeRobot()
    follow = robot.follow

    def slip():
        follow()
        if robot.program is None:
            robot.q = [0.02, *robot.q[1:]]

    robot.follow = slip
    with pytest.raises(DriverError, match="is it blocked"):
        move(robot)
