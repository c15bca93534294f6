"""Stops: an arm comes to rest in time, and no harder than its drives can brake what it carries.

The client's program on every arm: from the last command at the fastest allowed speed to rest in 0.3 s.
"""

from itertools import pairwise
from math import inf

import pytest
from box_support import Bench
from e_series_support import DT, ESeriesBench, program

from pc_client.driver.receiver import MISSED_ALLOWED, STOP_DECELERATION, receiver_script
from pc_client.driver.watchdog import REST_SPEED
from pc_client.kinematics.arms import ROBOTS as CLIENT_ARMS
from protocol.ur_types import ProgramState, SafetyMode
from protocol.velocity_stream import VelocityMode, encode_velocity
from ur_emulator.machine.commands.programs import ResumeProgram, SetSpeedSlider
from ur_emulator.machine.commands.safety import TriggerProtectiveStop, UnlockProtectiveStop
from ur_emulator.machine.models.fidelity import TYPICAL
from ur_emulator.machine.models.robots import ROBOTS, robot_by_name

# Stretched; the shoulder turns down, from upright to some 40 degrees above the horizontal.
START = {0: (-1.2, -0.35, 0.0, -1.57, 0.0, 0.0), 1: (0.0, -1.57, 0.0, -1.57, 0.0, 0.0)}
ACCELERATION = 2.0  # rad/s², which the drives can give
LARGE = [
    name for name, robot in ROBOTS.items() if min(robot.tau_max[:2]) >= 330 and robot.generation.major == 5
]


def turning(robot, joint, *, payload=0.0, stop="stopj(100)", limited=True):
    """A bench whose arm turns one joint, stretched, at three quarters of its speed, and stops in this cycle."""
    speed = 0.75 * robot_by_name(robot).qd_max[joint]
    qd = [speed * (i == joint) for i in range(6)]
    bench = ESeriesBench(robot=robot)
    bench.run(
        program(f"set_payload({payload}, [0, 0, 0.05])", f"set_pos({list(START[joint])})", "sleep(0.2)")
    )
    bench.snapshots.clear()
    if not limited:
        bench.controller.state.motion.braking = lambda target: inf
    bench.start(program(f"speedj({qd}, {ACCELERATION}, {speed / ACCELERATION})", stop, "sleep(0.1)"))
    while bench.now.target_qd[joint] < 0.999 * speed:
        bench.tick()
    return bench


def greatest_deceleration(bench, joint):
    """Of the target, from the fastest speed to rest."""
    speeds = [frame.target_qd[joint] for frame in bench.snapshots]
    return max((before - after) / DT for before, after in pairwise(speeds))


def stands_still(bench):
    return not any(bench.now.target_qd) and max(map(abs, bench.now.actual_qd)) < 1e-3


@pytest.mark.parametrize(("joint", "share"), [(0, 1.0), (1, 0.0)], ids=["base, loaded", "shoulder"])
@pytest.mark.parametrize("robot", LARGE)
def test_a_large_arm_that_is_to_stop_at_once_stops_as_hard_as_it_can(robot, joint, share):
    bench = turning(robot, joint, payload=share * robot_by_name(robot).payload_max)
    bench.tick(round(0.5 / DT))
    assert {frame.safety_mode for frame in bench.snapshots} == {SafetyMode.NORMAL}
    assert stands_still(bench)
    assert 5.0 < greatest_deceleration(bench, joint) < 25.0


def test_a_stop_beyond_the_drives_would_be_a_protective_stop():
    bench = turning("ur20", 0, payload=20.0, limited=False)
    bench.tick(round(0.5 / DT))
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP


@pytest.mark.parametrize("robot", ["ur20", "ur30"])
def test_a_protective_stop_is_no_reason_for_a_second_one(robot):
    bench = turning(robot, 0, payload=robot_by_name(robot).payload_max, stop="stopj(0.1)")
    bench.tick(1, TriggerProtectiveStop())
    bench.tick(round(0.6 / DT))
    assert stands_still(bench)
    assert len(bench.errors) == 1


PERIOD = 0.008  # s, of a CB3
MISSED_CYCLES = round(MISSED_ALLOWED / PERIOD)
DEAD_CYCLES = round(TYPICAL.dead_time / PERIOD)
ALLOWED = 0.3  # s
WAITS_FOR_THE_READ = 1  # tick; a message may come right after the read of a cycle
SPEED_UP, STEADY = 0.56, 0.08  # s
WATCHED = 0.56  # s

# Away from the joint's end of the way; for the large joints with the arm stretched, which is hardest to stop.
CLEAR_OF_THE_END = {
    0: [-1.0, -0.35, 0, 0, 0, 0],
    1: [0, -2.5, 0, 0, 0, 0],
    2: [0, -1.57, -1.5, -1.57, 0, 0],
    3: [0, -1.57, 0, -1.57, 0, 0],
    4: [0, -1.57, 0, -1.57, 0, 0],
    5: [0, -1.57, 0, -1.57, 0, 0],
}


