"""What a wrong or hostile PC can send to the velocity receiver.

Whatever comes: no target beyond the limits of the joints, and in the end the arm rests and takes the next program.
"""

import math
import struct

import numpy as np
import pytest
from integration_support import HELLO_PROGRAM, PERIOD, Messages, VelocitySession, is_closed, send

import ur_emulator.host.pacing as pacing
from pc_client.driver.watchdog import REST_SPEED
from protocol.primary.messages import ErrorCodeMessage, KeyMessage, SafetyModeMessage, TextMessage
from protocol.ur_types import ProgramState, SafetyMode
from ur_emulator.machine.models.robots import robot_by_name

UR3 = robot_by_name("ur3")
INT_MIN, INT_MAX = -(2**31), 2**31 - 1
LONGEST_TO_REST = 0.3  # s of robot time after the last command
RAMP_ROUNDING = 1e-3  # rad; the last cycle of a ramp is a whole one


class Judge:
    """Reads every frame and holds the limits against it."""

    def __init__(self, frames):
        self.frames = frames
        self.before = None

    def check(self, frame):
        for values in (frame.target_q, frame.target_qd, frame.target_qdd, frame.actual_q, frame.actual_qd):
            assert np.isfinite(values).all()
        assert (np.abs(frame.target_qd) <= np.array(UR3.qd_safety) * (1 + 1e-6)).all()
        assert (frame.target_q >= np.array(UR3.q_min) - RAMP_ROUNDING).all()
        assert (frame.target_q <= np.array(UR3.q_max) + RAMP_ROUNDING).all()
        if self.before is not None and frame.timestamp > self.before.timestamp:
            assert np.abs(frame.target_q - self.before.target_q).max() <= max(UR3.qd_safety) * 0.008 * (
                1 + 1e-6
            )
        self.before = frame

    def until(self, condition):
        def seen(frame):
            self.check(frame)
            return condition(frame)

        return self.frames.until(seen)

    def until_rest(self):
        return self.until(lambda f: f.runtime_state == ProgramState.STOPPED and not f.target_qd.any())


def next_program_works(box, frames):
    with Messages(box) as primary:
        primary.next()
        send(box, "secondary", HELLO_PROGRAM)
        frames.until_stamp(primary.message(TextMessage, text="hello").timestamp * 1e-6)
        send(box, "secondary", "def m():\n  movej([0.3,-1.6,-1.8,0,1.2,1.5])\nend\n")
        frames.until(lambda f: f.runtime_state == ProgramState.PLAYING)
        assert frames.rest().target_q == pytest.approx([0.3, -1.6, -1.8, 0, 1.2, 1.5])


@pytest.mark.parametrize("values", [(INT_MIN, INT_MAX) * 3, (3_400_000, 0, 0, 0, 0, 0)])
def test_velocities_beyond_the_limits_end_in_a_protective_stop(lockstep_box, values):
    with Messages(lockstep_box) as primary, VelocitySession(lockstep_box, acceleration=40.0) as session:
        judge = Judge(session.frames)
        stopped = False
        while not stopped:
            session.send(1, values)
            frame = session.frames.new()
            judge.check(frame)
            stopped = frame.safety_mode == SafetyMode.PROTECTIVE_STOP
        rest = judge.until_rest()
        assert rest.safety_mode == SafetyMode.PROTECTIVE_STOP
        told = primary.message(ErrorCodeMessage)
        assert told.code == 204
        assert "rad/s, limit" in told.text
        assert primary.message(SafetyModeMessage).safety_mode == SafetyMode.PROTECTIVE_STOP
        primary.message(KeyMessage, title="PROGRAM_XXX_STOPPED", text="velocity_receiver")
        assert is_closed(session.reverse)
        send(lockstep_box, "secondary", "set unlock protective stop\n")
        judge.until(lambda f: f.safety_mode == SafetyMode.NORMAL)
        next_program_works(lockstep_box, session.frames)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_joint_that_is_driven_to_the_end_of_its_range_stops_within_it(lockstep_box, sign):
    with VelocitySession(lockstep_box) as session:
        judge = Judge(session.frames)
        frame = session.frames.next()
        while frame.safety_mode == SafetyMode.NORMAL:
            frame = session.velocity(sign * 3.0, sign * -0.4)
            judge.check(frame)
        rest = judge.until_rest()
        assert abs(rest.target_q[0]) == pytest.approx(math.radians(363.0), abs=0.05)
        send(lockstep_box, "secondary", "set unlock protective stop\n")
        judge.until(lambda f: f.safety_mode == SafetyMode.NORMAL)
        next_program_works(lockstep_box, session.frames)


HALF = struct.pack(">7i", 1, *(INT_MAX,) * 6)[:27]
BURST = b"".join(struct.pack(">7i", 1, sign * 2_000_000, 0, 0, 0, 0, 0) for sign in (1, -1) * 500)


@pytest.mark.parametrize(
    ("data", "closes", "said"),
    [
        (struct.pack(">7i", INT_MIN, *(INT_MAX,) * 6), False, "unknown mode"),
        (HALF, False, "no message from the client"),
        (HALF, True, "no message from the client"),
        (BURST + bytes(28), False, "stopped by the client"),
    ],
    ids=["unknown mode", "half a message", "half a message and the end", "a thousand at once"],
)
def test_what_ends_the_program_ramps_the_arm_to_rest(lockstep_box, monkeypatch, data, closes, said):
    monkeypatch.setattr(pacing, "HANG_LIMIT", 0.1)  # s, instead of a minute
    with Messages(lockstep_box) as primary, VelocitySession(lockstep_box, read_timeout=0.2) as session:
        last = session.spin_up().timestamp
        session.reverse.sendall(data)
        if closes:
            session.reverse.close()
        judge = Judge(session.frames)
        at_rest = judge.until(lambda f: not f.target_qd.any() and abs(f.actual_qd).max() < REST_SPEED)
        assert 4 * PERIOD < at_rest.timestamp - last <= LONGEST_TO_REST
        assert judge.until_rest().safety_mode == SafetyMode.NORMAL
        assert primary.message(TextMessage).text == f"velocity_receiver: {said}"
        assert closes or is_closed(session.reverse)
        next_program_works(lockstep_box, session.frames)


def test_random_messages_never_break_the_limits(lockstep_box):
    random = np.random.default_rng(3)
    for _ in range(4):
        with VelocitySession(lockstep_box) as session:
            judge = Judge(session.frames)
            frame = session.frames.next()
            scale = 10.0 ** random.uniform(4, 9.3)
            while frame.safety_mode == SafetyMode.NORMAL and len(session.frames.stamps) < 60:
                session.send(1, random.uniform(-scale, scale, 6).astype(int).tolist())
                frame = session.frames.new()
                judge.check(frame)
            session.reverse.close()
            judge.until_rest()
            send(lockstep_box, "secondary", "set unlock protective stop\n")
            judge.until(lambda f: f.safety_mode == SafetyMode.NORMAL)
