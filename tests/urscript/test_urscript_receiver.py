"""The velocity receiver: which speeds reach the arm in which cycle, with a good stream, a late one, none."""

import pytest

from pc_client.driver.receiver import fill_template, receiver_template
from urscript import ProgramStatus, RecordingHost, check_program, compile_program
from urscript.recording_host import FakeSocket

HOLD, STOP, SPEED = 2, 0, 1


def velocity_receiver(host, port, **values):
    """The client's program for the robot, with other values than the client's where given."""
    standard = {"acceleration": 20.0, "stop_deceleration": 20.0, "read_timeout": 1.0, "missed_allowed": 1}
    return fill_template(
        receiver_template(), {"pc_address": f'"{host}"', "pc_port": port, **standard, **values}
    )


def velocity(value):
    return [SPEED, round(value * 1e6), 0, 0, 0, 0, 0]


class Stream:
    """A run of the receiver that a test feeds one cycle at a time."""

    def __init__(self, **settings):
        self.peer = FakeSocket()
        self.host = RecordingHost(sockets={"velocity": self.peer})
        self.running = compile_program(velocity_receiver("192.0.2.9", 50123, **settings)).start(self.host)
        while not self.running.waits_outside:
            self.running.step()
        assert self.host.names_called() == ["socket_open", "socket_send_int"]
        self.host.calls.clear()

    def cycle(self, *frames):
        """One cycle with these messages; the speeds or words of what the arm was told in it."""
        self.peer.frames.extend(frames)
        self.host.calls.clear()
        self.running.step()
        return [call.arguments[0][0] if call.name == "speedj" else call.name for call in self.host.calls]


def test_it_opens_the_connection_that_was_asked_for_and_says_hello():
    host = RecordingHost(sockets={"velocity": FakeSocket(closed=True)})
    host.run(compile_program(velocity_receiver("192.0.2.9", 50123)))
    assert host.calls[0].arguments == ("192.0.2.9", 50123, "velocity")
    assert host.calls[1][2:] == ("socket_send_int", (1, "velocity"))


def test_each_message_becomes_one_speedj_of_one_cycle():
    stream = Stream(acceleration=7.5)
    for n in range(1, 6):
        assert stream.cycle(velocity(n / 10)) == [n / 10]
        assert stream.running.waits_outside
    assert stream.host.calls[0].arguments == ([0.5, 0, 0, 0, 0, 0], 7.5, 0.008)


def test_of_two_messages_in_one_cycle_the_last_counts():
    stream = Stream()
    assert stream.cycle(velocity(0.1), velocity(0.2)) == [0.2]
    assert stream.cycle(velocity(0.3)) == [0.3]


def test_a_missed_cycle_repeats_the_set_point_then_the_arm_ramps_down():
    stream = Stream(missed_allowed=2)
    assert stream.cycle(velocity(0.1)) == [0.1]
    assert stream.cycle() == [0.1]
    assert stream.cycle() == [0.1]
    assert stream.cycle() == ["stopj"]
    for _ in range(10):
        assert stream.cycle() == []
    assert stream.cycle(velocity(0.2)) == [0.2]


def test_hold_ramps_to_rest_at_once_and_keeps_the_program():
    stream = Stream()
    assert stream.cycle([HOLD, 9, 9, 9, 9, 9, 9]) == []
    assert stream.cycle(velocity(0.1)) == [0.1]
    assert stream.cycle([HOLD, 0, 0, 0, 0, 0, 0]) == ["stopj"]
    assert [stream.cycle([HOLD, 0, 0, 0, 0, 0, 0]) for _ in range(5)] == [[]] * 5
    assert stream.cycle(velocity(0.1)) == [0.1]


@pytest.mark.parametrize(
    ("end", "reason"),
    [
        ([STOP, 0, 0, 0, 0, 0, 0], "stopped by the client"),
        ([77, 0, 0, 0, 0, 0, 0], "unknown mode"),
        (None, "no message from the client"),
    ],
)
def test_every_end_stops_the_arm(end, reason):
    stream = Stream(stop_deceleration=3.0)
    stream.cycle(velocity(0.1))
    stream.host.calls.clear()
    if end is None:
        stream.peer.closed = True
    else:
        stream.peer.frames.append(end)
    while stream.running.step() is ProgramStatus.RUNNING:
        pass
    assert [(call.name, call.thread) for call in stream.host.calls] == [
        ("stopj", "velocity_receiver"),
        ("socket_close", "velocity_receiver"),
    ]
    assert stream.host.calls[0].arguments == (3.0,)
    assert stream.host.messages == [f"velocity_receiver: {reason}"]
    assert (stream.running.status, stream.running.threads) == (ProgramStatus.FINISHED, [])


def test_without_a_peer_it_gives_up_and_moves_nothing():
    host = RecordingHost()
    assert host.run(compile_program(velocity_receiver("192.0.2.9", 50123))).status is ProgramStatus.FINISHED
    assert host.names_called() == ["socket_open"] * 3
    assert host.messages == ["velocity_receiver: cannot connect to 192.0.2.9"]


def test_it_is_plain_text_for_any_controller():
    text = velocity_receiver("192.0.2.9", 50123)
    assert text.isascii()
    lines = text.splitlines()
    assert (lines[0], lines[-1]) == ("def velocity_receiver():", "end")
    assert all(line.startswith(" ") or not line for line in lines[1:-1])
    assert check_program(text) == ((), [])
