"""A client that dies in motion: the arm ramps to rest, the program ends, the next client works."""

import signal
import struct

import pytest
from integration_support import (
    PERIOD,
    Frames,
    Messages,
    VelocitySession,
    at,
    finish,
    is_closed,
    run_in_movement,
    send,
)

from protocol.primary_messages import KeyMessage, TextMessage
from protocol.ur_types import ProgramState, SafetyMode

STOP_DECELERATION = 20.0  # rad/s^2; of the receiver's own ramp
PROGRAM_END_DECELERATION = 20.0  # rad/s^2; of a program that is stopped from outside
CLIENT_COMES_TO_REST = 0.5  # s of robot time: time-out, ramp and settling


def ramp(frames, deceleration):
    """Read until the arm rests; every cycle may lose only what the deceleration allows."""
    before = frames.next()
    while True:
        frame = frames.new()
        change = abs(frame.target_qd - before.target_qd).max()
        assert change <= deceleration * PERIOD * (1 + 1e-9)
        before = frame
        if frame.runtime_state == ProgramState.STOPPED:
            return frame


def test_a_closed_reverse_socket_ramps_the_arm_to_rest_and_ends_the_program(lockstep_box):
    with Messages(lockstep_box) as primary, VelocitySession(lockstep_box) as session:
        session.spin_up()
        session.reverse.close()
        last = ramp(session.frames, STOP_DECELERATION)
        assert not last.target_qd.any()
        assert last.safety_mode == SafetyMode.NORMAL
        said = primary.message(TextMessage).text
        assert said == "velocity_receiver: no message from the client"
        primary.message(KeyMessage, title="PROGRAM_XXX_STOPPED")
        assert session.frames.lost() == 0


def test_a_reset_reverse_socket_does_the_same(lockstep_box):
    with VelocitySession(lockstep_box) as session:
        session.spin_up()
        session.reverse.setsockopt(
            1, 13, struct.pack("ii", 1, 0)
        )  # SOL_SOCKET, SO_LINGER 0: RST instead of FIN
        session.reverse.close()
        assert not ramp(session.frames, STOP_DECELERATION).target_qd.any()


def test_in_realtime_the_arm_stops_within_a_few_cycles_of_the_last_command(realtime_box):
    with VelocitySession(realtime_box, missed_allowed=6) as session:
        session.spin_up()
        moving = session.frames.stamps[-1]
        session.reverse.close()
        rest = ramp(session.frames, STOP_DECELERATION)
        assert rest.timestamp - moving < CLIENT_COMES_TO_REST


def test_a_silent_client_is_not_waited_for_in_motion(realtime_box):
    with Messages(realtime_box) as primary, VelocitySession(realtime_box, read_timeout=0.3) as session:
        last = session.spin_up()
        still = session.frames.until(lambda f: not any(f.target_qd))
        assert still.timestamp - last.timestamp < 0.2
        assert still.runtime_state == ProgramState.PLAYING
        ended = session.frames.rest()
        assert 0.2 < ended.timestamp - last.timestamp < 1.0
        assert primary.message(TextMessage).text == "velocity_receiver: no message from the client"


def test_a_stop_word_from_another_client_stops_the_arm(lockstep_box):
    with VelocitySession(lockstep_box) as session:
        session.spin_up()
        send(lockstep_box, "secondary", "stop program\n")
        assert not ramp(session.frames, PROGRAM_END_DECELERATION).target_qd.any()
        assert is_closed(session.reverse)


@pytest.mark.parametrize("port", ["primary", "secondary", "realtime"])
def test_a_program_outlives_the_connection_that_sent_it(lockstep_box, port):
    with Frames(lockstep_box) as frames:
        send(lockstep_box, port, "def m():\n  movej([0.1,-1.6,-1.8,0,1.2,1.5])\nend\n")
        frames.until(lambda f: f.runtime_state == ProgramState.PLAYING)
        assert frames.rest().target_q == pytest.approx([0.1, -1.6, -1.8, 0, 1.2, 1.5])


def test_a_killed_client_leaves_the_arm_at_rest_and_the_next_one_works(ur_client, standard_box, tmp_path):
    with Frames(standard_box) as frames:
        assert cut_off(standard_box, frames, tmp_path / "killed", signal.SIGKILL).code == -signal.SIGKILL
        assert not ramp(frames, STOP_DECELERATION).target_qd.any()
        assert frames.lost() == 0
    done = ur_client("run", "uniform_4_1", *at(standard_box), "--out", tmp_path / "next")
    assert done.code == 0, done.err
    assert (tmp_path / "next" / "uniform_4_1_r1.mcap").exists()


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_client_stops_the_arm_and_says_so_in_one_line(standard_box, tmp_path, end):
    with Frames(standard_box) as frames:
        ended = cut_off(standard_box, frames, tmp_path, end)
        assert ended.code == 1
        assert "interrupted; the arm rests" in ended.complaint()
        assert frames.rest().safety_mode == SafetyMode.NORMAL


def cut_off(box, frames, out, signal_number):
    """Start a run, signal the client well inside the movement, return how it ended."""
    with run_in_movement(box, frames, out) as client:
        client.send_signal(signal_number)
        return finish(client)
