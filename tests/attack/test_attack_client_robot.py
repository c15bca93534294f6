"""The client against a hostile robot: a real box on real sockets, and between the two somebody who spoils the bytes.

Every attack ends in one line, and the arm of the box rests.
"""

from __future__ import annotations

import socket
import struct
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
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
from pc_client.experiment.preflight import model_of, preflight
from pc_client.kinematics.model import robot_model
from protocol.frame_buffer import FrameBuffer
from protocol.primary.messages import TextMessage, encode_message
from protocol.realtime.layout import layout_for_version
from protocol.ur_types import Ports, ProgramState, SoftwareVersion
from ur_emulator import ControlBox
from ur_hil.cell import NO_CELL

VERSION = SoftwareVersion(3, 15, 8)
LAYOUT = layout_for_version(VERSION)
UR3 = robot_model("ur3")
Spoil = Callable[[socket.socket, socket.socket], None]


class Between:
    """Passes on what client and box say, but for ports with a `Spoil`, which passes on what the box says."""

    def __init__(self, box: ControlBox, **spoilt: Spoil) -> None:
        self._box, self._spoilt, self._open = box, spoilt, []
        numbers = {}
        for name in ("primary", "secondary", "realtime", "dashboard", "rtde"):
            listening = socket.create_server(("127.0.0.1", 0))
            self._open.append(listening)
            numbers[name] = listening.getsockname()[1]
            threading.Thread(target=self._serve, args=(name, listening), daemon=True).start()
        self.ports = replace(Ports.standard(), **numbers)

    def __enter__(self) -> Between:
        return self

    def __exit__(self, *error: object) -> None:
        for one in self._open:
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
            one.close()

    def _serve(self, name: str, listening: socket.socket) -> None:
        with suppress(OSError):
            while True:
                client, _ = listening.accept()
                box = socket.create_connection((self._box.host, getattr(self._box.ports, name)))
                self._open += [client, box]
                for one in (client, box):
                    one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                for act, pair in ((copy, (box, client)), (self._spoilt.get(name, copy), (client, box))):
                    threading.Thread(target=quietly, args=(act, *pair), daemon=True).start()


def quietly(act: Spoil, sink: socket.socket, source: socket.socket) -> None:
    with suppress(OSError):
        act(sink, source)
    with suppress(OSError):
        sink.shutdown(socket.SHUT_WR)


def copy(sink: socket.socket, source: socket.socket) -> None:
    while data := source.recv(65536):
        sink.sendall(data)


def frames_with(attribute: str, change: Callable[[list[float], int], None], after: int = 40) -> Spoil:
    """Change a column of the frames after so many in which a program ran."""
    column = next(column for column in LAYOUT.columns if column.attribute == attribute)
    where = struct.Struct(f">{column.count}d")

    def spoil(client: socket.socket, box: socket.socket) -> None:
        buffer, n = FrameBuffer(4096), 0
        while data := box.recv(65536):
            buffer.feed(data)
            while (frame := buffer.next_frame()) is not None:
                n += LAYOUT.decode(frame).runtime_state == ProgramState.PLAYING
                if n >= after:
                    values = list(where.unpack_from(frame, LAYOUT.offset(column)))
                    change(values, n - after)
                    spoilt = bytearray(frame)
                    where.pack_into(spoilt, LAYOUT.offset(column), *values)
                    frame = bytes(spoilt)
                client.sendall(frame)

    return spoil


def put(value: float, place: int = 0) -> Callable[[list[float], int], None]:
    def change(values: list[float], n: int) -> None:
        values[place] = value

    return change


def drift(rate: float, place: int) -> Callable[[list[float], int], None]:
    def change(values: list[float], n: int) -> None:
        values[place] += rate * n

    return change


def flood(client: socket.socket, box: socket.socket) -> None:
    """The box's first words, then texts without an end."""
    client.sendall(box.recv(65536))
    texts = package(encode_message(TextMessage(text="x" * 40), VERSION)) * 200
    while True:
        client.sendall(texts)


def endless_line(client: socket.socket, box: socket.socket) -> None:
    while True:
        client.sendall(b"Universal Robots Dashboard Server " * 100)


def says_ur5(client: socket.socket, box: socket.socket) -> None:
    while data := box.recv(65536):
        client.sendall(data.replace(b"UR3\n", b"UR5\n"))


@pytest.fixture(scope="module")
def box() -> Iterator[ControlBox]:
    with ControlBox(pace="lockstep", port_base=None, seed=7) as box:
        yield box


