"""The client's gripper: against the port of a box, and against one that answers as it likes."""

import math
import threading

import numpy as np
import pytest

import pc_client as ur
from pc_client.driver import gripper
from pc_client.driver.gripper import Gripper
from pc_client.errors import ClientError, DriverError
from protocol.robotiq import GripperConnection, Set, encode_value
from ur_hil.tools import TOOLS

HAND = TOOLS["robotiq-2f85"]
SETTINGS = "def settings():\n  set_tcp(p[0, 0, 0.15, 0, 0, 0])\n  set_payload(0.9, [0, 0, 0.058])\nend\n"


@pytest.fixture
def box(ur_box_factory):
    return ur_box_factory(robot="ur5e", tool="robotiq-2f85")


def test_fingers_of_a_box_move_as_they_are_asked(box):
    asked = []
    hand = Gripper(HAND, box.host, box.ports.gripper, asked.append)
    assert hand.width == pytest.approx(0.0425, abs=0.001)  # not activated: as it is found
    assert not asked
    hand.speed = 0.1
    hand.force(120.0)
    hand.move(0.03)
    assert asked == [
        f"the fingers of the Robotiq 2F-85 at {box.host} move to 30.0 mm, pressing with up to 120 N"
    ]
    assert hand.width == pytest.approx(0.03, abs=0.0003)
    assert hand.speed == pytest.approx(0.1, abs=0.001)
    assert not hand.is_holding
    hand.close()
    assert (hand.width, hand.is_holding) == (0.0, False)
    hand.close()  # again: nothing moves
    hand.open()
    assert hand.width == HAND.stroke
    (state,) = box.state.grippers
    assert (state["STA"], state["OBJ"], state["FLT"]) == (3, 3, 0)


def test_an_arm_has_the_gripper_that_it_was_given(box):
    box.run_program(SETTINGS, wait=True)
    arm = ur.connect(box.host, box.ports, tool="robotiq-2f85")
    assert arm.gripper.width > 0.0
    arm.set_payload(1.1, (0.0, 0.0, 0.075))
    assert (box.state.payload, arm.model.cell.tool.mass) == (1.1, 1.1)
    arm.gripper.close()  # with another payload than that of the tool alone
    box.run_program("def off():\n  set_tool_voltage(0)\nend\n", wait=True)
    with pytest.raises(ClientError, match="has no power: 24 V at the tool"):
        arm.gripper.open()


@pytest.fixture
def arm_with_hand(box):
    box.run_program(SETTINGS, wait=True)
    arm = ur.connect(box.host, box.ports, tool="robotiq-2f85")
    arm.gripper.open()
    return arm


SWING = 3.0  # s


def swing(command, seen):
    """A law that swings the base for 3 s, calls a command once at 1 s, and keeps what it gives."""

    def law(frame, reference=None):
        t = frame.timestamp - started[0] if started else 0.0
        started.append(frame.timestamp)
        if t > 1.0 and not seen:
            seen.append("called")
            seen.append(command())
        if reference is not None:
            return reference.qd_feedforward
        return [0.05 * math.sin(2.0 * math.pi * t / SWING), 0, 0, 0, 0, 0] if t < SWING else None

    started = []
    return law


def in_a_thread(act):
    def begin():
        thread = threading.Thread(target=act)
        thread.start()
        return thread

    return begin


@pytest.mark.parametrize("how", ["inline", "thread"])
@pytest.mark.parametrize("motion", ["stream", "run"])
def test_fingers_move_while_a_law_drives_the_arm_and_the_arm_goes_on(arm_with_hand, how, motion):
    arm, hand, seen = arm_with_hand, arm_with_hand.gripper, []
    hand.speed = 0.15

    def close():
        hand.move(0.01)
        return hand.width  # asked of the same connection: its answer comes after that to the command

    law = swing(close if how == "inline" else in_a_thread(close), seen)
    if motion == "stream":
        signals = arm.stream(law)
        assert np.ptp(signals.t) == pytest.approx(SWING, abs=0.1)
    else:
        signals = arm.run(ur.Movement.through([(0.45, -0.15, 0.35), (0.5, 0.0, 0.4)], durations=[SWING]), law)
    assert (signals.stream.late_frames, signals.stream.stops) == (0, [])
    if how == "thread":
        seen[1].join()
    else:
        assert seen[1] > 0.08  # they had not begun to move
    assert hand.width == pytest.approx(0.01, abs=0.0005)


