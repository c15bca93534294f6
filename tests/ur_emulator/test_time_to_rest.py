"""The client's program on every arm: from the last command at the fastest allowed speed to rest in 0.3 s.

Counted in ticks: nothing here has a clock.
"""

from itertools import pairwise

import pytest
from box_support import Bench

from pc_client.driver.receiver import MISSED_ALLOWED, STOP_DECELERATION, receiver_script
from pc_client.driver.watchdog import REST_SPEED
from pc_client.kinematics.arms import ROBOTS
from protocol.ur_types import ProgramState, SafetyMode
from protocol.velocity_stream import VelocityMode, encode_velocity
from ur_emulator.commands.programs import ResumeProgram, SetSpeedSlider
from ur_emulator.commands.safety import TriggerProtectiveStop, UnlockProtectiveStop
from ur_emulator.models.robots import ROBOTS as BOXES

PERIOD = 0.008  # s, of a CB3
MISSED_CYCLES = round(MISSED_ALLOWED / PERIOD)
ALLOWED = 0.3  # s
WAITS_FOR_THE_READ = 1  # tick; a message may come right after the read of a cycle
SPEED_UP, STEADY = 0.56, 0.08  # s
WATCHED = 0.96  # s

# Away from the joint's end of the way; for the large joints with the arm stretched, which is hardest to stop.
START = {
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
        generation = BOXES[robot].generation
        super().__init__(robot=robot, generation=generation, **options)
        self.period = generation.period_s
        self.run(f"def m():\n  movej({START[joint]})\nend\n")
        self.start(program(acceleration, self.period), loaded=loaded)
        self.tick(3)
        (self.client,) = self.network.sockets
        fastest = ROBOTS[robot].limits.qd_max[joint]
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


def program(acceleration, period=PERIOD):
    return receiver_script("10.0.0.1", 50123, acceleration=acceleration, period=period)


def falls_silent(arm):
    pass


def closes(arm):
    arm.client.is_open = False


def sends_half_a_message(arm):
    arm.client.inbox += encode_velocity(VelocityMode.VELOCITY, [1.0] * 6)[:13]


# Others are the same arm twice.
ENDS = [
    (robot, end) for robot in ("ur3", "ur5", "ur10") for end in (falls_silent, closes, sends_half_a_message)
]
ENDS += [
    (robot, falls_silent)
    for robot in ("ur3e", "ur5e", "ur10e", "ur16e", "ur8long", "ur15", "ur18", "ur20", "ur30")
]


@pytest.mark.parametrize(("robot", "end"), ENDS)
@pytest.mark.parametrize("joint", range(6))
def test_from_the_fastest_speed_the_arm_is_at_rest_in_time(robot, joint, end):
    arm = Turning(robot, joint)
    end(arm)
    assert arm.time_to_rest() <= ALLOWED


def test_the_ramp_begins_after_the_cycles_that_may_be_missed_and_has_its_deceleration():
    arm = Turning("ur3", 0)
    speeds = [arm.tick().target_qd[0] for _ in range(60)]
    fastest = ROBOTS["ur3"].limits.qd_max[0]
    published = MISSED_CYCLES + 1  # a package shows the target of the cycle before
    assert speeds[:published] == pytest.approx([fastest] * published)
    drops = [before - after for before, after in pairwise(speeds[MISSED_CYCLES:])]
    ramp = [drop for drop in drops if drop > 0.0]
    assert ramp[:-1] == pytest.approx([STOP_DECELERATION * PERIOD] * (len(ramp) - 1))
    assert drops[0] == ramp[0]


def test_an_arm_that_still_speeds_up_does_not_go_on_speeding_up():
    """The paper's slow `speedj`: the last command is far above the speed that the arm has reached."""
    arm = Bench()
    arm.start(program(3.0))
    arm.tick(3)
    (client,) = arm.network.sockets
    for _ in range(20):
        client.inbox += encode_velocity(VelocityMode.VELOCITY, [2.5, 0, 0, 0, 0, 0])
        arm.tick()
    reached = arm.now.target_qd[0]
    assert reached < 0.6
    speeds = [arm.tick().target_qd[0] for _ in range(40)]
    assert max(speeds) <= reached + 3.0 * PERIOD * (MISSED_CYCLES + 1)
    assert not any(speeds[10:])


def test_a_speed_slider_that_was_moved_does_not_make_the_stop_longer():
    arm = Turning("ur3", 0)
    arm.tick(1, SetSpeedSlider(0.3))
    arm.send(VelocityMode.VELOCITY, [ROBOTS["ur3"].limits.qd_max[0], 0, 0, 0, 0, 0])
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
