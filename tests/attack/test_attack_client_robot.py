"""A robot that lies or floods, and strangers on the network: the attack ends in one line, and the arm rests."""

from __future__ import annotations

import struct
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parents[1] / "pc_client"))
from fake_robot import FakeRobot, Pipe, package

from pc_client.control.controller import CONTROLLERS
from pc_client.driver.primary import PackageStream
from pc_client.driver.questions import LONGEST_LINE, ask_dashboard, ask_rtde
from pc_client.driver.realtime import RealtimeClient
from pc_client.driver.receiver import ReverseServer
from pc_client.driver.session import UrDriver
from pc_client.driver.watchdog import refusal
from pc_client.errors import DriverError, one_line
from pc_client.experiment.excitation import identify
from pc_client.experiment.preflight import preflight
from pc_client.kinematics.model import robot_model
from protocol.primary.messages import TextMessage, encode_message
from protocol.realtime.layout import layout_for_version
from protocol.ur_types import Ports, SoftwareVersion
from ur_emulator.machine.models.robots import robot_by_name

VERSION = SoftwareVersion(3, 15, 8)
LAYOUT = layout_for_version(VERSION)
UR3 = robot_model("ur3")
Change = Callable[[list[float], int], None]
NAN, INF = float("nan"), float("inf")


def lying(attribute: str, change: Change, after: int = 40) -> Any:
    """A robot with another column in the frames after so many in which a program ran."""
    robot, n = FakeRobot(), 0
    robot.q = list(robot_by_name("ur3").home_q)
    true = robot.frame
    column = next(column for column in LAYOUT.columns if column.attribute == attribute)
    where, offset = struct.Struct(f">{column.count}d"), LAYOUT.offset(column)

    def frame() -> bytes:
        nonlocal n
        data = bytearray(true())
        n += robot.program is not None
        if n >= after:
            values = list(where.unpack_from(data, offset))
            change(values, n - after)
            where.pack_into(data, offset, *values)
        return bytes(data)

    robot.frame = frame
    return robot


def put(value: float, place: int = 0) -> Change:
    def change(values: list[float], n: int) -> None:
        values[place] = value

    return change


def drift(rate: float, place: int) -> Change:
    def change(values: list[float], n: int) -> None:
        values[place] += rate * n

    return change


@pytest.mark.parametrize(
    ("attribute", "change", "words"),
    [
        ("timestamp", put(NAN), "time stamp nan s"),
        ("timestamp", put(INF), "time stamp inf s"),
        ("timestamp", put(1e300), "time stamp 1e"),
        ("timestamp", put(-1.0), "time stamp -1 s"),
        ("timestamp", put(5.0), "frames jump back"),
        ("actual_q", put(NAN, 2), "off its path"),
        ("actual_q", put(INF, 2), "off its path"),
        ("actual_q", drift(2e-4, 0), "allowed is 5 mm"),
        ("actual_q", drift(2e-3, 5), "off its path"),
        ("actual_tcp_pose", drift(2e-4, 1), "reports its flange"),
        ("actual_tcp_pose", put(NAN, 4), "reports its flange"),
        ("actual_tcp_pose", put(1e300, 4), "reports its flange"),
        ("robot_mode", put(INF), "inf"),
        ("safety_mode", put(NAN), "nan"),
        ("speed_scaling", put(NAN), "nan"),
    ],
)
def test_frames_that_lie_end_a_session_with_the_arm_at_rest(
    attribute: str, change: Change, words: str
) -> None:
    robot = lying(attribute, change)
    with pytest.raises(DriverError) as caught, UrDriver("robot", network=robot) as driver:
        identify(driver, CONTROLLERS["preview"], UR3)
    assert words in str(caught.value)
    assert robot.at_rest


@pytest.mark.parametrize(
    ("attribute", "place"),
    [("actual_q", 1), ("actual_tcp_pose", 0), ("actual_tcp_pose", 5), ("robot_mode", 0)],
)
@pytest.mark.parametrize("value", [NAN, INF, 1e300])
def test_a_robot_that_lies_from_the_beginning_is_refused_before_it_moves(
    attribute: str, place: int, value: float
) -> None:
    robot = lying(attribute, put(value, place), after=0)
    driver = UrDriver("robot", network=robot)
    assert refusal(preflight(driver.report(), UR3))
    driver.close()
    assert robot.programs == []


def test_ports_that_flood() -> None:
    robot = FakeRobot()
    pipe = robot.connect("robot", 30003, 1.0)
    frames = RealtimeClient(pipe, robot, time_waits=False)
    pipe.receive = lambda timeout: robot.frame() * 14
    with pytest.raises(DriverError, match="the realtime port floods us"):
        frames.drain()
    texts = package(encode_message(TextMessage(text="x" * 40), VERSION)) * 200
    pipe = robot.connect("robot", 30001, 1.0)
    stream = PackageStream(pipe, robot, "primary")
    stream.wait_for_version()
    pipe.receive = lambda timeout: texts
    with pytest.raises(DriverError, match="the primary port floods us"):
        stream.poll()


def test_a_dashboard_that_drips_is_given_up_after_five_seconds() -> None:
    """It sends a byte a look, and never the end of a line."""
    robot = FakeRobot()
    pipe = robot.connect("robot", 29999, 1.0)
    pipe.incoming.clear()

    def drip(timeout: float) -> bytes:
        robot.clock += 0.05
        return b"x"

    pipe.receive = drip
    robot.connect = lambda host, port, timeout: pipe
    with pytest.raises(DriverError, match=rf"without the end of a line; one has at most {LONGEST_LINE}"):
        ask_dashboard(robot, "robot", 29999, ("get robot model",))
    assert robot.clock < 6.0


def test_callers_without_an_end() -> None:
    robot = FakeRobot()
    server = ReverseServer(robot, "10.0.0.1", "10.0.0.2", None)
    robot.listener.callers.extend(Pipe(robot, "stranger") for _ in range(200))
    with pytest.raises(DriverError, match="more than 100 callers"):
        server.forget_callers()


BYTES = st.one_of(
    st.binary(max_size=60),
    st.builds(
        lambda kind, body: (len(body) + 5).to_bytes(4, "big") + bytes([kind]) + body,
        st.sampled_from([16, 20, 25, 5]),
        st.binary(max_size=80),
    ),
)


@given(pieces=st.lists(BYTES, min_size=1, max_size=5), state=st.booleans())
def test_any_bytes_on_the_ports_end_in_a_line(pieces: list[bytes], state: bool) -> None:
    robot = FakeRobot()
    for kind in ("primary", "realtime", "rtde"):
        pipe = robot.connect("robot", getattr(Ports.standard(), kind), 1.0)
        if not state:
            pipe.incoming.clear()
        pipe.incoming.extend(pieces)
        pipe.broken = True
        try:
            if kind == "primary":
                stream = PackageStream(pipe, robot, "primary")
                stream.wait_for_version()
                stream.poll()
            elif kind == "realtime":
                RealtimeClient(pipe, robot, time_waits=False).receive()
            else:
                robot.connect = lambda host, port, timeout, pipe=pipe: pipe
                ask_rtde(robot, "robot", 30004, ("payload",))
        except DriverError as error:
            one_line(error)