def test_in_real_time_a_law_that_commands_the_fingers_does_not_make_the_arm_stop(ur_box_factory, monkeypatch):
    monkeypatch.setattr("pc_client.driver.velocity_stream._MOST_STOPS", 10**6)  # of a busy machine
    box = ur_box_factory(robot="ur5e", tool="robotiq-2f85", pace="realtime")
    box.run_program(SETTINGS, wait=True)
    arm = ur.connect(box.host, box.ports, tool="robotiq-2f85")
    arm.gripper.open()
    seen = []
    assert np.ptp(arm.stream(swing(arm.gripper.close, seen)).t) == pytest.approx(SWING, abs=0.1)
    assert seen == ["called", None]
    assert arm.gripper.width == 0.0


def test_in_a_rehearsal_no_finger_moves_and_each_command_of_a_law_counts(arm_with_hand):
    arm, hand, calls = arm_with_hand, arm_with_hand.gripper, []

    def law(frame, reference):
        calls.append(hand.width)
        hand.close()
        return [9.0] * 6  # the first command is refused

    with pytest.raises(ClientError, match="not safe to send"):
        arm.run(ur.Movement.through([(0.45, -0.15, 0.35), (0.5, 0.0, 0.4)]), law)
    assert (calls, hand.width) == ([HAND.stroke], HAND.stroke)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda box: None, "the Robotiq 2F-85 is not active: open it before the law runs"),
        (
            lambda box: box.run_program("def off():\n  set_tool_voltage(0)\nend\n", wait=True),
            "has no power: 24 V at the tool",
        ),
    ],
)
def test_fingers_that_cannot_move_are_refused_when_a_law_moves_them_and_not_before(box, spoil, said):
    box.run_program(SETTINGS, wait=True)
    arm = ur.connect(box.host, box.ports, tool="robotiq-2f85")
    spoil(box)
    assert len(arm.stream(swing(lambda: None, [])).t) > 100
    with pytest.raises(ClientError, match=said) as caught:
        arm.stream(swing(arm.gripper.close, []))
    assert "\n" not in str(caught.value)
    assert "recorded until then" in caught.value.__notes__[0]


def test_a_person_is_asked_once_for_a_law_with_its_fingers(arm_with_hand, monkeypatch):
    asked = []
    monkeypatch.setattr(ur.Arm, "simulated", None)
    arm = arm_with_hand
    arm._confirm = lambda text: not asked.append(text)
    arm.stream(swing(arm.gripper.close, []))
    (text,) = asked
    assert "a velocity law drives arm and fingers at" in text


def test_a_person_is_asked_before_fingers_of_an_arm_that_may_be_real(box, monkeypatch):
    asked = []
    box.run_program(SETTINGS, wait=True)
    arm = ur.connect(box.host, box.ports, tool="robotiq-2f85", confirm=asked.append)  # the answer is None: no
    monkeypatch.setattr(ur.Arm, "simulated", None)
    for motion in (arm.gripper.close, lambda: arm.set_payload(2.0, (0.0, 0.0, 0.1))):
        with pytest.raises(ClientError, match="the arm was not moved: the answer was no"):
            motion()
    assert [text.split(" at ")[0] for text in asked] == [
        "the fingers of the Robotiq 2F-85",
        "the payload of the arm",
    ]
    assert (box.state.grippers[0]["STA"], box.state.payload) == (0, 0.9)


def test_an_arm_without_a_gripper_says_so(ur_box_factory):
    box = ur_box_factory(robot="ur5e")
    with pytest.raises(ClientError, match="has no gripper: give connect its tool"):
        _ = ur.connect(box.host, box.ports).gripper
    with pytest.raises(DriverError, match=r"its port at 127.0.0.1 is 0"):
        Gripper(HAND, box.host, box.ports.gripper, print).open()


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda hand: hand.move(0.2), "width: 0.2; give a number from 0 to 0.085 m"),
        (lambda hand: hand.move(float("nan")), "width: nan; give a number from 0 to 0.085 m"),
        (lambda hand: hand.force(10), "force: 10; give a number from 20 to 235 N"),
        (lambda hand: setattr(hand, "speed", 1.0), "speed: 1.0; give a number from 0.02 to 0.15 m/s"),
    ],
)
def test_values_that_it_does_not_have_are_refused_before_anything_is_sent(wrong, said):
    with pytest.raises(ClientError) as refused:
        wrong(Gripper(HAND, "robot.invalid", 1, print))
    assert str(refused.value) == said


class Software:
    """The software of a gripper whose variables are what they are set to; a clock that waits advance.

    `change` sees each SET; `answer` may give other bytes than those of the protocol.
    """

    def __init__(self):
        self.values = dict.fromkeys(("ACT", "GTO", "ATR", "POS", "PRE", "STA", "OBJ", "FLT", "SPE", "FOR"), 0)
        self.requests, self.clock, self.change, self.answer = [], 0.0, lambda values: None, None
        self._parser, self._inbox = GripperConnection(), b""

    def connect(self, host, port, timeout):
        return self

    def send(self, data):
        for request in self._parser.receive(data):
            self.requests.append(request)
            if isinstance(request, Set):
                self.values.update(request.values)
                self.change(dict(request.values))
                self._inbox += b"ack"
            else:
                self._inbox += encode_value(request, self.values[request.name])
        if self.answer is not None:
            self._inbox = self.answer

    def receive(self, timeout):
        self.clock += 0.0 if self._inbox else timeout
        first, self._inbox = self._inbox[:1], self._inbox[1:]
        return first or None

    def close(self):
        pass

    def monotonic(self):
        return self.clock

    def sleep(self, seconds):
        self.clock += seconds