class Turning(Bench):
    """An arm that the client's program turns about one joint, at the fastest speed that the client asks for."""

    def __init__(self, robot, joint, *, acceleration=40.0, loaded=False, **options):
        generation = ROBOTS[robot].generation
        super().__init__(robot=robot, generation=generation, **options)
        self.period = generation.period_s
        self.run(f"set_pos({CLEAR_OF_THE_END[joint]})\n")
        self.start(client_program(acceleration, self.period), loaded=loaded)
        self.tick(3)
        (self.client,) = self.network.sockets
        fastest = CLIENT_ARMS[robot].limits.qd_max[joint]
        for n in range(self.ticks(SPEED_UP + STEADY)):
            qd = [0.0] * 6
            qd[joint] = fastest * min(1.0, (n + 1) / self.ticks(SPEED_UP))
            self.send(VelocityMode.VELOCITY, qd)
        assert self.now.safety_mode == SafetyMode.NORMAL
        assert self.now.target_qd[joint] == pytest.approx(fastest)
        assert self.now.actual_qd[joint] > 0.9 * fastest

    def ticks(self, seconds):
        return round(seconds / self.period)

    def send(self, mode, qd):
        self.client.inbox += encode_velocity(mode, qd)
        self.tick()

    def time_to_rest(self):
        """Seconds until the target stands still and all joints rest, for good, from the last message on."""
        moving = [
            any(frame.target_qd) or max(map(abs, frame.actual_qd)) > REST_SPEED
            for frame in (self.tick() for _ in range(self.ticks(WATCHED)))
        ]
        assert moving[0]
        assert self.now.safety_mode == SafetyMode.NORMAL
        last = max(n for n, still_moves in enumerate(moving) if still_moves)
        return (last + 1 + WAITS_FOR_THE_READ) * self.period


def client_program(acceleration, period=PERIOD):
    return receiver_script("10.0.0.1", 50123, acceleration=acceleration, period=period)


def falls_silent(arm):
    pass


def closes(arm):
    arm.client.is_open = False


def sends_half_a_message(arm):
    arm.client.inbox += encode_velocity(VelocityMode.VELOCITY, [1.0] * 6)[:13]


# Others are the same arm twice.
ARMS = ("ur3", "ur5", "ur10", "ur3e", "ur5e", "ur10e", "ur16e", "ur8long", "ur15", "ur18", "ur20", "ur30")
# The joints that are hardest to stop, and the fastest one; of an arm of each generation all. At night of every arm.
DAILY = ("ur3", "ur10", "ur5e", "ur20")
CASES = [
    *(
        pytest.param(robot, joint, falls_silent, marks=() if robot in DAILY else pytest.mark.nightly)
        for robot in ARMS
        for joint in (0, 1, 5)
    ),
    *((robot, joint, falls_silent) for robot in ("ur3", "ur5e") for joint in (2, 3, 4)),
    *((robot, 0, end) for robot in ("ur3", "ur10") for end in (closes, sends_half_a_message)),
]


@pytest.mark.parametrize(("robot", "joint", "end"), CASES)
def test_from_the_fastest_speed_the_arm_is_at_rest_in_time(robot, joint, end):
    arm = Turning(robot, joint)
    end(arm)
    assert arm.time_to_rest() <= ALLOWED


def test_the_ramp_begins_after_the_cycles_that_may_be_missed_and_has_its_deceleration():
    arm = Turning("ur3", 0)
    speeds = [arm.tick().target_qd[0] for _ in range(60)]
    fastest = CLIENT_ARMS["ur3"].limits.qd_max[0]
    # A package shows the target of the cycle before, and what moves the target is late by the dead time.
    published = MISSED_CYCLES + 1 + DEAD_CYCLES
    assert speeds[:published] == pytest.approx([fastest] * published)
    drops = [before - after for before, after in pairwise(speeds[MISSED_CYCLES + DEAD_CYCLES :])]
    ramp = [drop for drop in drops if drop > 0.0]
    assert ramp[:-1] == pytest.approx([STOP_DECELERATION * PERIOD] * (len(ramp) - 1))
    assert drops[0] == ramp[0]


def test_an_arm_that_still_speeds_up_does_not_go_on_speeding_up():
    """The paper's slow `speedj`: the last command is far above the speed that the arm has reached."""
    arm = Bench()
    arm.start(client_program(3.0))
    arm.tick(3)
    (client,) = arm.network.sockets
    for _ in range(20):
        client.inbox += encode_velocity(VelocityMode.VELOCITY, [2.5, 0, 0, 0, 0, 0])
        arm.tick()
    reached = arm.now.target_qd[0]
    assert reached < 0.6
    speeds = [arm.tick().target_qd[0] for _ in range(40)]
    assert max(speeds) <= reached + 3.0 * PERIOD * (MISSED_CYCLES + 1 + DEAD_CYCLES) + 1e-9
    assert not any(speeds[10:])


def test_a_speed_slider_that_was_moved_does_not_make_the_stop_longer():
    arm = Turning("ur3", 0)
    arm.tick(1, SetSpeedSlider(0.3))
    arm.send(VelocityMode.VELOCITY, [CLIENT_ARMS["ur3"].limits.qd_max[0], 0, 0, 0, 0, 0])
    assert arm.time_to_rest() <= ALLOWED


def test_what_is_resumed_on_the_pendant_while_the_client_is_frozen_comes_to_rest_in_time_too():
    arm = Turning("ur3", 0, loaded=True)
    arm.tick(1, TriggerProtectiveStop())
    arm.tick(800)
    assert arm.now.runtime_state == ProgramState.PAUSED
    stopped_at = arm.now.target_q[0]
    arm.tick(1, UnlockProtectiveStop())
    arm.tick(1, ResumeProgram())
    moving = [any(arm.tick().target_qd) for _ in range(120)]
    assert not any(moving[int(ALLOWED / PERIOD) :])
    assert abs(arm.now.target_q[0] - stopped_at) < 0.05