def line_of(box: ControlBox, **spoilt: Spoil) -> str:
    """What a session with a small movement ends with; the arm of the box must rest then."""
    with (
        pytest.raises(DriverError) as caught,
        Between(box, **spoilt) as between,
        UrDriver("127.0.0.1", between.ports, reverse_port=0) as driver,
    ):
        identify(driver, CONTROLLERS["preview"], UR3)
    with UrDriver("127.0.0.1", box.ports, reverse_port=0) as driver:  # without anybody between
        frame = driver.check_ready()
        assert abs(frame.actual_qd).max() < 0.01
    return str(caught.value)


def test_without_an_attack_the_session_is_whole(box: ControlBox) -> None:
    with Between(box) as between, UrDriver("127.0.0.1", between.ports, reverse_port=0) as driver:
        identify(driver, CONTROLLERS["preview"], UR3)
        assert refusal(preflight(driver.report(), UR3)) == ""


@pytest.mark.parametrize(
    ("attribute", "change", "words"),
    [
        ("timestamp", put(float("nan")), "time stamp nan s"),
        ("timestamp", put(float("inf")), "time stamp inf s"),
        ("timestamp", put(1e300), "time stamp 1e"),
        ("timestamp", put(-1.0), "time stamp -1 s"),
        ("timestamp", put(5.0), "frames jump"),
        ("actual_q", put(float("nan"), 2), "off its path"),
        ("actual_q", put(float("inf"), 2), "off its path"),
        ("actual_q", drift(2e-4, 0), "allowed is 5 mm"),
        ("actual_q", drift(2e-3, 5), "off its path"),
        ("actual_tcp_pose", drift(2e-4, 1), "reports its flange"),
        ("actual_tcp_pose", put(float("nan"), 4), "reports its flange"),
        ("actual_tcp_pose", put(1e300, 4), "reports its flange"),
        ("robot_mode", put(float("inf")), "inf"),
        ("safety_mode", put(float("nan")), "nan"),
        ("speed_scaling", put(float("nan")), "nan"),
    ],
)
def test_frames_that_lie(
    box: ControlBox, attribute: str, change: Callable[[list[float], int], None], words: str
) -> None:
    assert words in line_of(box, realtime=frames_with(attribute, change))


@pytest.mark.parametrize(
    ("attribute", "place"),
    [("actual_q", 1), ("actual_tcp_pose", 0), ("actual_tcp_pose", 5), ("robot_mode", 0)],
)
@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e300])
def test_a_robot_that_lies_from_the_beginning_is_refused_before_it_moves(
    box: ControlBox, attribute: str, place: int, value: float
) -> None:
    spoil = frames_with(attribute, put(value, place), after=0)
    with Between(box, realtime=spoil) as between:
        driver = UrDriver("127.0.0.1", between.ports, reverse_port=0)
        assert refusal(preflight(driver.report(), UR3))
        driver.close()


def test_a_flooded_primary_port(box: ControlBox) -> None:
    # On a busy machine the flood leaves the box no time for frames, and that is seen first.
    said = line_of(box, primary=flood)
    assert "the primary port floods us" in said or "no new realtime frame" in said


def test_a_dashboard_without_the_end_of_a_line(box: ControlBox) -> None:
    assert "without the end of a line" in line_of(box, dashboard=endless_line)


def test_an_arm_that_dashboard_and_primary_port_report_differently(box: ControlBox) -> None:
    assert "UR5 (dashboard), UR3 (port 30001)" in line_of(box, dashboard=says_ur5)
    with Between(box, dashboard=says_ur5) as between:
        driver = UrDriver("127.0.0.1", between.ports, reverse_port=0)
        report = driver.report()
        driver.close()
    assert "UR5 (dashboard), UR3 (port 30001)" in refusal(preflight(report, model_of(report, NO_CELL)))


# ---- without sockets: the clock of the fake robot


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


def test_a_flooded_realtime_port() -> None:
    robot = FakeRobot()
    pipe = robot.connect("robot", 30003, 1.0)
    frames = RealtimeClient(pipe, robot, time_waits=False)
    pipe.receive = lambda timeout: robot.frame() * 14
    with pytest.raises(DriverError, match="the realtime port floods us"):
        frames.drain()


BYTES = st.one_of(
    st.binary(max_size=60),
    st.builds(
        lambda kind, body: (len(body) + 5).to_bytes(4, "big") + bytes([kind]) + body,
        st.sampled_from([16, 20, 25, 5]),
        st.binary(max_size=80),
    ),
)


@settings(max_examples=200)
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
