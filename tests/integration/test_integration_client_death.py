"""A client that dies in motion: the arm ramps to rest, the program ends, the next client works."""

import os
import signal
import struct

import pytest
from dying_client import Bystander
from integration_support import (
    PERIOD,
    Frames,
    Messages,
    VelocitySession,
    at,
    client_run,
    finish,
    free_port_base,
    is_closed,
    run_in_movement,
    send,
)

from pc_client.recording.recording import load_recording
from protocol.primary.messages import KeyMessage, TextMessage
from protocol.ur_types import ProgramState, SafetyMode
from ur_emulator import ControlBox

STOP_DECELERATION = 20.0  # rad/s^2; of the receiver's own ramp
PROGRAM_END_DECELERATION = 20.0  # rad/s^2; of a program that is stopped from outside
AT_REST_IN_TIME = 0.3  # s of robot time, from the last command


@pytest.fixture
def nameable_box():
    """A box in real time on ports that `--port-base` can name."""
    with ControlBox(pace="realtime", port_base=free_port_base(), seed=7) as box:
        yield box


def ramp(frames, deceleration):
    """Read until the arm rests; every cycle may lose only what the deceleration allows."""
    before = frames.next()
    while True:
        frame = frames.new()
        change = abs(frame.target_qd - before.target_qd).max()
        assert change <= deceleration * PERIOD * (1 + 1e-9)
        before = frame
        if frame.runtime_state == ProgramState.STOPPED:
            return frames.new()  # the target of the cycle in which the program stopped


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
        assert ended.code == 130
        assert "interrupted; the arm rests" in ended.complaint()
        assert frames.rest().safety_mode == SafetyMode.NORMAL


def cut_off(box, frames, out, signal_number):
    """Start a run, signal the client well inside the movement, return how it ended."""
    with run_in_movement(box, frames, out) as client:
        client.send_signal(signal_number)
        return finish(client)


def test_a_client_killed_on_the_way_to_the_start_leaves_the_arm_at_rest_in_time(nameable_box, tmp_path):
    with Frames(nameable_box) as frames, client_run(nameable_box, tmp_path) as client:
        bystander = Bystander(frames)
        bystander.until(lambda: abs(bystander.latest.actual_qd).max() > 0.3)
        client.send_signal(signal.SIGKILL)
        client.wait()
        assert time_to_rest(bystander) <= AT_REST_IN_TIME
        assert list(tmp_path.iterdir()) == []  # it was still on the way


def test_a_client_that_was_stopped_in_a_movement_ends_with_one_line_when_it_goes_on(nameable_box, tmp_path):
    with Frames(nameable_box) as frames, client_run(nameable_box, tmp_path) as client:
        bystander = Bystander(frames)
        bystander.until(lambda: abs(bystander.latest.actual_qd).max() > 0.1 and any(tmp_path.iterdir()))
        client.send_signal(signal.SIGSTOP)
        os.waitpid(client.pid, os.WUNTRACED)
        assert time_to_rest(bystander) <= AT_REST_IN_TIME
        client.send_signal(signal.SIGCONT)
        ended = finish(client)
        assert ended.code == 1
        assert "ur-client: the robot had no command for" in ended.complaint()
        bystander.until_rest()
    (recording,) = tmp_path.iterdir()
    assert "DriverError: the robot had no command for" in load_recording(recording).aborted


def time_to_rest(bystander):
    """From now, when the client is known to be lost, until the arm rests [s]: no more than from its last command."""
    bystander.read_what_has_come()
    now = bystander.latest.timestamp
    bystander.until_rest()
    return bystander.time_to_rest(now)