@pytest.fixture
def software(monkeypatch):
    fake = Software()
    monkeypatch.setattr(gripper, "TcpNetwork", lambda: fake)
    monkeypatch.setattr(gripper, "time", fake)
    return fake


def hand():
    return Gripper(HAND, "robot", 63352, lambda text: None)


def test_what_is_sent_is_a_reset_an_activation_and_a_motion(software):
    def change(values):
        if values.get("ACT"):
            software.values["STA"] = 3
        if "POS" in values:
            software.values.update(PRE=values["POS"], OBJ=2)

    software.change = change
    hand().close()
    sent = [request.values for request in software.requests if isinstance(request, Set)]
    assert sent == [
        (("ACT", 0), ("ATR", 0), ("GTO", 0)),
        (("ACT", 1),),
        (("POS", 255), ("SPE", 255), ("FOR", 0), ("GTO", 1)),
    ]
    assert hand().is_holding
    software.values["GTO"] = 0  # OBJ then says nothing
    assert not hand().is_holding


def test_an_activated_gripper_is_not_activated_again_unless_it_has_a_fault(software):
    software.values.update(STA=3, ACT=1, OBJ=3)
    software.change = lambda values: software.values.update(PRE=values.get("POS", 0))
    hand().open()
    assert not any(
        isinstance(request, Set) and "ACT" in dict(request.values) for request in software.requests
    )
    software.values["FLT"] = 10
    software.change = lambda values: software.values.update(
        STA=3 * values.get("ACT", 1), FLT=0, PRE=values.get("POS", 0)
    )
    software.requests.clear()
    hand().open()
    assert Set((("ACT", 1),)) in software.requests


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"STA": "?"}, "has no power"),
        ({}, "is late: its activation takes more than 10 s"),
        ({"STA": 3, "FLT": 8, "ACT": 1}, "is late: its activation"),
        ({"STA": 3, "PRE": 7}, "is late: its start takes more than 2 s"),
        ({"STA": 3}, "is late: its motion takes more than 6.25 s"),
    ],
)
def test_a_gripper_that_does_not_do_it_is_one_line(software, values, said):
    software.values.update(values)
    if "FLT" in values or not values:
        software.change = lambda values: software.values.update(STA=0, FLT=0)
    with pytest.raises(DriverError, match=said) as refused:
        hand().open()
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("becomes", "said"),
    [({"values": {"FLT": 14}}, r"reports fault 14 \(OVER_CURRENT\)"), ({"answer": b""}, "does not answer")],
)
def test_what_comes_of_the_commands_of_a_law_is_told_when_it_has_ended(software, becomes, said):
    software.values.update(STA=3, ACT=1)

    def drive():
        with gripper.beside_law():
            gripper.close()
            software.values.update(becomes.get("values", {}))
            software.answer = becomes.get("answer")

    gripper = hand()
    with pytest.raises(DriverError, match=said):
        drive()


def test_a_fault_is_named(software):
    software.values.update(STA=3)
    software.change = lambda values: software.values.update(OBJ=3, FLT=14)
    with pytest.raises(DriverError, match=r"reports fault 14 \(OVER_CURRENT\)"):
        hand().open()


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (b"?\n", "robot:63352 is not the port of a gripper: '\\?'"),
        (b"SSH-2.0-OpenSSH_9.6\r\n", "'SSH-2.0-OpenSSH_9.6' is no answer to b'GET STA"),
        (b"x" * 5000, "is not the port of a gripper"),
        (b"STA 3", "the software of the Robotiq 2F-85 does not answer"),
    ],
)
def test_what_is_no_gripper_is_refused(software, answer, said):
    software.answer = answer
    with pytest.raises(DriverError, match=said):
        hand().open()


def test_nobody_there_is_one_line():
    with pytest.raises(DriverError, match=r"^no gripper: 127.0.0.1:1 refuses the connection"):
        Gripper(HAND, "127.0.0.1", 1, print).open()


def test_a_no_moves_nothing(software):
    def refuse(text):
        raise ClientError("the answer was no")

    with pytest.raises(ClientError, match="the answer was no"):
        Gripper(HAND, "robot", 63352, refuse).close()
    assert not software.requests
